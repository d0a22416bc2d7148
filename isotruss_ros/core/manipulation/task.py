# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Reachable twists of a grasped object, and the equality constraint (20) for a desired twist.

The constraints are those of the contacts of a grip, see `grip_rows`. Node velocities are
eliminated by (12), so the unknowns are the speeds of the working rollers.
"""

from __future__ import annotations

from dataclasses import dataclass
import functools
import math
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.model.topology import check_names, Topology
from isotruss_ros.core.numerics.arrays import (
    Array,
    covariance_matrix,
    identity,
    Indices,
    MAX_MAGNITUDE,
)
from isotruss_ros.core.numerics.tolerances import COINCIDENCE, ROUNDING, SMALLEST_NORMAL
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import lapack

#: Smallest singular value of a direction that counts as reachable, which is the speed of the
#: object's surface [m/s] for roller speeds of 1 m/s.
RANK_TOLERANCE = 1e-5
#: Largest part of a twist that `soft_rank` may remove with the status OK, relative to the twist
#: [-]. The pose control of a loop restores this part, but not that of an unreachable direction.
MAX_REMOVED_SHARE = 0.05


@dataclass(frozen=True, eq=False)
class WorkingRollers:
    """Indices of the working rollers, with the cost (11) of the speeds of these rollers."""

    count: int  #: number of all rollers
    indices: Indices  #: (w,) indices of the working rollers
    cost: Array  #: (w, w) cost C^T C (11) of their speeds [-]

    @functools.cached_property
    def whitening(self) -> Array:
        """Return the matrix E (w, w) such that the speeds E y have the cost |y|^2 [-]."""
        return np.linalg.inv(np.linalg.cholesky(self.cost)).T

    def with_cost(self, cost: ArrayLike) -> WorkingRollers:
        """Return the rollers with another cost (11), scaled to the trace of the paper's cost."""
        matrix = covariance_matrix(cost, self.count, 'the cost matrix', GraspError)
        matrix /= max(float(np.abs(matrix).max()), SMALLEST_NORMAL)
        if np.linalg.eigvalsh(matrix)[0] < COINCIDENCE:
            raise GraspError(
                'the cost matrix: must be positive definite; add a small multiple of the identity'
            )
        working_cost = matrix[np.ix_(self.indices, self.indices)]
        if len(working_cost):
            working_cost = working_cost * (np.trace(self.cost) / np.trace(working_cost))
        return WorkingRollers(self.count, self.indices, working_cost)

    def spread(self, values: Array) -> Array:
        """Return values of all rollers, zero for failed ones, from those of working rollers."""
        if len(self.indices) == self.count:
            return values
        spread = np.zeros((*values.shape[:-1], self.count))
        spread[..., self.indices] = values
        return spread


@functools.lru_cache(maxsize=16)
def working_rollers(topology: Topology, failed: frozenset[str]) -> WorkingRollers:
    """Return the rollers of a robot that have not failed, with the cost of their speeds."""
    check_names('failed rollers', failed, topology.roller_names, topology.robot)
    indices = np.flatnonzero([name not in failed for name in topology.roller_names])
    # (11): J = |Ldot|^2, and Ldot = C phidot keeps the length of each tube (13).
    incidence = topology.incidence[:, indices]
    return WorkingRollers(len(topology.roller_names), indices, incidence.T @ incidence)


class Reach(NamedTuple):
    """
    Reachable twists: twists that the working rollers can produce without breaking contacts.

    Rotations are multiplied by d/2. If the task moves joints, the k velocity components of the
    joints replace the twist, and there are no contacts.
    """

    working: WorkingRollers  #: the working rollers
    #: (3, r) Jacobian of the twist, or (k, r) of the joint velocities, with respect to the speeds
    #: of all rollers
    motion: Array
    #: (k + g + l, w) rows of (20) on the speeds of the working rollers [-]: components of the
    #: twist along `directions`, then contact constraints, except those that all roller speeds
    #: fulfil, then rates of gaps
    rows: Array
    directions: Array  #: (k, 3) orthonormal basis of the reachable twists
    weights: Array  #: (3,) factors from vx, vy, omega to surface speeds: 1, 1, d/2 [m]
    #: (g,) right-hand sides of the contact rows if the grip opens at 1 m/s [-]
    opening: Array
    #: (l,) right-hand sides of the gaps' rows, rates at which they close, see `land_faces` [m/s]
    closing: Array = np.zeros(0)

    @classmethod
    def of(cls, jacobian: Array, working: WorkingRollers, weights: Array) -> Reach:
        """Return the reachable twists from a Jacobian (3 + g, r) as of `grip_jacobian`."""
        # Rows of the twist, in units of surface speed, then of the contacts.
        count, rows = len(weights), jacobian.take(working.indices, -1)
        motion, twist_rows, contact_rows = jacobian[:count], rows[:count], rows[count:]
        twist_rows *= weights[:, None]
        # Full rank: the smallest eigenvalue of the Gram matrix shows it in less time than the
        # singular value decompositions below.
        squares = lapack.dsyev(rows.dot(rows.T), compute_v=0)[0].tolist()
        if squares[0] > 100.0 * RANK_TOLERANCE**2 * max(1.0, squares[-1]):
            opening = np.zeros(len(contact_rows))
            opening[:1] = 1.0
            return cls(working, motion, rows, identity(count), weights, opening)
        # Orthonormal rows of the contact constraints.
        row_basis, gains, speed_basis = np.linalg.svd(contact_rows, full_matrices=False)
        effective = gains > RANK_TOLERANCE
        constraints = speed_basis[effective]
        # The first contact row, if there is any, is the opening rate.
        opening = row_basis[:1, effective].sum(axis=0) / gains[effective]
        # Twists of the speeds that fulfil these constraints.
        projected = twist_rows - twist_rows.dot(constraints.T).dot(constraints)
        axes, speeds, _ = np.linalg.svd(projected, full_matrices=False)
        directions = axes[:, speeds > RANK_TOLERANCE].T
        independent = np.concatenate([directions.dot(twist_rows), constraints])
        return cls(working, motion, independent, directions, weights, opening)


class Task(NamedTuple):
    """Desired twist, projected on the reachable twists."""

    reach: Reach  #: reachable twists, with the rows of (20)
    #: (k + g,) unit vector of the closest reachable twist, in the basis of `Reach.rows`
    direction: Array
    speed: float  #: norm of the closest reachable twist [m/s]
    missed: float  #: norm of the unreachable part, relative to the norm of the desired twist [-]
    #: component of this task's twist along the closest reachable one, relative to the norm of the
    #: latter [-]; less than 1 where `soft_rank` removes more than `MAX_REMOVED_SHARE`
    share: float
    #: `UNREACHABLE` if a part of the desired twist is unreachable; `SLIDING` if `share` is less
    #: than 1; `IDLE` if the twist is zero; otherwise `OK`
    status: Status
    free: Array  #: (w,) least-cost speeds for 1 m/s along `direction`, without limits
    #: (r,) least-cost speeds of all rollers for the closest reachable twist [m/s]
    velocities: Array


def find_task(
    reach: Reach, twist: Array, opening_rate: float = 0.0, soft_rank: float = 0.0
) -> Task:
    """Return the reachable twist closest to a desired one, with least-cost roller speeds (20)."""
    working, dof = reach.working, len(reach.directions)
    opening: list[float] = []
    if opening_rate or len(reach.closing):
        opening = [*(reach.opening * opening_rate).tolist(), *reach.closing.tolist()]
    # Twist and opening are divided by the largest component, so that no finite twist overflows.
    size = max(map(abs, twist.tolist() + opening)) or 1.0
    desired = reach.weights * (twist / size)
    norm = math.sqrt(desired.dot(desired))
    # Projection on the reachable twists.
    closest, missed = reach.directions.dot(desired), 0.0
    if dof < len(desired):
        unreachable = closest.dot(reach.directions) - desired
        missed = math.sqrt(unreachable.dot(unreachable)) / (norm or 1.0)
    status = Status.OK if missed <= ROUNDING else Status.UNREACHABLE
    # Right-hand side of (20): of the twist, then of the contacts.
    direction = np.zeros(len(reach.rows))
    direction[:dof] = closest
    if opening:
        direction[dof:] = np.divide(opening, size)
    share = _damp(reach, direction, soft_rank) if soft_rank > 0.0 else 1.0
    if share < 1.0 and status is Status.OK:
        status = Status.SLIDING
    # Least-cost speeds for the unit vector of the right-hand side.
    length = math.sqrt(direction.dot(direction))
    if length <= ROUNDING * norm:  # also if no roller speed produces the opening rate
        if status is Status.OK and not opening:
            status = Status.IDLE
        length, free = 0.0, np.zeros(len(working.indices))
    else:
        direction /= length
        free = least_cost(working.whitening, reach.rows, direction)
    # Larger twists are mistakes; the bound keeps the roller speeds finite.
    velocities = working.spread(free * min(size * length, MAX_MAGNITUDE))
    return Task(reach, direction, size * length, missed, share, status, free, velocities)


def least_cost(whitening: Array, equality: Array, direction: Array) -> Array:
    """
    Return the minimiser u (w,) of the cost (11) under the task J u = direction.

    It is E lstsq(J E, direction) for a whitening E.
    """
    # (20): u = E y with the minimum-norm y of J E y = direction, which is longer than this.
    right = np.zeros(len(whitening))
    right[: len(direction)] = direction
    return whitening.dot(lapack.dgels(equality.dot(whitening), right)[1])


def _damp(reach: Reach, direction: Array, soft_rank: float) -> float:
    """
    Reduce a direction of (20) in place where the task is nearly singular; return `Task.share`.

    Components along singular vectors of the twist with singular values s are multiplied by min(1,
    s^2 / soft_rank^2), so their roller speeds fall with s instead of growing with 1 / s.
    """
    dof = len(reach.directions)
    twist, contacts = slice(dof), slice(dof, None)
    # Gram matrix of the rows, for speeds of unit cost.
    whitened = reach.rows.dot(reach.working.whitening)
    gram = whitened.dot(whitened.T)
    # Its Schur complement, for constant contacts, has the squared singular values of the twist.
    by_contacts = np.linalg.solve(gram[contacts, contacts], gram[contacts, twist])
    squares, modes = np.linalg.eigh(gram[twist, twist] - gram[twist, contacts].dot(by_contacts))
    if (squares >= soft_rank**2).all():
        return 1.0
    removed_shares = 1.0 - np.clip(squares / soft_rank**2, 0.0, 1.0)
    # The least-cost speeds for the opening rate produce a part of the twist; the other is reduced.
    remainder = direction[twist] - direction[contacts].dot(by_contacts)
    removed = modes.dot(removed_shares * remainder.dot(modes))
    wanted = direction[twist].copy()
    direction[twist] -= removed
    square = float(wanted.dot(wanted))
    rounding = ROUNDING**2 * float(remainder.dot(remainder))
    if removed.dot(removed) <= max(MAX_REMOVED_SHARE**2 * square, rounding):
        return 1.0
    along = float(direction[twist].dot(wanted)) / square if square else 0.0
    return min(max(along, 0.0), 1.0 - ROUNDING)
