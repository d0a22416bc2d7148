# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What rollers can do with a grasped object: its reachable twists, and the task (20).

The rows are those of a grip's contacts on the roller speeds, see `grip_rows`; the node velocities
follow from these by (12), so that the unknowns are the speeds of the working rollers alone.
"""

from __future__ import annotations

from dataclasses import dataclass
import functools
import math
from typing import NamedTuple

from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.topology import check_roller_names
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
#: The opening rate is the first row of a grip, which has nine at most.
FIRST_ROW = np.eye(1, 9)[0]
FIRST_ROW.flags.writeable = False
#: A twist is unreachable where more than this share of it is.
REACH_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class WorkingRollers:
    """The rollers that have not failed, and the cost of their speeds."""

    count: int  #: number of all rollers
    places: Indices  #: (w,) their numbers among all rollers
    cost: Array  #: (w, w) C^T C, the cost (11) of their speeds [-]
    even: Array  #: (w, w) E with |C E y| = |y|: speeds of equal cost [-]
    whole: bool  #: whether these are all rollers of the robot

    def spread(self, speeds: Array) -> Array:
        """
        Return the speeds of all rollers [m/s]; those that have failed stand still.

        :param speeds: (w,) of the working rollers [m/s].
        """
        if self.whole:
            return speeds
        velocities = np.zeros(self.count)
        velocities[self.places] = speeds
        return velocities


@functools.lru_cache(maxsize=16)
def working_rollers(robot: Robot, failed: frozenset[str]) -> WorkingRollers:
    """
    Return the rollers that have not failed.

    :param robot: the robot.
    :param failed: names of the rollers that have failed.
    :raises GraspError: the robot has no such roller.
    """
    check_roller_names('failed rollers', failed, robot.roller_names)
    places = np.array(
        [i for i, name in enumerate(robot.roller_names) if name not in failed], dtype=int
    )
    # (11): J = |Ldot|^2, and Ldot = C phidot keeps the length of each tube (13).
    incidence = robot.topology.incidence[:, places]
    cost = incidence.T @ incidence
    even = np.linalg.inv(np.linalg.cholesky(cost)).T
    count = len(robot.roller_names)
    return WorkingRollers(count, places, cost, even, len(places) == count)


class Reach(NamedTuple):
    """
    The twists that the working rollers can produce while the contacts keep.

    All rows are speeds of the object's surface, so that rotation and translation compare.

    :ivar rows: (k + g, w) rows of (20) on the speeds of the working rollers [-]: the components
        of the twist along the directions, then what keeps the contacts, as far as rollers change
        it.
    :ivar directions: (k, 3) orthonormal: the reachable twists.
    :ivar weights: (3,) what turns vx, vy, omega into speeds of the surface: 1, 1, d/2 [m].
    :ivar opening: (g,) what turns an opening rate into speeds along the rows of the grip [-].
    """

    rows: Array
    directions: Array
    weights: Array
    opening: Array

    @classmethod
    def of(cls, active: Array, radius: float) -> Reach:
        """
        Compute which twists are reachable.

        :param active: (3 + g, w) columns of the grip's rows that belong to working rollers; the
            first of the g is the opening rate.
        :param radius: of the object [m].
        """
        weights, rows = np.array([1.0, 1.0, radius]), active.copy()
        rows[2] *= radius
        task, grip = rows[:3], rows[3:]
        # Rows that are independent together are so in the two steps below: eigenvalues of their
        # products, in place of `numpy.linalg.svd` of the grip and of what is left of the task.
        squares = lapack.dsyev(rows.dot(rows.T), compute_v=0)[0].tolist()
        if squares[0] > FREE_SHARE * max(1.0, squares[-1]):
            return cls(rows, EVERYWHERE, weights, FIRST_ROW[: len(grip)])
        mixed, gains, basis = np.linalg.svd(grip, full_matrices=False)
        held = gains > RANK_TOLERANCE
        kept = basis[held]
        left = task - task.dot(kept.T).dot(kept)
        directions, sizes, _ = np.linalg.svd(left, full_matrices=False)
        reachable = directions[:, sizes > RANK_TOLERANCE].T
        rows = np.concatenate([reachable.dot(task), kept])
        return cls(rows, reachable, weights, mixed[0, held] / gains[held])

    @classmethod
    def of_points(cls, active: Array) -> Reach:
        """
        Compute which velocities of points are reachable.

        :param active: (2 k, w) rows vx, vy of k points on the speeds of the working rollers [-].
        """
        basis, gains, _ = np.linalg.svd(active, full_matrices=False)
        reachable = basis[:, gains > RANK_TOLERANCE].T
        return cls(reachable @ active, reachable, np.ones(len(active)), np.zeros(0))


class Motion(NamedTuple):
    """What rollers do with an object in a grip, or with joints."""

    rows: Array  #: (k, r) of the motion on the speeds of all rollers, of a grip those of the twist
    reach: Reach  #: the motions that the working rollers can produce


class Task:
    """
    The commanded twist, reduced to what the working rollers can produce.

    :param reach: the reachable twists.
    :param twist: (3,) vx, vy [m/s], omega [rad/s] in the robot frame.
    :param working: the working rollers.
    :param opening_rate: right-hand side of the grip's row [m/s]; it or the twist is not zero.
    :ivar equality: (k, w) rows of (20) on the working rollers: reachable directions, then grip.
    :ivar direction: (k,) unit vector of the closest reachable twist in these rows.
    :ivar speed: its size [m/s], zero where nothing of the twist is reachable.
    :ivar reachable: whether it is the commanded twist.
    :ivar rank: how many of the rows are reachable directions.
    :ivar free: (w,) roller speeds that carry out 1 m/s of it at the least cost, without limits.
    :ivar velocities: (w,) roller speeds that carry out all of it so; inf beyond all numbers [m/s].
    :ivar roller_velocities: (r,) these, and those of the rollers that have failed [m/s].
    """

    def __init__(
        self, reach: Reach, twist: Array, working: WorkingRollers, opening_rate: float = 0.0
    ) -> None:
        # (20): these rows times the roller speeds are the twist, and the grip's opening rate,
        # which is zero in the paper.
        self.equality = reach.rows
        self.rank = len(reach.directions)
        # A twist of any finite size must not overflow.
        size = max(map(abs, twist.tolist()))
        if reach.directions is EVERYWHERE and opening_rate == 0.0:
            # In place of `_find_direction`, where nothing is projected.
            self.reachable = True
            vx, vy, turning = (reach.weights * (twist / size)).tolist()
            length = math.hypot(vx, vy, turning)
            self.speed = size * length
            self.direction = np.zeros(len(self.equality))
            self.direction[:3] = vx / length, vy / length, turning / length
        else:
            self._find_direction(reach, twist, size, opening_rate)
        if self.speed > 0.0:
            self.free = least_cost(working.even, self.equality, self.direction)
            if self.speed < MODEST:
                self.velocities = self.free * self.speed
            else:
                with np.errstate(over='ignore', invalid='ignore'):
                    self.velocities = self.free * self.speed
            self.roller_velocities = working.spread(self.velocities)

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


def least_cost(even: Array, equality: Array, direction: Array) -> Array:
    """
    Return the u (w,) of the least cost (11) under (20): J u = direction, without limits.

    In place of `even @ numpy.linalg.lstsq(equality @ even, direction)[0]`, by the full rank.

    :param even: (w, w) E with |C E y| = |y|, see `WorkingRollers`.
    :param equality: (k, w) J, of full row rank.
    :param direction: (k,).
    """
    # (20): u = E y with the shortest y that fulfils J E y = direction.
    right = np.zeros(len(even))
    right[: len(direction)] = direction
    return even.dot(lapack.dgels(equality.dot(even), right)[1])
