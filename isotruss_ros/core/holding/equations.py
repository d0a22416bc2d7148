# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Equations of equilibrium of n objects with the same k contacts, with friction on the tubes.

An object has contacts on two or three members:

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
conditions of friction or rolling. All arrays have the samples as their first axis.
"""

from __future__ import annotations

from collections.abc import Sequence
import functools
from typing import Any, NamedTuple

from isotruss_ros.core.contact.dents import Dents, find_table
from isotruss_ros.core.holding.contacts import (
    ANGLE,
    group_by_member,
    Places,
    POSE,
    PressedContacts,
)
from isotruss_ros.core.model.convex_object import facing_normals
from isotruss_ros.core.model.object_samples import ObjectSamples
from isotruss_ros.core.model.shapes import PLANNED_DEPTH
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.samples import apply
from isotruss_ros.core.statics.bent_tubes import BentTubes
from isotruss_ros.core.statics.structure import Lines, Structure
import numpy as np

#: Compliance that scales friction forces to lengths, so that one tolerance bounds both [m/N].
FRICTION_COMPLIANCE = 1e-4


class History(NamedTuple):
    """Known history of contacts, which have rolled without slip."""

    anchors: Array  #: (n, k) rolling invariants, see `find_anchors` [m]
    angles: Array  #: (n, k) angles of the normals before, in the objects, continued beyond pi
    frictionless: tuple[int, ...] = ()  #: contacts without friction, because they are new


class Grasps(NamedTuple):
    """Constants of n grasps with the same contacts."""

    contacts: PressedContacts
    structure: Structure
    bodies: ObjectSamples  #: the objects at their measured poses
    wrench: Array  #: (n, 3) wrenches (fx, fy, m / arm), see `ConvexObject.arm` [N]
    lines: Lines  #: members of the contacts
    sides: Array  #: (n, k) +1 if the object is on the right of the member, else -1
    dents: Any  #: depths of the dents by normal forces and normals, see `Dents`
    history: History | None = None  #: None: unknown, see `least_friction`
    grazing: int | None = None  #: contact without force, see `least_friction`

    @classmethod
    def of(
        cls,
        structure: Structure,
        bodies: ObjectSamples,
        contacts: PressedContacts,
        wrench: Array,
        grazing: int | None = None,
        history: History | None = None,
        dents: Any = None,
    ) -> Grasps:
        """Return the constants of grasps; `dents` are found if they are not given."""
        lines = Lines.of(structure, contacts.members)
        normals = facing_normals(bodies.middle[:, None], lines.start, lines.axis)
        sides = np.sign((normals * lines.axis.conj()).imag)
        dents = find_dents(structure, bodies, contacts) if dents is None else dents
        return cls(contacts, structure, bodies, wrench, lines, sides, dents, history, grazing)

    @property
    def places(self) -> Places:
        """Return the indices of the unknowns and of the equations."""
        return Places.of(len(self.contacts.members))

    @property
    def straight_normals(self) -> Points:
        """Return the normals (n, k) of the straight tubes, away from the objects."""
        return 1j * self.sides * self.lines.axis

    @property
    def anchor_rates(self) -> Array:
        """Return the derivatives (n, k, r) of the rolling invariants by roller travel."""
        topology = self.structure.config.robot.topology
        is_at_start = self.contacts.members[:, None] == topology.driven
        return self.sides[..., None] * is_at_start

    def find_angles(self, unknowns: Array, normals: Points) -> Array:
        """Return the angles (n, k) of normals in the objects, continued from those before."""
        previous = 0.0 if self.history is None else self.history.angles
        turned = normals * np.exp(-1j * (unknowns[:, ANGLE, None] + previous))
        return previous + np.angle(turned)

    def find_anchors(self, unknowns: Array, normals: Points) -> Array:
        """
        Return the rolling invariants (n, k), which are constant while the contacts roll [m].

        A_i = kappa_i (s_i - phi_i) - arc(arg nu_i - theta), where s_i is the position along the
        member, phi_i the travel of the tube, arc the arc length along the object's surface, nu_i
        the normal and theta the object's angle; kappa_i is -1 if the object is on the right of the
        member, otherwise 1.
        """
        angles = self.find_angles(unknowns, normals)
        arcs = self.bodies.shape.unroll(angles, self.contacts.corners)
        rolled = apply(self.anchor_rates, self.structure.config.roller_positions)
        return rolled - self.sides * unknowns[:, self.places.feet] - arcs

    def rolling_rows(self, radii: Array) -> Array:
        """Return the derivatives (n, k, 3 + 4k) of the rolling invariants, by surface radii."""
        indices, contacts = self.places, np.arange(radii.shape[-1])
        derivative = np.zeros((*radii.shape, indices.size))
        derivative[..., ANGLE] = radii
        derivative[:, contacts, indices.feet.start + contacts] = -self.sides
        derivative[:, contacts, indices.inclinations.start + contacts] = -radii
        return derivative


def find_dents(structure: Structure, bodies: ObjectSamples, contacts: PressedContacts) -> Dents:
    """Return the dents (n, k) at all contacts, as functions of normal forces and angles."""
    robot, corners = structure.config.robot, contacts.corners.tolist()
    tubes = robot.topology.tube[contacts.members].tolist()
    pressures = np.asarray(structure.pressures).tolist()
    return Dents(
        [
            [
                find_table(robot, tube, of_tubes[tube], body.shape, corner)
                for tube, corner in zip(tubes, corners, strict=True)
            ]
            for of_tubes, body in zip(pressures, bodies.objects, strict=True)
        ]
    )


class Pushes(NamedTuple):
    """Loads of k contacts on the tubes of n samples; vectors in member axes, along + i across."""

    member_normals: Points  #: (n, k)
    in_object: Points  #: (n, k) normals in the axes of the objects
    skin: Array  #: (n, k) distance of the dented skin from the centre line [m]
    depth_by_force: Array  #: (n, k) derivatives of the dents' depths by the normal forces [m/N]
    depth_by_angle: Array  #: (n, k) derivatives of the depths by the normals' angles [m/rad]
    forces: Points  #: (n, k) forces on the tubes [N]
    loads: Array  #: (n, 3k) forces along and across [N] and moments [N m]
    #: (n, k, 3, 4) derivatives of the loads by inclination, normal and friction force, and by the
    #: angle of the object
    rates: Array

    @classmethod
    def of(cls, g: Grasps, unknowns: Array) -> Pushes:
        """Return the loads at given unknowns."""
        indices = g.places
        normal, friction = unknowns[:, indices.normal], unknowns[:, indices.friction]
        normals = 1j * g.sides * np.exp(1j * unknowns[:, indices.inclinations])
        in_object = g.lines.axis * normals * np.exp(-1j * unknowns[:, ANGLE, None])
        depths, by_force, by_turn = g.dents(normal, np.angle(in_object))
        # Friction acts at the skin of a tube, so it exerts a moment about the centre line.
        skin = g.structure.tube_radius - depths
        forces = (normal + 1j * friction) * normals
        loads = np.empty((*skin.shape, 3))
        loads[..., 0], loads[..., 1], loads[..., 2] = forces.real, forces.imag, -skin * friction
        # If the object turns, only the dents change.
        rates = np.zeros((*skin.shape, 3, 4))
        for cause, values in enumerate((1j * forces, normals, 1j * normals)):
            rates[..., 0, cause], rates[..., 1, cause] = values.real, values.imag
        rates[..., 2, 0] = by_turn * friction
        rates[..., 2, 1] = by_force * friction
        rates[..., 2, 2] = -skin
        rates[..., 2, 3] = -rates[..., 2, 0]
        flat = loads.reshape(len(loads), -1)
        return cls(normals, in_object, skin, by_force, by_turn, forces, flat, rates)


class Linear(NamedTuple):
    """Equations of n samples, linearised about their unknowns, with tubes of one layout."""

    tubes: BentTubes
    unknowns: Array  #: (n, 3 + 4k)
    pushes: Pushes
    radii: Array  #: (n, k) radii of curvature of the objects at the contacts [m]
    residual: Array  #: (n, 3 + 4k)
    jacobian: Array  #: (n, 3 + 4k, 3 + 4k)

    def loads_after(self, change: Array) -> Array:
        """Return the loads (n, 3k) after a change (n, 3 + 4k) of the unknowns, to first order."""
        return self.pushes.loads + self.load_rates(change[..., None])[..., 0]

    def load_rates(self, change: Array) -> Array:
        """Return the changes (n, 3k, c) of the loads for c changes (n, 3 + 4k, c) of unknowns."""
        n, k = self.radii.shape
        causes = change[:, Places.of(k).causes].reshape(n, 3, k, -1)
        angle = np.broadcast_to(change[:, None, None, ANGLE], (n, 1, *causes.shape[2:]))
        by_contact = np.concatenate([causes, angle], axis=1).swapaxes(1, 2)
        return (self.pushes.rates @ by_contact).reshape(n, 3 * k, -1)


def linearize_grasps(g: Grasps, unknowns: Array, tubes: BentTubes, pushes: Pushes) -> Linear:
    """Return the linear equations of n samples, with the compliance of linearised tubes."""
    indices, (n, k) = g.places, g.sides.shape
    moment_row, affine = indices.balance.stop - 1, slice(indices.balance.stop)
    axis, turns, arm = g.lines.axis, g.lines.turns, g.bodies.arm[:, None]
    feet, normals = unknowns[:, indices.feet], pushes.member_normals
    residual, jacobian = np.empty((n, indices.size)), np.zeros((n, indices.size, indices.size))
    # Contact points from the object's origin, in member axes. If the object turns while the tube
    # does not, the contact point moves back on the object's surface.
    turn = np.exp(1j * unknowns[:, ANGLE, None])
    points, radii = g.bodies.shape.surface_at(g.contacts.corners, pushes.in_object)
    to_contacts = axis.conj() * turn * points
    contacts_by_angle = 1j * (to_contacts - radii * normals)

    # Responses of the tubes, and balance without the external wrench.
    at_points = tubes.at_points
    by_loads = np.zeros((n, affine.stop, k, 3))
    by_loads[:, :-3] = at_points[:, :, :3, : 3 * k].reshape(n, 3 * k, k, 3)
    # The forces on the object are opposite to those on the tubes.
    by_loads[:, -3:-1] = -turns[..., :2, :].swapaxes(1, 2)
    by_loads[:, -1, :, 0], by_loads[:, -1, :, 1] = to_contacts.imag / arm, -to_contacts.real / arm
    on_object = by_loads[:, -3:].reshape(n, 3, -1)
    residual[:, indices.balance] = apply(on_object, pushes.loads) + g.wrench
    # Axes: equation, cause as in `Pushes.rates`, contact.
    by_cause = (by_loads.swapaxes(1, 2) @ pushes.rates).swapaxes(1, 3).swapaxes(1, 2)
    jacobian[:, affine, indices.causes] = by_cause[:, :, :3].reshape(n, affine.stop, -1)
    jacobian[:, affine, ANGLE] = by_cause[:, :, 3].sum(axis=-1)
    by_inclination = radii * unknowns[:, indices.normal] / arm
    jacobian[:, moment_row, indices.inclinations] += by_inclination
    turned = (contacts_by_angle.conj() * pushes.forces).imag.sum(axis=-1)
    jacobian[:, moment_row, ANGLE] = -turned / g.bodies.arm

    # Touch: gaps (along + i across) at straight tubes, and displacements of the tubes. Axes:
    # contact, equation of touch (along, across, inclination), unknown. They are views.
    touch = residual[:, : 3 * k].reshape(n, k, 3)
    touch_rows = jacobian[:, : 3 * k].reshape(n, k, 3, -1)
    center = unknowns[:, 0, None] + 1j * unknowns[:, 1, None]
    to_starts = axis.conj() * (g.lines.start - center)
    gaps = to_starts - to_contacts + feet - pushes.skin * normals
    touch[...] = tubes.respond(pushes.loads, feet)[..., :3]
    touch[..., 0] += gaps.real
    touch[..., 1] += gaps.imag
    touch[..., 2] -= unknowns[:, indices.inclinations]
    # Derivatives by the object's pose, and by the positions of the contacts.
    touch_rows[..., :2, :2] = -turns[..., :2, :2].swapaxes(-1, -2)
    dents_by_angle = pushes.depth_by_angle * normals
    gaps_by_angle = contacts_by_angle + dents_by_angle
    touch_rows[..., 0, ANGLE] -= gaps_by_angle.real
    touch_rows[..., 1, ANGLE] -= gaps_by_angle.imag
    touch_rows[..., indices.feet] = at_points[:, :, :3, slice(3 * k, 4 * k)]
    # Derivatives by position, inclination and normal force of the same contact. Axes: contact k,
    # equation a of touch, and kind n of unknown: position, inclination, normal, friction.
    by_kind = touch_rows[..., POSE:].reshape(n, k, 3, 4, k)
    at_same = np.einsum('...kank->...kan', by_kind)
    by_inclination = dents_by_angle - 1j * (radii + pushes.skin) * normals
    by_normal = pushes.depth_by_force * normals
    at_same[..., 0, 0] += 1.0
    at_same[..., 0, 1] += by_inclination.real
    at_same[..., 1, 1] += by_inclination.imag
    at_same[..., 0, 2] += by_normal.real
    at_same[..., 1, 2] += by_normal.imag
    at_same[..., 2, 1] -= 1.0

    rows = (least_friction if g.history is None else roll)(g, unknowns, axis * normals, radii)
    residual[:, indices.conditions], jacobian[:, indices.conditions] = rows
    return Linear(tubes, unknowns, pushes, radii, residual, jacobian)


def begin_straight(g: Grasps) -> Array:
    """Return unknowns (n, 3 + 4k) without forces, at straight tubes and measured poses."""
    indices, body = g.places, g.bodies
    unknowns = np.zeros((len(g.sides), indices.size))
    unknowns[:, 0], unknowns[:, 1], unknowns[:, ANGLE] = (
        body.center.real,
        body.center.imag,
        (body.angle),
    )
    turn = body.turn[:, None]
    points, _ = body.shape.surface_at(g.contacts.corners, g.straight_normals * turn.conj())
    feet = (body.center[:, None] + turn * points - g.lines.start) * g.lines.axis.conj()
    unknowns[:, indices.feet] = np.clip(feet.real, 0.0, g.lines.length)
    return unknowns


def measure_overlaps(g: Grasps) -> Array:
    """Return the overlaps (n, k) of objects at their measured poses with straight tubes [m]."""
    turn = g.bodies.turn[:, None]
    points, _ = g.bodies.shape.surface_at(g.contacts.corners, g.straight_normals * turn.conj())
    from_start = g.bodies.center[:, None] + turn * points - g.lines.start
    return g.structure.tube_radius + g.sides * (g.lines.axis.conj() * from_start).imag


def guess_forces(g: Grasps, unknowns: Array, tubes: BentTubes) -> None:
    """Set the normal forces by which tubes and dents are as deep as the straight tubes."""
    k, in_object = g.sides.shape[-1], g.straight_normals * g.bodies.turn[:, None].conj()
    depths = np.maximum(measure_overlaps(g), PLANNED_DEPTH * g.structure.tube_radius)
    # The displacement of the tube is each contact's response to its own load.
    by_across = tubes.at_points[..., 1, slice(1, 3 * k, 3)]
    compliance = np.einsum('nkk->nk', by_across)
    _, by_force, _ = g.dents(depths / compliance, np.angle(in_object))
    unknowns[:, g.places.normal] = depths / (compliance + by_force)


def roll(g: Grasps, unknowns: Array, normals: Points, radii: Array) -> tuple[Array, Array]:
    """
    Return the conditions of rolling without slip, which are the integral of (17) over time.

    The rolling invariants are constant. The friction of new contacts is zero instead.
    """
    derivative = g.rolling_rows(radii)
    residual = g.find_anchors(unknowns, normals) - g.history.anchors
    if g.history.frictionless:
        new = np.array(g.history.frictionless)
        friction = g.places.friction.start + new
        residual[:, new] = FRICTION_COMPLIANCE * unknowns[:, friction]
        derivative[:, new] = 0.0
        derivative[:, new, friction] = FRICTION_COMPLIANCE
    return residual, derivative


def sticking_rows(g: Grasps, linear: Linear) -> Array:
    """
    Return the derivatives (n, k, 3 + 4k) of the conditions that contacts stick.

    The moment of friction works on the rotation of a section, and contacts roll by the inclination
    of the centre line. Where shear changes the angle between them, the skin moves along the tube.
    With this motion the stiffness is symmetric, as Maxwell's theorem says. It depends on the path:
    the section at another position along the tube has another rotation. So it is neglected where
    contacts roll over a distance, see `roll`.
    """
    (n, k), indices, pushes, tubes = g.sides.shape, g.places, linear.pushes, linear.tubes
    rotations, points = tubes.at_points[:, :, 3], np.arange(k)
    feet = linear.unknowns[:, indices.feet]
    of_sections = tubes.respond(pushes.loads, feet)[..., 3]
    by_loads = rotations[..., : 3 * k].reshape(n, k, k, 3)
    # Axes: contact, cause as in `Pushes.rates`, contact of the cause.
    by_cause = np.einsum('nkcl,nclq->nkqc', by_loads, pushes.rates)
    shear = np.zeros((n, k, indices.size))
    shear[..., indices.causes] = -by_cause[:, :, :3].reshape(n, k, -1)
    shear[..., ANGLE] = -by_cause[:, :, 3].sum(axis=-1)
    shear[..., indices.feet] = -rotations[..., slice(3 * k, 4 * k)]
    shear[:, points, indices.feet.start + points] += tubes.curvatures
    shear[:, points, indices.inclinations.start + points] += 1.0
    rows = g.rolling_rows(linear.radii) - pushes.skin[..., None] * shear
    # Where the skin comes nearer to the centre line.
    inclined = linear.unknowns[:, indices.inclinations] - of_sections
    by_angle = inclined * pushes.depth_by_angle
    rows[:, points, indices.normal.start + points] += inclined * pushes.depth_by_force
    rows[:, points, indices.inclinations.start + points] += by_angle
    rows[..., ANGLE] -= by_angle
    return rows


class _FrictionRows(NamedTuple):
    """Conditions of least friction by the owners of contacts, see `least_friction`."""

    coefficients: Array  #: (k, 3 + 4k) of the linear conditions
    ratio_forms: Array  #: (q, 2k, 2k) see `_ratio_forms`
    chord_shares: Array  #: (k,) weights of the normals in the chord between two members
    has_two_members: bool
    keeps_angle: bool


@functools.lru_cache(maxsize=64)
def _friction_rows(owner_of_contact: Sequence[int], grazing: int | None) -> _FrictionRows:
    """Return the conditions of contacts by their `PressedContacts.owners`, cached."""
    owners = np.array(owner_of_contact)
    count, indices = len(owners), Places.of(len(owners))
    member_count = int(owners[-1]) + 1
    has_two, has_faces = member_count == 2, count > member_count
    is_face_pressed = has_faces and grazing is None
    forms = _ratio_forms(owners, is_face_pressed and has_two)
    on_member = np.eye(member_count)[owners].T
    shares = on_member / on_member.sum(axis=1, keepdims=True)
    coefficients = np.zeros((count, indices.size))
    if grazing is not None:
        coefficients[len(forms) + has_two, indices.normal.start + grazing] = 1.0
    if not has_two:
        # All members have the same friction; with a pressed face, none.
        sums = on_member if is_face_pressed else (on_member - np.roll(on_member, -1, axis=0))[:-1]
        last = slice(count - len(sums), None)
        coefficients[last, indices.friction] = FRICTION_COMPLIANCE * sums
    keeps_angle = grazing is None and not has_faces
    return _FrictionRows(coefficients, forms, shares[0] - shares[1], has_two, keeps_angle)


def least_friction(
    g: Grasps, unknowns: Array, normals: Points, radii: Array
) -> tuple[Array, Array]:
    """
    Return the conditions that replace rolling conditions if the contact history is unknown.

    T is the friction force and N the normal force of a member, or of an end of a face.

    - Two members: the object is at its measured position across the chord between the contacts,
      which determines the squeeze. Without a face contact it has its measured angle; with a face
      contact |T| / N is equal at both members instead.
    - Three members: the squeeze follows from statics. Without a face contact the object has its
      measured angle, and all T are equal; with a face contact no member has friction.
    - T / N is equal at both ends of each face.
    - If an end of a face grazes (its index is `grazing`), its N is zero. This takes the place of
      the measured angle; apart from that, the conditions are those without a face contact.
    """
    rows, indices, body = _friction_rows(g.contacts.owner_key, g.grazing), g.places, g.bodies
    position_row = len(rows.ratio_forms)
    residual = unknowns @ rows.coefficients.T
    derivative = np.empty((*normals.shape, indices.size))
    derivative[...] = rows.coefficients
    if rows.keeps_angle:
        angle_row = position_row + rows.has_two_members
        residual[:, angle_row] = body.arm * (unknowns[:, ANGLE] - body.angle)
        derivative[:, angle_row, ANGLE] = body.arm
    # Ratios T / N are equal: quadratic forms of the forces, divided by the squeeze.
    if position_row:
        forces = unknowns[:, None, indices.forces]
        squeeze = np.abs(unknowns[:, None, indices.normal]).sum(axis=-1, keepdims=True)
        factor = FRICTION_COMPLIANCE / np.maximum(squeeze, 1e-3)
        ratio_slopes = (rows.ratio_forms @ forces[..., None])[..., 0] * factor
        residual[:, :position_row] = 0.5 * (ratio_slopes * forces).sum(axis=-1)
        derivative[:, :position_row, indices.forces] = ratio_slopes
    # The displacement d of the centroid across the chord is zero: Re(across* d) = 0, where the
    # unit vector across the chord turns with the tubes.
    if rows.has_two_members:
        chord = normals @ rows.chord_shares
        length = np.maximum(np.abs(chord), 1e-9)
        across = (-1j * chord.conj()) / length  # conjugate
        centroid = np.exp(1j * unknowns[:, ANGLE]) * body.shape.centroid
        displacement = unknowns[:, 0] + 1j * unknowns[:, 1] + centroid - body.middle
        residual[:, position_row] = (across * displacement).real
        # Derivatives by the pose, and by the inclinations, which turn normals and chord.
        slope = derivative[:, position_row]
        slope[:, 0], slope[:, 1] = across.real, -across.imag
        slope[:, ANGLE] = (across * 1j * centroid).real
        by_chord_angle = (across * -1j * displacement).real / length**2
        chord_turns = (chord.conj()[:, None] * 1j * normals).imag * rows.chord_shares
        slope[:, indices.inclinations] = by_chord_angle[:, None] * chord_turns
    return residual, derivative


def _ratio_forms(owners: Indices, compares_members: bool) -> Array:
    """
    Return quadratic forms Q (q, 2k, 2k) of contact forces f that are zero if |T| / N are equal.

    The first ones compare both ends of each face; the last one compares two members. The value f Q
    f / 2 is the sum of T_one N_other + sign T_other N_one over pairs of contacts, with f = (N, T).
    """
    # Two groups of contacts; the sign is -1 if T / N has the same sign in both, else 1.
    by_member = group_by_member(owners)
    pairs: list[Any] = [(ends[:1], ends[1:], -1.0) for ends in by_member if len(ends) == 2]
    if compares_members:
        pairs.append((by_member[0], by_member[1], 1.0))
    count = len(owners)
    forms = np.zeros((len(pairs), 2 * count, 2 * count))
    for form, (one, other, sign) in zip(forms, pairs, strict=True):
        form[np.ix_(count + one, other)] = 1.0
        form[np.ix_(count + other, one)] = sign
    return forms + forms.transpose(0, 2, 1)
