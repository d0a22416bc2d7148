# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

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

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.model.topology import check_roller_names
from isotruss_ros.core.numerics.arrays import Array, finite_array, Indices
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import lapack

#: Directions in which 1 m/s at the rollers moves the object's surface by less [m/s] are lost.
RANK_TOLERANCE = 1e-5
#: Squares of singular values above this, and above this share of the largest, are not in doubt.
FREE_SHARE = 1e-8
#: All directions.
EVERYWHERE = np.eye(3)
EVERYWHERE.flags.writeable = False
#: Twists faster than this are as good as this fast: roller speeds for them stay finite [m/s].
FASTEST = 1e290
#: A cost is symmetric, and its eigenvalues positive, by this share of its largest entry [-].
COST_TOLERANCE = 1e-12
SMALLEST_COST = float(np.finfo(float).tiny)
#: A twist is unreachable where more than this share of it is.
REACH_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class WorkingRollers:
    """The rollers that have not failed, and the cost of their speeds."""

    count: int  #: number of all rollers
    places: Indices  #: (w,) their numbers among all rollers
    cost: Array  #: (w, w) C^T C, the cost (11) of their speeds [-]
    even: Array  #: (w, w) E with |C E y| = |y|: speeds of equal cost [-]

    def take(self, rows: Array) -> Array:
        """
        Return a copy of what belongs to these rollers.

        :param rows: (..., r) on the speeds of all rollers.
        """
        return rows.take(self.places, -1)

    def with_cost(self, cost: ArrayLike) -> WorkingRollers:
        """
        Return these rollers with another cost (11) of their speeds.

        Only the ratios of its entries count: its trace becomes that of the cost of the paper.

        :param cost: (r, r) of the speeds of all rollers, symmetric and positive definite.
        :raises GraspError: it is not.
        """
        words = f'the cost, one of {self.count} rows'
        given = cost if np.iterable(cost) else [cost]
        matrix = np.array([finite_array(row, self.count, words, GraspError) for row in given])
        if len(matrix) != self.count:
            raise GraspError(f'the cost: {len(matrix)} rows; must be {self.count}')
        size = max(float(np.abs(matrix).max()), SMALLEST_COST)
        matrix = matrix / size
        least = float(np.linalg.eigvalsh(matrix)[0])
        if np.abs(matrix - matrix.T).max() > COST_TOLERANCE or least < COST_TOLERANCE:
            raise GraspError(
                f'the cost has the smallest eigenvalue {size * least:.4g}: must be symmetric and '
                'positive definite; add a small part of the identity'
            )
        own = matrix[np.ix_(self.places, self.places)]
        if len(own):
            own = own * (np.trace(self.cost) / np.trace(own))
        return WorkingRollers(self.count, self.places, own, _even(own))

    def spread(self, speeds: Array) -> Array:
        """
        Return the speeds of all rollers [m/s]; those that have failed stand still.

        :param speeds: (w,) of the working rollers [m/s].
        """
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
    return WorkingRollers(len(robot.roller_names), places, cost, _even(cost))


def _even(cost: Array) -> Array:
    """Return E (w, w) with |C E y| = |y| for a cost C^T C."""
    return np.linalg.inv(np.linalg.cholesky(cost)).T


class Reach(NamedTuple):
    """
    The twists that the working rollers can produce while the contacts keep.

    All rows are speeds of the object's surface, so that rotation and translation compare.

    :ivar working: the rollers that work.
    :ivar motion: (3, r) rows of the twist on the speeds of all rollers; of joints, (k, r).
    :ivar rows: (k + g, w) rows of (20) on the speeds of the working rollers [-]: the components
        of the twist along the directions, then what keeps the contacts, as far as rollers change
        it.
    :ivar directions: (k, 3) orthonormal: the reachable twists.
    :ivar weights: (3,) what turns vx, vy, omega into speeds of the surface: 1, 1, d/2 [m].
    :ivar opening: (g,) what turns an opening rate into speeds along the rows of the grip [-].
    """

    working: WorkingRollers
    motion: Array
    rows: Array
    directions: Array
    weights: Array
    opening: Array

    @property
    def contact_rows(self) -> Array:
        """Return the rows (g, r) on the speeds of all rollers that keep the contacts [-]."""
        rows, working = self.rows[len(self.directions) :], self.working
        if len(working.places) == working.count:
            return rows
        found = np.zeros((len(rows), working.count))
        found[:, working.places] = rows
        return found

    @classmethod
    def of(cls, jacobian: Array, working: WorkingRollers, weights: Array) -> Reach:
        """
        Compute which twists are reachable.

        :param jacobian: (3 + g, r) of the grip, see `grip_jacobian`; or (k, r) of joints.
        :param working: the rollers that work.
        :param weights: (3,) see above; of joints (k,) ones.
        """
        count, rows = len(weights), working.take(jacobian)
        rows[:count] *= weights[:, None]
        motion, task, grip = jacobian[:count], rows[:count], rows[count:]
        # Rows that are independent together are so in the two steps below: eigenvalues of their
        # products, in place of `numpy.linalg.svd` of the grip and of what is left of the task.
        squares = lapack.dsyev(rows.dot(rows.T), compute_v=0)[0].tolist()
        if squares[0] > FREE_SHARE * max(1.0, squares[-1]):
            opening = np.zeros(len(grip))
            opening[:1] = 1.0
            everywhere = EVERYWHERE if count == 3 else np.eye(count)
            return cls(working, motion, rows, everywhere, weights, opening)
        mixed, gains, basis = np.linalg.svd(grip, full_matrices=False)
        held = gains > RANK_TOLERANCE
        kept = basis[held]
        left = task - task.dot(kept.T).dot(kept)
        directions, sizes, _ = np.linalg.svd(left, full_matrices=False)
        reachable = directions[:, sizes > RANK_TOLERANCE].T
        rows = np.concatenate([reachable.dot(task), kept])
        opening = mixed[:1, held].sum(axis=0) / gains[held]
        return cls(working, motion, rows, reachable, weights, opening)


class Task(NamedTuple):
    """
    The commanded twist, reduced to what the working rollers can produce.

    :ivar reach: the reachable twists, with the rows of (20).
    :ivar direction: (k + g,) unit vector of the closest reachable twist in these rows.
    :ivar speed: its size [m/s], zero where nothing of the twist is reachable.
    :ivar status: `OK` where it is the commanded twist, `UNREACHABLE` where it is not, and `IDLE`
        where nothing is commanded.
    :ivar free: (w,) roller speeds that carry out 1 m/s of it at the least cost, without limits.
    :ivar velocities: (r,) speeds of all rollers that carry out all of it so [m/s].
    """

    reach: Reach
    direction: Array
    speed: float
    status: Status
    free: Array
    velocities: Array


def find_task(reach: Reach, twist: Array, opening_rate: float = 0.0) -> Task:
    """
    Find the closest reachable twist (20), and the roller speeds of the least cost (11) for it.

    :param reach: the reachable twists.
    :param twist: (3,) vx, vy [m/s], omega [rad/s] in the robot frame.
    :param opening_rate: right-hand side of the grip's row [m/s], zero in the paper.
    """
    direction, working = np.zeros(len(reach.rows)), reach.working
    opening = (reach.opening * opening_rate).tolist() if opening_rate else []
    # A twist of any finite size must not overflow.
    size = max(map(abs, twist.tolist() + opening)) or 1.0
    unit = reach.weights * (twist / size)
    smallest, status = 0.0, Status.OK
    if reach.directions is EVERYWHERE:
        direction[:3] = unit
    else:
        closest = reach.directions.dot(unit)
        direction[: len(closest)] = closest
        missed = closest.dot(reach.directions) - unit
        smallest = REACH_TOLERANCE * math.sqrt(unit.dot(unit))
        if math.sqrt(missed.dot(missed)) > smallest:
            status = Status.UNREACHABLE
    if opening:
        first = len(direction) - len(opening)
        direction[first:] = np.divide(opening, size)
    length = math.sqrt(direction.dot(direction))
    if length <= smallest:  # or the grip shall open, and nothing changes it
        standing = np.zeros(working.count)
        if status is Status.OK and not opening:
            status = Status.IDLE
        return Task(reach, direction, 0.0, status, working.take(standing), standing)
    direction /= length
    speed = size * length
    free = least_cost(working.even, reach.rows, direction)
    velocities = working.spread(free * min(speed, FASTEST))
    return Task(reach, direction, speed, status, free, velocities)


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
