# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Response of a held object to small wrenches, and its slip margin.

The contacts stick, and the tubes deform. Contact forces are linear in the wrench, so each slip
condition is a plane in the space of wrenches (fx, fy, m / arm); the slip margin is the distance to
the nearest plane. A member slips if |T| = mu N, where T and N are summed over its contacts.
"""

from __future__ import annotations

from dataclasses import dataclass
import functools
from typing import NamedTuple

from isotruss_ros.core.holding.pressed_contacts import ContactForces, POSE
from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np
from scipy.linalg import lapack


@dataclass(frozen=True, eq=False)
class GripResponse:
    """
    Linear response of a held object with k sticking contacts to a wrench (fx, fy, m / arm).

    The responses are derivatives of the unknowns of `ContactForces`.
    """

    state: ContactForces  #: the equilibrium
    owners: Indices  #: (k,) grasping member of each contact, numbered within the grip
    change: Array  #: (3 + 4k, 3) response to the wrench [N]
    by_opening: Array  #: (3 + 4k,) response to the opening, see `HeldGrip.squeeze_stiffness`
    ends: Indices  #: (e,) indices of the contacts that are an end of a face
    by_gap: Array  #: (3 + 4k, e) responses to a gap at each of these ends
    arm: float  #: characteristic radius, see `ConvexObject.arm` [m]
    #: (3, 3) matrix that moves the reference point of moments from centroid to origin
    about_middle: Array

    @property
    def pose(self) -> Array:
        """Return the derivatives (3, 3) of the object's pose by the wrench [m/N, rad/N]."""
        return self.change[:POSE]

    @property
    def forces(self) -> Array:
        """Return the derivatives (2k, 3) of normal and friction forces by the wrench [-]."""
        return self.change[self.state.places.forces]

    @functools.cached_property
    def by_release(self) -> Array:
        """Return the changes (e, 2k) of the forces by the released tension of each end [-]."""
        forces = self.by_gap[self.state.places.forces].T
        # The tension of an end is the negative of its normal force.
        return -forces / forces[np.arange(len(self.ends)), self.ends, None]

    @property
    def stiffness(self) -> Array:
        """Return the derivatives (3, 3) of the wrench by the displacement [N/m, N, N m]."""
        stiffness = np.linalg.inv(self.pose)
        stiffness[2] *= self.arm
        return stiffness

    @property
    def stable(self) -> bool:
        """Return whether the object's stiffness is positive definite."""
        compliance = self.pose * np.array([[1.0], [1.0], [self.arm]])
        return not lapack.dpotrf(0.5 * (compliance + compliance.T))[1]


class SlipPlanes(NamedTuple):
    """
    Planes of c slip conditions in the space of wrenches, at which the reserve of friction is zero.

    The first conditions are mu N - T and then mu N + T of the m members. The next ones are, for
    each end of a face, these conditions after the end has opened. Such a condition is relevant
    only for wrenches that also open the end. So its plane is that of opening or that of slip,
    whichever is farther from the origin. The distance of this plane is a lower bound of the
    distance to the intersection of both planes.
    """

    rows: Array  #: (c, 2k) reserves by normal and then friction forces of the contacts
    friction_rates: Array  #: (c, 2k) derivatives of `rows` by the coefficient of friction
    reserve: Array  #: (c,) reserves of friction [N]
    slope: Array  #: (c, 3) derivatives of the reserves by the wrench
    size: Array  #: (c,) norms of these derivatives for moments about the centroid
    about_middle: Array  #: (3, 3) see `GripResponse.about_middle`

    @property
    def margin(self) -> float:
        """Return the norm of the smallest wrench about the centroid that causes slip [N]."""
        return float((self.reserve / self.size).min())

    @property
    def direction(self) -> Array:
        """Return the wrench of `margin` divided by its norm about the centroid, (3,)."""
        # The shortest wrench to a plane is opposite to its slope, with moments about the centroid.
        nearest, about_middle = int((self.reserve / self.size).argmin()), self.about_middle
        return -about_middle @ about_middle.T @ self.slope[nearest] / self.size[nearest]


@functools.lru_cache(maxsize=8)
def slip_planes(response: GripResponse, friction: float) -> SlipPlanes:
    """Return the slip conditions of a held object for a coefficient of friction, cached."""
    about_middle, forces = response.about_middle, response.state.forces

    def planes(rows: Array) -> tuple[Array, Array, Array]:
        """Return reserve, slope and size of `SlipPlanes` for given rows."""
        slope = rows @ response.forces
        # np.hypot, because for very large friction the squares may overflow.
        return rows @ forces, slope, np.hypot.reduce(slope @ about_middle, axis=1)

    # Rows are factors of the normal forces, then of the friction forces, of all contacts.
    on_member = np.eye(response.owners[-1] + 1)[response.owners].T
    zeros = np.zeros_like(on_member)
    normal_sums = np.tile(np.hstack([on_member, zeros]), (2, 1))
    friction_sums = np.hstack([zeros, on_member])
    slip_rows = friction * normal_sums - np.vstack([friction_sums, -friction_sums])
    rows, friction_rates = [slip_rows], [normal_sums]
    # When an end opens, its force is released and changes the forces of the other contacts.
    for by_release, end in zip(response.by_release, response.ends.tolist(), strict=True):
        end_row = np.eye(1, len(forces), end)  # normal force of the end
        slip_after = slip_rows + np.outer(slip_rows @ by_release, end_row)
        slip_reserve, _, slip_size = planes(slip_after)
        end_force, _, opening_size = planes(end_row)
        is_slip_farther = (slip_reserve / slip_size > end_force / opening_size)[:, None]
        sums_after = normal_sums + np.outer(normal_sums @ by_release, end_row)
        rows.append(np.where(is_slip_farther, slip_after, end_row))
        friction_rates.append(np.where(is_slip_farther, sums_after, 0.0))
    joined = np.concatenate(rows)
    return SlipPlanes(joined, np.concatenate(friction_rates), *planes(joined), about_middle)
