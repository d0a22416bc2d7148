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

from isotruss_ros.core.holding.contacts import Places, POSE
from isotruss_ros.core.holding.equations import Grasps, Linear, sticking_rows
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
    unknown_forces: Array  #: (2k,) normal and then friction forces at the contacts [N]
    owners: Indices  #: (k,) grasping member of each contact, numbered within the grip
    change: Array  #: (3 + 4k, 3) response to the wrench [N]
    ends: Indices  #: (e,) indices of the contacts that are an end of a face
    are_ends: Flags  #: (e,) whether these press, as the other ends of their faces do
    by_gap: Array  #: (3 + 4k, e) responses to a gap at each of these ends
    arm: float | Array  #: characteristic radius, see `ConvexObject.arm` [m]
    #: (3, 3) matrix that moves the reference point of moments from centroid to origin
    about_middle: Array
    is_neutral: Flags  #: () whether the equilibrium is neutral, so that the compliance is singular

    @property
    def _forces(self) -> slice:
        """Return the indices of the forces among the unknowns."""
        return Places.of(len(self.owners)).forces

    @property
    def pose(self) -> Array:
        """Return the derivatives (3, 3) of the object's pose by the wrench [m/N, rad/N]."""
        return self.change[..., :POSE, :]

    @property
    def forces(self) -> Array:
        """Return the derivatives (2k, 3) of normal and friction forces by the wrench [-]."""
        return self.change[..., self._forces, :]

    @functools.cached_property
    def by_release(self) -> Array:
        """Return the changes (e, 2k) of the forces by the released tension of each end [-]."""
        forces = self.by_gap[..., self._forces, :].swapaxes(-1, -2)
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
        stiffness[..., 2, :] *= np.asarray(self.arm)[..., None]
        return stiffness

    @property
    def stable(self) -> Flags:
        """Return whether the object's stiffness is positive definite."""
        compliance = np.where(self.is_neutral[..., None, None], np.eye(3), self.compliance)
        symmetric = 0.5 * (compliance + compliance.swapaxes(-1, -2))
        return ~self.is_neutral & (np.linalg.eigvalsh(symmetric)[..., 0] > 0.0)


def respond(
    g: Grasps, unknowns: Array, linear: Linear, conditions: Array, residuals: Array
) -> Array:
    """
    Return the changes (n, 3 + 4k, c) that cancel residuals; NaN if neutral.

    The `conditions` are the rows of the contacts in the Jacobian.
    """
    indices = g.places
    jacobian, right = linear.jacobian.copy(), -residuals
    jacobian[:, indices.conditions] = conditions
    # A dent is infinitely soft at zero force. So to first order, the force of such a contact stays
    # zero: this takes the place of touching across the member, and of sticking.
    samples, idle = np.nonzero(idle_contacts(unknowns[:, indices.normal]))
    for rows, columns in (
        (3 * idle + 1, indices.normal.start + idle),
        (indices.conditions.start + idle, indices.friction.start + idle),
    ):
        jacobian[samples, rows] = 0.0
        jacobian[samples, rows, columns] = 1.0
        right[samples, rows] = 0.0
    return solve_each(jacobian, right)


def idle_contacts(normal_forces: Array) -> Flags:
    """Return which contacts (..., k) have no force."""
    normal = np.abs(normal_forces)
    return normal <= ROUNDING * normal.sum(axis=-1, keepdims=True)


def find_response(
    g: Grasps, unknowns: Array, linear: Linear, bodies: ObjectSamples, normals: Points
) -> GripResponse:
    """Return the linear responses of n objects to wrenches, at their poses in equilibrium."""
    indices, owners, axes = g.places, g.contacts.owners, g.lines.axis
    n, k = axes.shape
    is_pressed = ~idle_contacts(unknowns[:, indices.normal])
    on_face = np.bincount(owners)[owners] > 1
    ends = np.flatnonzero(on_face)
    others = np.array(
        [np.flatnonzero((owners == owners[e]) & (np.arange(k) != e))[0] for e in ends]
    )
    are_ends = is_pressed[:, ends] & is_pressed[:, others.astype(int)]
    # Columns: the wrench, then a gap at each end of a face.
    residuals = np.zeros((n, indices.size, 3 + len(ends)))
    residuals[:, indices.balance, :3] = identity(3)
    # Axes: contact; touch along the member, across it and in inclination; column.
    touch = residuals[:, : 3 * k].reshape(n, k, 3, -1)
    gaps = -axes[:, ends].conj() * normals[:, ends]
    columns = np.arange(3, 3 + len(ends))
    touch[:, ends, 0, columns], touch[:, ends, 1, columns] = gaps.real, gaps.imag
    change = respond(g, unknowns, linear, sticking_rows(g, linear), residuals)
    determinant = np.linalg.det(change[:, :3, :3])
    middle = (bodies.middle - bodies.center) / bodies.arm
    about_middle = np.zeros((n, 3, 3))
    about_middle[...] = identity(3)
    about_middle[:, 2, 0], about_middle[:, 2, 1] = -middle.imag, middle.real
    return GripResponse(
        unknown_forces=unknowns[:, indices.forces],
        owners=owners,
        change=change[..., :3],
        ends=ends,
        are_ends=are_ends,
        by_gap=change[..., 3:],
        arm=bodies.arm,
        about_middle=about_middle,
        is_neutral=~(np.abs(determinant) > 0.0),
    )


def open_grips(g: Grasps, unknowns: Array, normals: Points) -> Array:
    """Return the residuals (n, 3 + 4k) of grips that open by 1 m, see `squeeze_stiffness`."""
    owners, (n, k) = g.contacts.owners, g.sides.shape
    motions = 0.5 * normals
    if owners[-1] == 1:
        feet = unknowns[:, g.places.feet]
        skins = g.lines.start + g.lines.axis * feet - g.structure.tube_radius * normals
        chord = skins[:, owners == 1].mean(axis=-1) - skins[:, owners == 0].mean(axis=-1)
        motions = np.where(owners == 1, 0.5, -0.5) * (chord / np.abs(chord))[:, None]
    residuals, opening = np.zeros((n, g.places.size)), g.lines.axis.conj() * motions
    touch = residuals[:, : 3 * k].reshape(n, k, 3)
    touch[..., 0], touch[..., 1] = opening.real, opening.imag
    return residuals


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


# Where an end does not press, what is divided is not used.
@np.errstate(divide='ignore', invalid='ignore')
def find_slip_planes(response: GripResponse, friction: float | Array) -> SlipPlanes:
    """Return the slip conditions of held objects for a coefficient of friction of each."""
    about_middle, forces = response.about_middle, response.unknown_forces

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
        # Where the end does not press, its planes are those of slip again.
        is_end = response.are_ends[..., number, None, None]
        rows.append(np.where(is_end, np.where(is_slip_farther, slip_after, end_row), slip_rows))
        rates_after = np.where(is_slip_farther, sums_after, 0.0)
        friction_rates.append(np.where(is_end, rates_after, normal_sums))
    joined = np.concatenate(rows, axis=-2)
    rates = np.concatenate(friction_rates, axis=-2)
    return SlipPlanes(joined, rates, *planes(joined), about_middle)
