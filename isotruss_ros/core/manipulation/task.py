"""
The task of a grasped object as rows on the roller speeds: equations (14) to (20).

For a `Grip` these rows are those of its contacts, see `grip_reach`.

The node velocities of (19) and (20) follow from the roller speeds by (12), so that the unknowns
are the speeds of the working rollers alone.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import NamedTuple

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grasp import find_grasping_members, Grasp
from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np
from scipy.linalg import lapack

#: Directions in which 1 m/s at the rollers moves the object's surface by less [m/s] are lost.
RANK_TOLERANCE = 1e-5
#: A twist is unreachable where more than this share of it is.
REACH_TOLERANCE = 1e-9


class GraspRows(NamedTuple):
    """
    The rows of M(x) in (19), and what rolling (17) adds to them.

    :ivar nodes: (4, 2n) rows vx, vy [m/s], omega [rad/s], opening rate of the grip [rad/s] on the
        node velocities (x0, y0, x1, y1, ...) [m/s], robot frame.
    :ivar rolling: (4,) what the speed of the grip module's roller adds to each row [1/m].
    """

    nodes: Array
    rolling: Array


def grasp_rows(config: Configuration, grasp: Grasp) -> GraspRows:
    """
    Return M(x) of (19).

    :param config: configuration of the robot.
    :param grasp: the grasp.
    :raises GraspError: no such module, or the object is not between its two members.
    """
    members = find_grasping_members(config, grasp)
    b, b_next, c, c_prev = members.nodes
    arm = complex(*grasp.center) - complex(config.points[b])
    turn_ahead = 1j / members.ahead.conjugate()  # gradient of the direction angle of B -> B'
    turn_back = 1j / members.back.conjugate()
    rows = np.zeros((4, len(config.points)), dtype=np.complex128)
    # (15): xdot = xdot_B + omega_frame z x arm, since the object is at rest in the grasp frame.
    # (16): omega_frame is the rate of the direction angle of B -> B'.
    rates = np.array([-arm.imag, arm.real, 1.0, -1.0])
    rows[:, b_next] = rates * turn_ahead
    rows[:, b] = -rows[:, b_next]
    rows[0, b] += 1.0
    rows[1, b] += 1.0j
    # (14), its derivative: the direction angle of C -> C' minus that of B -> B'.
    rows[3, c_prev] = turn_back
    rows[3, c] = -turn_back
    # (17): omega_roll = 2 phidot / d, with the sign of the side on which the object lies.
    rolling = np.array([0.0, 0.0, 2.0 * members.side / grasp.diameter, 0.0])
    return GraspRows(rows.view(np.float64), rolling)


def task_jacobian(config: Configuration, grasp: Grasp) -> Array:
    """
    Return the map from roller speeds to the motion of the grasped object: (19) after (12).

    :param config: configuration of the robot.
    :param grasp: the grasp.
    :return: (4, r): rows vx, vy [m/s], omega [rad/s] and opening rate of the grip [rad/s], robot
        frame, for 1 m/s at each roller.
    :raises GraspError: see `grasp_rows`.
    :raises ConfigurationError: the configuration is singular.
    """
    rows = grasp_rows(config, grasp)
    jacobian = config.module_rows(rows.nodes)
    # (18): omega = omega_frame + omega_roll.
    jacobian[:, config.robot.module_names.index(grasp.module)] += rows.rolling
    return jacobian[:, config.robot.topology.driven]


@dataclass(frozen=True, eq=False)
class Reach:
    """
    The twists that the working rollers can produce while the grip keeps its angle.

    All rows are speeds of the object's surface, so that rotation and translation compare.

    :ivar task: (3, w) rows vx, vy, omega d/2 on the speeds of the working rollers [-].
    :ivar grip: (g, w) rows that keep the grip: its angle, or the contacts of a `Grip`, as far as
        rollers change it [-].
    :ivar directions: (k, 3) orthonormal: the reachable twists.
    :ivar weights: (3,) what turns vx, vy, omega into speeds of the surface: 1, 1, d/2 [m].
    :ivar opening: (g,) what turns an opening rate into speeds along the rows of the grip: d/2 [m]
        for an angle, [-] for a distance.
    """

    task: Array
    grip: Array
    directions: Array
    weights: Array
    opening: Array

    @classmethod
    def of(cls, active: Array, radius: float, opening: float) -> Reach:
        """
        Compute which twists are reachable.

        :param active: (3 + g, w) columns of the task Jacobian that belong to working rollers.
        :param radius: of the object [m].
        :param opening: what turns the g rows of the grip into speeds [-] or [m]; the first of
            them is the opening rate.
        """
        weights = np.array([1.0, 1.0, radius])
        task = weights[:, None] * active[:3]
        if len(active) > 4:
            return cls._of_many(task, opening * active[3:], weights)
        grip = active[3] * opening
        square = float(grip @ grip)
        held = square > RANK_TOLERANCE**2
        keeping = task - (task @ grip)[:, None] * (grip / square) if held else task
        basis, gains, _ = np.linalg.svd(keeping, full_matrices=False)
        kept = grip[None] if held else grip[None][:0]
        opened = np.array([opening] if held else [])
        return cls(task, kept, basis[:, gains > RANK_TOLERANCE].T, weights, opened)

    @classmethod
    def _of_many(cls, task: Array, grip: Array, weights: Array) -> Reach:
        """Compute which twists are reachable with several rows (g, w) that keep the grip."""
        mixed, gains, basis = np.linalg.svd(grip, full_matrices=False)
        held = gains > RANK_TOLERANCE
        kept = basis[held]
        directions, sizes, _ = np.linalg.svd(task - (task @ kept.T) @ kept, full_matrices=False)
        reachable = directions[:, sizes > RANK_TOLERANCE].T
        return cls(task, kept, reachable, weights, mixed[0, held] / gains[held])

    @classmethod
    def of_points(cls, active: Array) -> Reach:
        """
        Compute which velocities of points are reachable.

        :param active: (2 k, w) rows vx, vy of k points on the speeds of the working rollers [-].
        """
        basis, gains, _ = np.linalg.svd(active, full_matrices=False)
        no_grip = np.zeros((0, active.shape[1]))
        reachable = basis[:, gains > RANK_TOLERANCE].T
        return cls(active, no_grip, reachable, np.ones(len(active)), np.zeros(0))


def find_reach(config: Configuration, grasp: Grasp, working: Indices) -> tuple[Array, Reach]:
    """
    Return the task Jacobian (4, r), see `task_jacobian`, and the reachable twists.

    :param config: configuration of the robot.
    :param grasp: the grasp.
    :param working: (w,) numbers of the rollers that have not failed.
    :raises GraspError: see `grasp_rows`.
    :raises ConfigurationError: the configuration is singular.
    """
    jacobian = task_jacobian(config, grasp)
    radius = 0.5 * grasp.diameter
    return jacobian, Reach.of(jacobian[:, working], radius, radius)


class Task:
    """
    The commanded twist, reduced to what the working rollers can produce.

    :param reach: the reachable twists.
    :param twist: (3,) vx, vy [m/s], omega [rad/s] in the robot frame.
    :param even: (w, w) E with |C E y| = |y|, see `WorkingRollers`.
    :param opening_rate: right-hand side of the grip's row [rad/s], of two contacts [m/s]; it or
        the twist is not zero.
    :ivar equality: (k, w) rows of (20) on the working rollers: reachable directions, then grip.
    :ivar direction: (k,) unit vector of the closest reachable twist in these rows.
    :ivar speed: its size [m/s], zero where nothing of the twist is reachable.
    :ivar reachable: whether it is the commanded twist.
    :ivar rank: how many of the rows are reachable directions.
    :ivar free: (w,) roller speeds that carry out 1 m/s of it at the least cost, without limits.
    """

    def __init__(self, reach: Reach, twist: Array, even: Array, opening_rate: float = 0.0) -> None:
        opening = reach.opening * opening_rate
        size = float(np.abs(twist).max())
        if opening_rate != 0.0:
            size = max(size, float(np.abs(opening).max(initial=0.0)))
        # A twist of any finite size must not overflow.
        unit = reach.weights * (twist / size)
        closest = reach.directions @ unit
        opening /= size
        length = math.sqrt(closest @ closest + opening @ opening)
        missed = reach.directions.T @ closest - unit
        smallest = REACH_TOLERANCE * math.sqrt(unit @ unit)
        self.rank = rank = len(reach.directions)
        self.reachable = math.sqrt(missed @ missed) <= smallest
        self.speed = size * length if length > smallest else 0.0
        # (20): these rows times the roller speeds are the twist, and the grip's opening rate,
        # which is zero in the paper.
        self.equality = np.vstack([reach.directions @ reach.task, reach.grip])
        self.direction = np.zeros(len(self.equality))
        if self.speed > 0.0:
            self.direction[:rank] = closest / length
            self.direction[rank:] = opening / length
            self.free = least_cost(even, self.equality, self.direction)


def least_cost(even: Array, equality: Array, direction: Array) -> Array:
    """
    Return the u (w,) of the least cost (11) under (20): J u = direction, without limits.

    :param even: (w, w) E with |C E y| = |y|, see `WorkingRollers`.
    :param equality: (k, w) J, of full row rank.
    :param direction: (k,).
    """
    # (20): u = E y with the shortest y that fulfils J E y = direction.
    right = np.zeros(len(even))
    right[: len(direction)] = direction
    return even @ lapack.dgels(equality @ even, right)[1]
