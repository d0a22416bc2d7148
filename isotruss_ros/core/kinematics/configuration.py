# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Configurations: positions of all nodes at given roller travel."""

from __future__ import annotations

from functools import cached_property

from isotruss_ros.core.errors import ConfigurationError, format_numbers
from isotruss_ros.core.kinematics.constraints import follow_branch, follow_branches
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.factorization import Factor, factorize
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.numerics.tolerances import MAX_NEWTON_ITERATIONS, NEGLIGIBLE_SHARE
import numpy as np
from numpy.typing import ArrayLike

#: Largest roller travel that is predicted to first order [m].
MAX_FIRST_ORDER_TRAVEL = 3e-3


class Configuration(Record, data=('roller_positions', 'member_lengths', 'nodes')):
    """
    Configuration of a robot, immutable; it is created by `Robot.configuration`.

    :ivar robot: the robot.
    :ivar roller_positions: (r,) travel of the tube through each roller since home [m].
    :ivar points: (n,) node positions x + iy in the robot frame [m].
    """

    def __init__(self, robot: Mechanism, roller_positions: Array, points: Points) -> None:
        self.robot, self.roller_positions, self.points = robot, roller_positions, points
        roller_positions.flags.writeable = False
        points.flags.writeable = False

    def __eq__(self, other: object) -> bool:
        """Return whether another configuration has the same robot and equal roller travel."""
        if type(other) is not Configuration:
            return NotImplemented
        # Called in every control cycle for cache keys.
        return (
            np.array_equal(self.roller_positions, other.roller_positions)
            and np.array_equal(self.points, other.points)
            and (self.robot is other.robot or self.robot == other.robot)
        )

    def __hash__(self) -> int:
        """Return the hash of the roller travel."""
        return hash(self.roller_positions.tobytes())

    def __reduce__(self) -> tuple:
        """Return the constructor arguments for pickling; caches are left out."""
        return Configuration, (self.robot, self.roller_positions, self.points)

    @property
    def nodes(self) -> Array:
        """Return the node positions in `Robot.node_names` order, robot frame, (n, 2) [m]."""
        return self.points.view(np.float64).reshape(-1, 2)

    @cached_property
    def member_lengths(self) -> Array:
        """Return the lengths of the members between pinch points, in module order, (m,) [m]."""
        topology, points = self.robot.topology, self.points
        lengths = np.abs(points.take(topology.end) - points.take(topology.b))
        lengths.flags.writeable = False
        return lengths

    @cached_property
    def member_axes(self) -> Points:
        """Return the unit vectors from the members' starts to their ends, (m,) x + iy."""
        topology, points = self.robot.topology, self.points
        axes = (points[topology.end] - points[topology.b]) / self.member_lengths
        axes.flags.writeable = False
        return axes

    @cached_property
    def factor(self) -> Factor:
        """
        Return the factorised matrix of (12) in this configuration.

        :raises ConfigurationError: the matrix is singular.
        """
        try:
            return factorize(self.robot.constraints.matrix(self.points))
        except np.linalg.LinAlgError as error:
            positions = format_numbers(self.roller_positions)
            raise ConfigurationError(
                f'robot {self.robot.name}: the shape at roller positions {positions} m is '
                'singular; choose other roller positions'
            ) from error

    @cached_property
    @single_threaded
    def node_jacobian(self) -> Array:
        """
        Return the Jacobian (2n, r) of the node positions with respect to roller travel, from (12).

        The rows are x0, y0, x1, y1, ...

        :raises ConfigurationError: the configuration is singular.
        """
        topology = self.robot.topology
        # (12) with Ldot = C phidot; the other constraints are constant.
        length_rates = np.zeros((self.robot.constraints.n_rows, len(topology.driven)))
        length_rates[: topology.n_modules] = topology.incidence
        return np.asarray(self.factor.solve(length_rates))

    @single_threaded
    def moved_to(self, roller_positions: ArrayLike) -> Configuration:
        """
        Return the configuration at other roller travel, on the same branch of solutions.

        :param roller_positions: (r,) roller travel since home [m].
        :raises ConfigurationError: the roller travel has a wrong shape or is not finite; a member
            would have no length; the straight line in roller travel passes a singular
            configuration; or the continuation along it takes more than `MAX_NEWTON_ITERATIONS`
            steps.
        """
        robot, start, goal = self.robot, self.roller_positions, np.array(roller_positions)
        # Arrays of floats need no conversion.
        if goal.dtype != float or goal.shape != start.shape or not np.isfinite(goal).all():
            goal = robot.check_rollers(roller_positions, 'roller positions [m]')
        goal_lengths = _span_lengths(robot, goal)[: robot.topology.n_modules]
        member = int(goal_lengths.argmin())
        if goal_lengths[member] <= 0.0:
            raise ConfigurationError(
                f'robot {robot.name}: roller positions {format_numbers(goal)} m make member '
                f'{robot.member_names[member]} {goal_lengths[member]:.6g} m long; must be positive'
            )

        # Continuation along the line from start to goal, with an adaptive step.
        fraction, step = 0.0, 1.0  # of the line
        points = self.points
        factor = self.__dict__.get('factor')  # at `points`; None if not factorised yet
        for _ in range(MAX_NEWTON_ITERATIONS):
            next_fraction = min(fraction + step, 1.0)
            lengths = _span_lengths(robot, start + next_fraction * (goal - start))
            next_points = follow_branch(robot.constraints, points, lengths, factor)
            if next_points is None:
                step *= 0.25
                if step < NEGLIGIBLE_SHARE:
                    cause = 'no configuration exists'
                    break
                continue
            if next_fraction == 1.0:
                return Configuration(robot, goal, next_points)
            fraction, points, factor = next_fraction, next_points, None
            step *= 2.0
        else:
            cause = f'near a singular one, none found in {MAX_NEWTON_ITERATIONS} steps'
        raise ConfigurationError(
            f'robot {robot.name}: roller positions {format_numbers(goal)} m: {cause} '
            f'beyond {100 * fraction:.6g} % of the way from {format_numbers(start)} m'
        )

    @single_threaded
    def moved_together(self, roller_positions: Array) -> list[Configuration | ConfigurationError]:
        """
        Return the results or errors of `moved_to` for several roller travels.

        :param roller_positions: (n, r) roller travels since home [m].
        """
        constraints, goals = self.robot.constraints, np.array(roller_positions)
        lengths = np.array([_span_lengths(self.robot, goal) for goal in goals])
        points, are_found = follow_branches(constraints, self.points, lengths, self.factor)
        are_found &= (lengths > 0.0).all(axis=-1)
        moved: list[Configuration | ConfigurationError] = []
        for goal, nodes, is_found in zip(goals, points, are_found.tolist(), strict=True):
            try:
                found = Configuration(self.robot, goal, nodes) if is_found else self.moved_to(goal)
            except ConfigurationError as error:
                moved.append(error)
            else:
                moved.append(found)
        return moved

    def predict(self, travel: Array) -> Configuration:
        """
        Predict the configuration after further roller travel.

        The prediction is of first order up to `MAX_FIRST_ORDER_TRAVEL`, and exact for longer
        travel. The first-order prediction is much faster than `moved_to`. It violates the
        constraints by about travel^2 / (member length), so `moved_to` must not start from it.

        :param travel: (r,) change of the roller travel [m].
        :raises ConfigurationError: see `moved_to`.
        """
        if not travel.any():
            return self
        if np.abs(travel).max() > MAX_FIRST_ORDER_TRAVEL:
            return self.moved_to(self.roller_positions + travel)
        # (12) with dL = C dphi.
        length_changes = np.zeros(self.robot.constraints.n_rows)
        length_changes[: self.robot.topology.n_modules] = self.robot.topology.incidence @ travel
        displacements = self.factor.solve(length_changes).view(np.complex128)
        positions = self.roller_positions + travel
        return Configuration(self.robot, positions, self.points + displacements)

    def roller_rows(self, node_rows: Array) -> Array:
        """
        Convert linear functions of node velocities to functions of roller speeds.

        The transpose of (12) is solved with one right-hand side for each row.

        :param node_rows: (k, 2n) coefficients of the node velocities (x0, y0, x1, y1, ...).
        :return: (k, r) coefficients of the roller speeds.
        :raises ConfigurationError: the configuration is singular.
        """
        # Coefficients of the constraints' rates in (12); only the lengths of members change.
        length_rows = self.factor.solve(node_rows.T, transposed=True).T
        # A roller lengthens the member of its module by its travel, and shortens the previous one.
        lengthened = self.robot.topology.driven
        shortened = self.robot.topology.previous[lengthened]
        return length_rows.take(lengthened, 1) - length_rows.take(shortened, 1)


def _span_lengths(robot: Mechanism, roller_positions: Array) -> Array:
    """Return the lengths (4m,) of members and module sides at given roller travel [m]."""
    lengths = robot.home_lengths.copy()
    lengths[: robot.topology.n_modules] += robot.topology.incidence @ roller_positions
    return lengths


class ConfigurationTracker:
    """Forward kinematics at measured roller travel, starting from the previous configuration."""

    def __init__(self, home: Configuration) -> None:
        self._home = self._last = home

    def configuration(self, roller_positions: Array) -> Configuration:
        """Return the configuration at measured roller travel (r,) [m]."""
        if not np.array_equal(roller_positions, self._last.roller_positions):
            try:
                self._last = self._last.moved_to(roller_positions)
            except ConfigurationError:
                self._last = self._home.moved_to(roller_positions)
        return self._last
