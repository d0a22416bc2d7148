# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The task of a grasped object as rows on the roller speeds: equations (14) to (20).

For a `Grip` these rows are those of its contacts, see `grip_reach`.

The node velocities of (19) and (20) follow from the roller speeds by (12), so that the unknowns
are the speeds of the working rollers alone.
"""

from __future__ import annotations

from dataclasses import dataclass
import functools
import math
from typing import NamedTuple

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grasp import find_grasping_members, find_roller, Grasp
from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np
from scipy.linalg import lapack

#: Directions in which 1 m/s at the rollers moves the object's surface by less [m/s] are lost.
RANK_TOLERANCE = 1e-5
#: Squares of singular values above this, and above this share of the largest, are not in doubt.
FREE_SHARE = 1e-8
#: Products with speeds up to this stay finite [m/s].
MODEST = 1e100
#: All directions.
EVERYWHERE = np.eye(3)
EVERYWHERE.flags.writeable = False
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
    arm = complex(*grasp.center) - config.points.item(members.nodes[0])
    turn_ahead = 1j / members.ahead.conjugate()  # gradient of the direction angle of B -> B'
    turn_back = 1j / members.back.conjugate()
    # (15): xdot = xdot_B + omega_frame z x arm, since the object is at rest in the grasp frame.
    # (16): omega_frame is the rate of the direction angle of B -> B'.
    x, y = arm.imag * turn_ahead, arm.real * turn_ahead
    # (14), its derivative: the direction angle of C -> C' minus that of B -> B'.
    entries = (
        *(-x, y, turn_ahead, -turn_ahead),  # of B', in the four rows
        *(1.0 + x, 1.0j - y, -turn_ahead, turn_ahead),  # of B
        *(turn_back, -turn_back),  # of C' and C, in the last row
    )
    n = len(config.points)
    rows = np.zeros(4 * n, dtype=np.complex128)
    rows[_places(n, members.nodes)] = entries
    # (17): omega_roll = 2 phidot / d, with the sign of the side on which the object lies.
    rolling = np.array([0.0, 0.0, 2.0 * members.side / grasp.diameter, 0.0])
    return GraspRows(rows.view(np.float64).reshape(4, 2 * n), rolling)


@functools.lru_cache(maxsize=1024)
def _places(count: int, nodes: tuple[int, int, int, int]) -> Indices:
    """Return where the entries of `grasp_rows` are, of B', B, C' and C."""
    b, b_next, c, c_prev = nodes
    first = count * np.arange(4)
    return np.concatenate([first + b_next, first + b, [first[3] + c_prev, first[3] + c]])


@functools.lru_cache(maxsize=2)  # the squeeze control asks again for what was just solved
def task_jacobian(config: Configuration, grasp: Grasp) -> Array:
    """
    Return the map from roller speeds to the motion of the grasped object: (19) after (12).

    :param config: configuration of the robot.
    :param grasp: the grasp.
    :return: (4, r): rows vx, vy [m/s], omega [rad/s] and opening rate of the grip [rad/s], robot
        frame, for 1 m/s at each roller; read-only.
    :raises GraspError: see `grasp_rows`.
    :raises ConfigurationError: the configuration is singular.
    """
    rows = grasp_rows(config, grasp)
    jacobian = config.roller_rows(rows.nodes)
    roller = find_roller(config.robot, grasp.module)
    if roller is not None:
        # (18): omega = omega_frame + omega_roll.
        jacobian[:, roller] += rows.rolling
    jacobian.flags.writeable = False
    return jacobian


@dataclass(frozen=True, eq=False)
class Reach:
    """
    The twists that the working rollers can produce while the grip keeps its angle.

    All rows are speeds of the object's surface, so that rotation and translation compare.

    :ivar rows: (k + g, w) rows of (20) on the speeds of the working rollers [-]: the components
        of the twist along the directions, then what keeps the grip: its angle, or the contacts of
        a `Grip`, as far as rollers change it.
    :ivar directions: (k, 3) orthonormal: the reachable twists.
    :ivar weights: (3,) what turns vx, vy, omega into speeds of the surface: 1, 1, d/2 [m].
    :ivar opening: (g,) what turns an opening rate into speeds along the rows of the grip: d/2 [m]
        for an angle, [-] for a distance.
    """

    rows: Array
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
        sizes, weights, opened = _sizes(radius, opening, len(active))
        rows = sizes * active
        # Rows that are independent together are so in the two steps below.
        squares = lapack.dsyev(rows.dot(rows.T), compute_v=0)[0]
        if squares[0] > FREE_SHARE * max(1.0, squares[-1]):
            return cls(rows, EVERYWHERE, weights, opened)
        task, grip = rows[:3], rows[3:]
        mixed, gains, basis = np.linalg.svd(grip, full_matrices=False)
        held = gains > RANK_TOLERANCE
        kept = basis[held]
        left = task - task.dot(kept.T).dot(kept)
        directions, sizes, _ = np.linalg.svd(left, full_matrices=False)
        reachable = directions[:, sizes > RANK_TOLERANCE].T
        rows = np.concatenate([reachable.dot(task), kept])
        return cls(rows, reachable, weights, opening * mixed[0, held] / gains[held])

    @classmethod
    def of_points(cls, active: Array) -> Reach:
        """
        Compute which velocities of points are reachable.

        :param active: (2 k, w) rows vx, vy of k points on the speeds of the working rollers [-].
        """
        basis, gains, _ = np.linalg.svd(active, full_matrices=False)
        reachable = basis[:, gains > RANK_TOLERANCE].T
        return cls(reachable @ active, reachable, np.ones(len(active)), np.zeros(0))


@functools.lru_cache(maxsize=64)
def _sizes(radius: float, opening: float, count: int) -> tuple[Array, Array, Array]:
    """Return the weights of all rows (count, 1), those of the twist, and `Reach.opening`."""
    sizes = np.array([1.0, 1.0, radius] + [opening] * (count - 3))
    opened = np.array([opening] + [0.0] * (count - 4))
    sizes.flags.writeable = opened.flags.writeable = False
    return sizes[:, None], sizes[:3], opened


def find_reach(
    config: Configuration, grasp: Grasp, working: Indices | None = None
) -> tuple[Array, Reach]:
    """
    Return the task Jacobian (4, r), see `task_jacobian`, and the reachable twists.

    :param config: configuration of the robot.
    :param grasp: the grasp.
    :param working: (w,) numbers of the rollers that have not failed, all if None.
    :raises GraspError: see `grasp_rows`.
    :raises ConfigurationError: the configuration is singular.
    """
    jacobian = task_jacobian(config, grasp)
    radius = 0.5 * grasp.diameter
    active = jacobian if working is None else jacobian[:, working]
    return jacobian, Reach.of(active, radius, radius)


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
        # (20): these rows times the roller speeds are the twist, and the grip's opening rate,
        # which is zero in the paper.
        self.equality = reach.rows
        self.rank = len(reach.directions)
        # A twist of any finite size must not overflow.
        size = max(map(abs, twist.tolist()))
        if reach.directions is EVERYWHERE and opening_rate == 0.0:
            self.reachable = True
            vx, vy, turning = (reach.weights * (twist / size)).tolist()
            length = math.hypot(vx, vy, turning)
            self.speed = size * length
            self.direction = np.zeros(len(self.equality))
            self.direction[:3] = vx / length, vy / length, turning / length
        else:
            self._find_direction(reach, twist, size, opening_rate)
        if self.speed > 0.0:
            self.free = least_cost(even, self.equality, self.direction)

    def _find_direction(
        self, reach: Reach, twist: Array, size: float, opening_rate: float
    ) -> None:
        """Find direction and size of the closest reachable twist, whatever the reach is."""
        opening = reach.opening * opening_rate
        size = max(size, float(np.abs(opening).max(initial=0.0)))
        self.reachable, self.speed = True, 0.0
        if size == 0.0:  # the grip shall open, and nothing changes it
            return
        unit = reach.weights * (twist / size)
        closest = reach.directions.dot(unit)
        missed = closest.dot(reach.directions) - unit
        smallest = REACH_TOLERANCE * math.sqrt(unit.dot(unit))
        self.reachable = math.sqrt(missed.dot(missed)) <= smallest
        self.direction = np.append(closest, opening / size)
        length = math.sqrt(self.direction.dot(self.direction))
        if length > smallest:
            self.speed = size * length
            self.direction /= length

    def velocities(self) -> Array:
        """Return the (w,) roller speeds of the least cost without limits [m/s]; inf beyond."""
        if self.speed < MODEST:
            return self.free * self.speed
        with np.errstate(over='ignore', invalid='ignore'):
            return self.free * self.speed


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
    return even.dot(lapack.dgels(equality.dot(even), right)[1])
