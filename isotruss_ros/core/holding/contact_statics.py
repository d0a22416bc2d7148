# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Equations of equilibrium of a convex object with friction on the tubes.

The object has k contacts on two or three members:

    X_i = P_i + s_i e_i + u_i,  u = u_0 + C f + D s                     deformed point of contact
    X_i = c + R(theta) p(nu_i) + rho_i nu_i                             touch
    w = sum f_i,  m = sum of arms x f_i,  f_i = (N_i + i T_i) nu_i      balance

with the member's start P_i and direction e_i, the displacement u_i of the tube, the compliances C
and D for loads f and positions s, the object's pose (c, theta), the surface point p(nu) whose
normal is nu, and the distance rho_i of this point from the centre line. A beam bends
away from the object, so a polygon touches it at corners or at both ends of a face. The unknowns
are the object's pose, the positions of the contacts along the members, the inclinations of the
bent tubes at the contacts, and the contact forces. The equations state that object and member
touch (along the member, across it, and in inclination), that the object is in balance, and k
conditions of friction or rolling.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import functools
from typing import Any, ClassVar

from isotruss_ros.core.contact.dents import Dents
from isotruss_ros.core.holding.contact_loads import Pushes
from isotruss_ros.core.holding.pressed_contacts import (
    ANGLE,
    CENTER,
    ContactForces,
    Places,
    POSE,
    PressedContacts,
)
from isotruss_ros.core.numerics.arrays import Array, Flags, Points
from isotruss_ros.core.numerics.samples import apply, column
from isotruss_ros.core.statics.bent_tubes import BentTubes
from isotruss_ros.core.statics.bent_updates import update_tubes
from isotruss_ros.core.statics.structure import Structure
import numpy as np

#: Compliance that scales friction forces to lengths, so that one tolerance bounds both [m/N].
FRICTION_COMPLIANCE = 1e-4
#: Conditions of friction or rolling: residual (k,), and its derivatives (k, 3 + 4k) with respect
#: to the unknowns, as functions of the equations of touch and balance, unknowns and normals.
ContactConditions = Callable[['ContactStatics', Array, Points], tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class ContactStatics:
    """
    Equations of equilibrium of a convex object at k contacts.

    Of n samples with the same contacts, all arrays have the samples as their first axis.
    """

    shared: ClassVar[tuple[str, ...]] = ('contacts', 'tube_radius', 'places')
    bent: BentTubes  #: compliance of the bent tubes at the contacts
    body: Any  #: the `ConvexObject` at its measured pose, or `ObjectSamples`
    contacts: PressedContacts  #: the k contacts
    tube_radius: float  #: radius of the tubes [m]
    sides: Array  #: (k,) +1 if the object is on the right of the member, else -1
    dents: Dents  #: depths of the dents in the skin as functions of normal forces and normals

    @functools.cached_property
    def places(self) -> Places:
        """Return the indices of the unknowns and of the equations."""
        return Places.of(len(self.contacts.owners))

    @functools.cached_property
    def anchor_rates(self) -> Array:
        """Return the derivatives (k, r) of the rolling invariants by roller travel."""
        topology = self.bent.structure.config.robot.topology
        is_at_start = self.contacts.members[:, None] == topology.driven
        return self.sides[..., None] * is_at_start

    @property
    def straight_normals(self) -> Points:
        """Return the normals of the straight tubes, away from the object, (k,) x + iy."""
        return 1j * self.sides * self.bent.lines.axis

    def are_on_members(self, feet: Array) -> Flags:
        """Return whether all contacts are between the ends of their members."""
        return ((feet >= 0.0) & (feet <= self.bent.lines.length)).all(axis=-1)

    def bent_under(self, unknowns: Array, structure: Structure | None = None) -> BentTubes:
        """Return the tubes linearised about their bent state at given unknowns."""
        loads, feet = self.pushes(unknowns).loads, unknowns[self.places.feet]
        return update_tubes(self.bent, loads, feet, structure)

    def pushes(self, unknowns: Array) -> Pushes:
        """Return the loads of the contacts on the tubes, with derivatives by the unknowns."""
        indices = self.places
        inclination, normal = unknowns[..., indices.inclinations], unknowns[..., indices.normal]
        friction = unknowns[..., indices.friction]
        # Vectors in member axes are complex numbers, along + i across.
        normals = 1j * self.sides * np.exp(1j * inclination)
        angles = object_angles(unknowns, self.bent.lines.axis * normals)
        depths, by_force, by_turn = self.dents(normal, angles)
        # Friction acts at the skin of a tube, so it exerts a moment about the centre line.
        skin = self.tube_radius - depths
        forces = (normal + 1j * friction) * normals
        loads = np.empty((*skin.shape, 3))
        loads[..., 0], loads[..., 1], loads[..., 2] = forces.real, forces.imag, -skin * friction
        # Derivatives by the causes in `Pushes.rates`. If the object turns, only the dents change.
        by_inclination, by_friction = 1j * forces, 1j * normals
        rates = np.zeros((*skin.shape, 3, 4))
        for cause, values in enumerate((by_inclination, normals, by_friction)):
            rates[..., 0, cause], rates[..., 1, cause] = values.real, values.imag
        rates[..., 2, 0] = by_turn * friction
        rates[..., 2, 1] = by_force * friction
        rates[..., 2, 2] = -skin
        rates[..., 2, 3] = -rates[..., 2, 0]
        return Pushes(normals, skin, by_force, by_turn, forces, loads, rates)

    def equations(
        self,
        unknowns: Array,
        wrench: Array,
        conditions: ContactConditions,
        pushes: Pushes | None = None,
    ) -> tuple[Array, ContactForces]:
        """Return the residual (3 + 4k,) of the equations, see `Places`, and the state."""
        indices, axis, arm = self.places, self.bent.lines.axis, column(self.body.arm)
        (*lead, count), moment_row = self.sides.shape, indices.balance.stop - 1
        affine = slice(indices.balance.stop)
        residual = np.empty((*lead, indices.size))
        jacobian = np.zeros((*lead, indices.size, indices.size))

        # Contact points from the object's origin, in member axes. If the object turns while the
        # tube does not, the contact point moves back on the object's surface.
        turn = np.exp(1j * unknowns[..., ANGLE, None])
        pushes = pushes or self.pushes(unknowns)
        normals = axis * pushes.member_normals
        in_object = normals * turn.conj()
        points, radii = self.body.shape.surface_at(self.contacts.corners, in_object)
        to_contacts = axis.conj() * turn * points
        contacts_by_angle = 1j * (to_contacts - radii * pushes.member_normals)

        # Responses of the tubes, and balance without the external wrench.
        by_loads = np.zeros((*lead, affine.stop, count, 3))
        compliance = self.bent.at_points[..., : 3 * count]
        by_loads[..., :-3, :, :] = compliance.reshape(*lead, 3 * count, count, 3)
        # The forces on the object are opposite to those on the tubes.
        by_loads[..., -3:-1, :, :] = -self.bent.lines.turns[..., :2, :].swapaxes(-3, -2)
        by_loads[..., -1, :, 0], by_loads[..., -1, :, 1] = to_contacts.imag, -to_contacts.real
        by_loads[..., -1, :, :] /= arm[..., None]
        on_object = by_loads[..., -3:, :, :].reshape(*lead, 3, -1)
        residual[..., indices.balance] = apply(on_object, pushes.loads.reshape(*lead, -1)) + wrench
        # Axes: equation, cause as in `Pushes.rates`, contact.
        by_cause = (by_loads.swapaxes(-3, -2) @ pushes.rates).swapaxes(-3, -1).swapaxes(-3, -2)
        causes = by_cause[..., :3, :].reshape(*lead, affine.stop, -1)
        jacobian[..., affine, indices.causes] = causes
        jacobian[..., affine, ANGLE] = by_cause[..., 3, :].sum(axis=-1)

        # Touch: gaps between the object and the tubes.
        self._add_gaps(residual, jacobian, unknowns, pushes, to_contacts, contacts_by_angle, radii)

        # Balance: the arms of the forces turn with the normals and the object.
        by_inclination = radii * unknowns[..., indices.normal] / arm
        jacobian[..., moment_row, indices.inclinations] += by_inclination
        turned = (contacts_by_angle.conj() * pushes.member_forces).imag.sum(axis=-1)
        jacobian[..., moment_row, ANGLE] = -turned / self.body.arm

        rows = conditions(self, unknowns, normals)
        residual[..., indices.conditions], jacobian[..., indices.conditions, :] = rows
        return residual, ContactForces(unknowns, normals, pushes.loads, jacobian)

    def _add_gaps(
        self,
        residual: Array,
        jacobian: Array,
        unknowns: Array,
        pushes: Pushes,
        to_contacts: Points,
        contacts_by_angle: Points,
        radii: Array,
    ) -> None:
        """Set the gaps between object and tubes, and add their derivatives."""
        indices, bent, lines = self.places, self.bent, self.bent.lines
        (*lead, count), feet = self.sides.shape, unknowns[..., indices.feet]
        # Axes: contact, equation of touch (along, across, inclination), unknown. They are views.
        touch = residual[..., : 3 * count].reshape(*lead, count, 3)
        touch_rows = jacobian[..., : 3 * count, :].reshape(*lead, count, 3, -1)
        # Gaps (along + i across) at straight tubes, and displacements by the contacts' positions.
        center = unknowns[..., 0, None] + 1j * unknowns[..., 1, None]
        to_starts = lines.axis.conj() * (lines.start - center)
        gaps = to_starts - to_contacts + feet - pushes.skin * pushes.member_normals
        touch[...] = bent.respond(pushes.loads, feet)
        touch[..., 0] += gaps.real
        touch[..., 1] += gaps.imag
        touch[..., 2] -= unknowns[..., indices.inclinations]
        # Derivatives by the object's pose, and by the positions of the contacts.
        touch_rows[..., :2, CENTER] = -lines.turns[..., :2, :2].swapaxes(-1, -2)
        dents_by_angle = pushes.depth_by_angle * pushes.member_normals
        gaps_by_angle = contacts_by_angle + dents_by_angle
        touch_rows[..., 0, ANGLE] -= gaps_by_angle.real
        touch_rows[..., 1, ANGLE] -= gaps_by_angle.imag
        touch_rows[..., indices.feet] = bent.at_points[..., bent.motion_columns]
        # Derivatives by position, inclination and normal force of the same contact. Axes: contact
        # k, equation a of touch, and kind n of unknown: position, inclination, normal, friction.
        by_kind = touch_rows[..., POSE:].reshape(*lead, count, 3, 4, count)
        at_same_contact = np.einsum('...kank->...kan', by_kind)
        by_inclination = dents_by_angle - 1j * (radii + pushes.skin) * pushes.member_normals
        by_normal = pushes.depth_by_force * pushes.member_normals
        at_same_contact[..., 0, 0] += 1.0
        at_same_contact[..., 0, 1] += by_inclination.real
        at_same_contact[..., 1, 1] += by_inclination.imag
        at_same_contact[..., 0, 2] += by_normal.real
        at_same_contact[..., 1, 2] += by_normal.imag
        at_same_contact[..., 2, 1] -= 1.0


def object_angles(unknowns: Array, normals: Points, previous: Array | float = 0.0) -> Array:
    """Return the angles (k,) of normals in the object's frame, within pi of `previous` [rad]."""
    return previous + np.angle(normals * np.exp(-1j * (unknowns[..., ANGLE, None] + previous)))
