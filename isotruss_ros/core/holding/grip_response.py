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
from typing import ClassVar, NamedTuple

from isotruss_ros.core.holding.contact_statics import ContactStatics
from isotruss_ros.core.holding.pressed_contacts import ContactForces, POSE
from isotruss_ros.core.holding.rolling_invariants import rolling_rows
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.object_samples import ObjectSamples
from isotruss_ros.core.numerics.arrays import Array, Flags, identity, Indices, Points
from isotruss_ros.core.numerics.factorization import solve_each
from isotruss_ros.core.numerics.tolerances import ROUNDING
import numpy as np


@dataclass(frozen=True, eq=False)
class GripResponse:
    """
    Linear response of a held object with k sticking contacts to a wrench (fx, fy, m / arm).

    The responses are derivatives of the unknowns of `ContactForces`. Of several samples, all
    arrays have the samples as their first axis.
    """

    shared: ClassVar[tuple[str, ...]] = ('owners', 'ends')
    state: ContactForces  #: the equilibrium
    owners: Indices  #: (k,) grasping member of each contact, numbered within the grip
    change: Array  #: (3 + 4k, 3) response to the wrench [N]
    by_opening: Array  #: (3 + 4k,) response to the opening, see `HeldGrip.squeeze_stiffness`
    ends: Indices  #: (e,) indices of the contacts that are an end of a face
    by_gap: Array  #: (3 + 4k, e) responses to a gap at each of these ends
    arm: float | Array  #: characteristic radius, see `ConvexObject.arm` [m]
    #: (3, 3) matrix that moves the reference point of moments from centroid to origin
    about_middle: Array
    is_neutral: Flags  #: () whether the equilibrium is neutral, so that the compliance is singular

    @property
    def pose(self) -> Array:
        """Return the derivatives (3, 3) of the object's pose by the wrench [m/N, rad/N]."""
        return self.change[..., :POSE, :]

    @property
    def forces(self) -> Array:
        """Return the derivatives (2k, 3) of normal and friction forces by the wrench [-]."""
        return self.change[..., self.state.places.forces, :]

    @functools.cached_property
    def by_release(self) -> Array:
        """Return the changes (e, 2k) of the forces by the released tension of each end [-]."""
        forces = self.by_gap[..., self.state.places.forces, :].swapaxes(-1, -2)
        # The tension of an end is the negative of its normal force.
        return -forces / forces[..., np.arange(len(self.ends)), self.ends, None]

    @property
    def compliance(self) -> Array:
        """Return the derivatives (3, 3) of the pose by the wrench with its moment [N m]."""
        arm = np.ones((*np.shape(self.arm), 3, 1))
        arm[..., 2, 0] = self.arm
        return self.pose * arm

    @property
    def stiffness(self) -> Array:
        """Return the derivatives (3, 3) of the wrench by the displacement [N/m, N, N m]."""
        stiffness = np.linalg.inv(self.pose)
        stiffness[2] *= self.arm
        return stiffness

    @property
    def stable(self) -> Flags:
        """Return whether the object's stiffness is positive definite."""
        compliance = np.where(self.is_neutral[..., None, None], np.eye(3), self.compliance)
        symmetric = 0.5 * (compliance + compliance.swapaxes(-1, -2))
        return ~self.is_neutral & (np.linalg.eigvalsh(symmetric)[..., 0] > 0.0)


def respond(statics: ContactStatics, state: ContactForces, residuals: Array) -> Array:
    """
    Return the unknowns' changes that cancel residuals (3 + 4k, c).

    Raise LinAlgError if the equilibrium is neutral; of several samples, the changes are NaN.
    """
    indices, idle = state.places, _idle_indices(state)
    jacobian, right = state.jacobian.copy(), -residuals
    rolling = rolling_rows(statics, state.unknowns, state.normals)
    jacobian[..., indices.conditions, :] = rolling
    # A dent is infinitely soft at zero force. So to first order, the force of such a contact stays
    # zero: this takes the place of touching across the member, and of sticking.
    rows = np.append(3 * idle + 1, indices.conditions.start + idle)
    columns = np.append(indices.normal.start + idle, indices.friction.start + idle)
    jacobian[..., rows, :] = 0.0
    jacobian[..., rows, columns] = 1.0
    right[..., rows, :] = 0.0
    return solve_each(jacobian, right)


def idle_contacts(state: ContactForces) -> Flags:
    """Return which contacts (k,) have no force."""
    normal = np.abs(state.normal_forces)
    return normal <= ROUNDING * normal.sum(axis=-1, keepdims=True)


def _idle_indices(state: ContactForces) -> Indices:
    """Return the indices of the contacts without force, which are the same in all samples."""
    return np.flatnonzero(idle_contacts(state).reshape(-1, state.normals.shape[-1])[0])


def find_response(
    statics: ContactStatics, state: ContactForces, body: ConvexObject | ObjectSamples
) -> GripResponse:
    """Return the linear response of an object to a wrench, at its pose in equilibrium."""
    indices, owners, axes = state.places, statics.contacts.owners, statics.bent.lines.axis
    is_pressed = np.ones(len(owners), dtype=bool)
    is_pressed[_idle_indices(state)] = False
    ends = np.flatnonzero(is_pressed & (np.bincount(owners, is_pressed)[owners] > 1))
    # Columns: 0 to 2 the wrench, 3 the opening of the grip, then a gap at each end of a face.
    lead = axes.shape[:-1]
    residuals = np.zeros((*lead, indices.size, 4 + len(ends)))
    residuals[..., indices.balance, :3] = identity(3)
    # Axes: contact; touch along the member, across it and in inclination; column.
    touch = residuals[..., : 3 * len(owners), :].reshape(*lead, len(owners), 3, -1)
    opening = axes.conj() * _opening(statics, state)
    touch[..., 0, 3], touch[..., 1, 3] = opening.real, opening.imag
    gaps = -axes[..., ends].conj() * state.normals[..., ends]
    gap_columns = np.arange(4, 4 + len(ends))
    touch[..., ends, 0, gap_columns], touch[..., ends, 1, gap_columns] = gaps.real, gaps.imag
    try:
        change = respond(statics, state, residuals)
    except np.linalg.LinAlgError:
        change = np.full(residuals.shape, np.nan)
    determinant = np.linalg.det(change[..., :3, :3])
    middle = (body.middle - body.center) / body.arm
    about_middle = np.zeros((*lead, 3, 3))
    about_middle[...] = identity(3)
    about_middle[..., 2, 0], about_middle[..., 2, 1] = -np.imag(middle), np.real(middle)
    return GripResponse(
        state=state,
        owners=owners,
        change=change[..., :3],
        by_opening=change[..., 3],
        ends=ends,
        by_gap=change[..., 4:],
        arm=body.arm,
        about_middle=about_middle,
        is_neutral=np.asarray(~(np.abs(determinant) > 0.0)),
    )


def _opening(statics: ContactStatics, state: ContactForces) -> Points:
    """Return the motion (k,) of the contacts, x + iy, per unit of opening of the grip [-]."""
    owners = statics.contacts.owners
    if owners[-1] > 1:
        return 0.5 * state.normals
    lines = statics.bent.lines
    skins = lines.start + lines.axis * state.feet - statics.tube_radius * state.normals
    chord = skins[..., owners == 1].mean(axis=-1) - skins[..., owners == 0].mean(axis=-1)
    return np.where(owners == 1, 0.5, -0.5) * (chord / np.abs(chord))[..., None]


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
        return (self.reserve / self.size).min(axis=-1)

    @property
    def direction(self) -> Array:
        """Return the wrench of `margin` divided by its norm about the centroid, (3,)."""
        # The shortest wrench to a plane is opposite to its slope, with moments about the centroid.
        nearest, about_middle = int((self.reserve / self.size).argmin()), self.about_middle
        return -about_middle @ about_middle.T @ self.slope[nearest] / self.size[nearest]


@functools.lru_cache(maxsize=8)
def slip_planes(response: GripResponse, friction: float) -> SlipPlanes:
    """Return the slip conditions of a held object for a coefficient of friction, cached."""
    return find_slip_planes(response, friction)


def find_slip_planes(response: GripResponse, friction: float | Array) -> SlipPlanes:
    """Return the slip conditions of held objects for a coefficient of friction of each."""
    about_middle, forces = response.about_middle, response.state.forces

    def planes(rows: Array) -> tuple[Array, Array, Array]:
        """Return reserve, slope and size of `SlipPlanes` for given rows."""
        slope = rows @ response.forces
        # np.hypot, because for very large friction the squares may overflow.
        size = np.hypot.reduce(slope @ about_middle, axis=-1)
        return (rows @ forces[..., None])[..., 0], slope, size

    # Rows are factors of the normal forces, then of the friction forces, of all contacts.
    on_member = np.eye(response.owners[-1] + 1)[response.owners].T
    zeros = np.zeros_like(on_member)
    normal_sums = np.tile(np.hstack([on_member, zeros]), (2, 1))
    friction_sums = np.hstack([zeros, on_member])
    signed_sums = np.vstack([friction_sums, -friction_sums])
    slip_rows = np.asarray(friction)[..., None, None] * normal_sums - signed_sums
    rows, friction_rates = [slip_rows], [np.broadcast_to(normal_sums, slip_rows.shape)]
    # When an end opens, its force is released and changes the forces of the other contacts.
    for number, end in enumerate(response.ends.tolist()):
        by_release = response.by_release[..., number, :, None]
        end_row = np.eye(1, forces.shape[-1], end)  # normal force of the end
        slip_after = slip_rows + (slip_rows @ by_release) * end_row
        slip_reserve, _, slip_size = planes(slip_after)
        end_force, _, opening_size = planes(end_row)
        is_slip_farther = (slip_reserve / slip_size > end_force / opening_size)[..., None]
        sums_after = normal_sums + (normal_sums @ by_release) * end_row
        rows.append(np.where(is_slip_farther, slip_after, end_row))
        friction_rates.append(np.where(is_slip_farther, sums_after, 0.0))
    joined = np.concatenate(rows, axis=-2)
    rates = np.concatenate(friction_rates, axis=-2)
    return SlipPlanes(joined, rates, *planes(joined), about_middle)
