"""A configuration: where every node of the robot is at given roller travel."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from isotruss_ros.core.constraints import Points, Targets
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.kinematics import follow_branch
from isotruss_ros.core.linear import Factor, factorize
import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from isotruss_ros.core.robot import Robot
    from isotruss_ros.core.structure import Structure

Array = NDArray[np.float64]

#: No member changes by more than this share of the shortest in one step along a branch.
MAX_STEP = 0.25
#: Where a step in which no member changes by more than this fails, the branch ends [m].
MIN_STEP = 1e-9


class Configuration:
    """
    The shape of a robot; made by `Robot.configuration`, never changed afterwards.

    :ivar robot: the robot.
    :ivar roller_positions: (r,) travel of the tube through each roller since home [m].
    :ivar points: (n,) node positions x + iy in the robot's frame [m].
    """

    def __init__(self, robot: Robot, roller_positions: Array, points: Points) -> None:
        self.robot = robot
        self.roller_positions = roller_positions
        self.points = points
        roller_positions.flags.writeable = False
        points.flags.writeable = False

    @property
    def nodes(self) -> Array:
        """Return the (n, 2) node positions in `Robot.node_names` order, robot frame [m]."""
        return self.points.view(np.float64).reshape(-1, 2)

    @property
    def member_lengths(self) -> Array:
        """Return the (m,) member lengths, pinch to pinch, in `Robot.member_names` order [m]."""
        return self.robot.constraints.lengths(self.points)[: self.robot.layout.n_modules]

    @cached_property
    def gradients(self) -> Points:
        """Return the entries of the matrix of (12), see `Constraints.gradients`."""
        return self.robot.constraints.gradients(self.points)

    @cached_property
    def matrix(self) -> Array:
        """Return the square matrix of (12): tube, module, bisection and ground rows, dense."""
        matrix = self.robot.constraints.matrix_of(self.gradients)
        return matrix if isinstance(matrix, np.ndarray) else matrix.toarray()

    @cached_property
    def factor(self) -> Factor:
        """
        Return the factored matrix of (12).

        :raises ConfigurationError: the matrix is singular: the shape is not rigid.
        """
        try:
            return factorize(self.robot.constraints.matrix_of(self.gradients))
        except np.linalg.LinAlgError as error:
            raise ConfigurationError(
                f'robot {self.robot.name}: the shape at roller positions '
                f'{self.roller_positions.tolist()} m is not rigid; stay away from it'
            ) from error

    @cached_property
    def structure(self) -> Structure:
        """Return the frame of the robot in this shape, for the statics."""
        from isotruss_ros.core.structure import Structure

        return Structure(self)

    def residual(self) -> Array:
        """Return what is left of the constraints: [m] and, for the bisection rows, [rad]."""
        return self.robot.constraints.residual(
            self.points, _targets(self.robot, self.roller_positions)
        )

    def node_velocities(self, roller_velocities: ArrayLike) -> Array:
        """
        Return the node velocities by equation (12).

        :param roller_velocities: (r,) speed of the tube through each roller [m/s].
        :return: (n, 2) [m/s].
        """
        rollers = self.robot.check_rollers(roller_velocities, 'roller velocities [m/s]')
        return self._velocities(rollers).view(np.float64).reshape(-1, 2)

    def moved_to(self, roller_positions: ArrayLike) -> Configuration:
        """
        Return the configuration at other roller travel, reached without leaving the branch.

        :param roller_positions: (r,) travel since home [m].
        :raises ConfigurationError: wrong shape or not finite; a member would have no length; or
            the straight way there in roller travel passes a shape that the robot cannot take.
        """
        robot = self.robot
        goal = robot.check_rollers(roller_positions, 'roller positions [m]')
        start = self.roller_positions
        m = robot.layout.n_modules
        goal_targets = _targets(robot, goal)
        goal_lengths = goal_targets.lengths[:m]
        if goal_lengths.min() <= 0.0:
            worst = int(goal_lengths.argmin())
            raise ConfigurationError(
                f'robot {robot.name}: roller positions {goal.tolist()} m make member '
                f'{robot.member_names[worst]} {goal_lengths[worst]:.6g} m long; must be positive'
            )
        lengths = self.member_lengths
        way = float(np.abs(goal_lengths - lengths).max())
        longest = MAX_STEP * float(min(lengths.min(), goal_lengths.min()))
        points, factor = self.points, self.__dict__.get('factor')
        done, step = 0.0, min(way, longest)
        while done < way:
            end = way if done + step > way * (1.0 - 1e-9) else done + step
            targets = goal_targets
            if end < way:
                targets = _targets(robot, start + (end / way) * (goal - start))
            found = follow_branch(robot.constraints, points, targets, factor)
            if found is not None:
                points, factor, done, step = found, None, end, min(2.0 * step, longest)
            elif step < MIN_STEP:
                raise ConfigurationError(
                    f'robot {robot.name}: roller positions {goal.tolist()} m: no shape of the '
                    f'robot beyond {100 * done / way:.6g} % of the way from {start.tolist()} m'
                )
            else:
                step *= 0.5
        return Configuration(robot, goal, points)

    def extrapolated(self, roller_velocities: Array, duration: float) -> Configuration:
        """
        Return where the nodes will be, to first order in the duration.

        Much quicker than `moved_to`, and off the constraints by about (speed * duration)^2 over
        the length of a member: to look ahead with, not to go on from.

        :param roller_velocities: (r,) speed of the tube through each roller [m/s].
        :param duration: [s].
        """
        points = self.points + duration * self._velocities(roller_velocities)
        return Configuration(
            self.robot, self.roller_positions + duration * roller_velocities, points
        )

    def module_rows(self, node_rows: Array) -> Array:
        """
        Turn rows on node velocities into rows on the speeds of the tubes through the modules.

        Nodes follow by (12); the transposed solve needs one right-hand side for each row.

        :param node_rows: (k, 2n) rows on the node velocities (x0, y0, x1, y1, ...).
        :return: (k, m), for 1 m/s at each module, a passive one too.
        :raises ConfigurationError: the configuration is singular.
        """
        layout = self.robot.layout
        by_length = self.factor.solve_transposed(node_rows.T)[: layout.n_modules]
        return (by_length - by_length[layout.previous]).T  # dL_i = dphi_i - dphi_following(i)

    def _velocities(self, rollers: Array) -> Points:
        right = np.zeros(self.robot.constraints.n_rows)
        right[: self.robot.layout.n_modules] = self.robot.layout.length_change(rollers)
        return self.factor.solve(right).view(np.complex128)


def _targets(robot: Robot, roller_positions: Array) -> Targets:
    lengths = robot.home_targets.lengths.copy()
    lengths[: robot.layout.n_modules] += robot.layout.length_change(roller_positions)
    return Targets(lengths, robot.home_targets.ground)
