# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Equilibrium of an object near its measured pose, with unknown contact history.

The equilibrium with the least friction is assumed. In directions in which the grip is stiff, the
equilibrium determines the pose; in the others, the measured pose is taken.
"""

from __future__ import annotations

import cmath
from collections.abc import Sequence
from dataclasses import replace

from isotruss_ros.core.holding.contact_search import (
    add_corner,
    ContactSet,
    ContactSolver,
    find_free_corners,
    search_contacts,
)
from isotruss_ros.core.holding.contact_statics import (
    build_statics,
    ContactConditions,
    ContactStatics,
    FRICTION_COMPLIANCE,
)
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus, NotHeldError, scaled_wrench
from isotruss_ros.core.holding.pressed_contacts import ANGLE, find_pressed, POSE, PressedContacts
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.manipulation.grip import GRIP_SIZES
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.tolerances import MAX_NEWTON_ITERATIONS, MAX_SEARCH_STEPS
from isotruss_ros.core.statics.section import Pressure
import numpy as np

#: Largest number of sets of contacts in a quick search [-]. It finds 315 of the 318 equilibria of
#: random polygons that the whole search finds; with 2 sets it finds 291, and with 8 it finds all
#: and takes up to 1.5 times as long.
QUICK_SETS = 4
#: Equilibrium, and unknowns near it (3 + 4k,) at which an iteration starts.
Start = tuple[HeldGrip, Array]


def attach_grip(
    config: Configuration,
    body: ConvexObject,
    members: Indices | None = None,
    external_wrench: Array | None = None,
    pressure: Pressure | None = None,
    stiffness: float = 1.0,
    quick: bool = False,
    starts: Sequence[Start] = (),
) -> HeldGrip:
    """
    Find the equilibrium of an object near its measured pose, with unknown contact history.

    The grasping members are given by their indices (m,), or are those that the object overlaps; if
    it overlaps fewer than two, the two nearest. The wrench (fx, fy, m) is about the origin of the
    object's frame [N, N m]; `stiffness` is a factor on EA, EI and GA of the tubes [-]. A `quick`
    search fits in a control cycle. The iteration begins at the first of `starts` that has the same
    contacts, if any.
    """
    body = body.smoothed(0.5 * config.robot.description.tube_diameter)
    depths = member_depths(config, body)
    # The grasping members.
    if members is None:
        # Those that overlap are the deepest; if these are fewer than two, the two nearest.
        count = max(int(np.count_nonzero(depths > 0.0)), 2)
        if count > GRIP_SIZES[-1]:
            raise NotHeldError(HoldStatus.OTHER_CONTACT)
        members = np.argsort(depths, kind='stable')[-count:]
    members = np.sort(np.asarray(members, dtype=np.intp))
    if depths[members].min() <= -config.robot.description.tube_diameter:
        raise NotHeldError(HoldStatus.NO_CONTACT)
    # Search for the contacts that press. A quick search has fewer sets of contacts, and fewer
    # iterations for each of them, to end within a control cycle.
    wrench = scaled_wrench(external_wrench, body.arm)
    max_sets = QUICK_SETS if quick else MAX_SEARCH_STEPS
    newton_steps = MAX_SEARCH_STEPS if quick else MAX_NEWTON_ITERATIONS
    solve = _contact_solver(config, body, pressure, stiffness, wrench, newton_steps, starts)
    grip = search_contacts(solve, find_pressed(config, body, members), limit=max_sets)
    if grip is None:
        raise NotHeldError(HoldStatus.NO_BALANCE)
    return grip


def lay_faces(grip: HeldGrip, friction: float, gap: float) -> HeldGrip:
    """
    Return the equilibrium with a whole face in contact if the object is held only by this face.

    With wrong roller offsets the modelled tubes are inclined, so the model has a gap, at most
    `gap` [m], at one end of a face that is in contact.
    """
    if grip.required_friction <= friction:  # held as it is
        return grip
    body, stiffness = grip.statics.body, grip.statics.bent.structure.stiffness
    solve = _contact_solver(grip.config, body, grip.pressures, stiffness, grip.wrench)
    for corner in sorted(find_free_corners(grip, gap), reverse=True):  # deepest first
        *_, whole_face = add_corner(grip, corner, rolls=False)
        on_face = search_contacts(solve, whole_face.contacts, limit=QUICK_SETS)
        if on_face is not None and on_face.required_friction <= friction:
            return on_face
    return grip


def _contact_solver(
    config: Configuration,
    body: ConvexObject,
    pressure: Pressure | None,
    stiffness: float,
    wrench: Array,
    steps: int = MAX_SEARCH_STEPS,
    starts: Sequence[Start] = (),
) -> ContactSolver:
    """Return the solver of equilibria near the measured pose, with unknown contact history."""

    def solve(chosen: ContactSet, _: HeldGrip | None) -> HeldGrip | None:
        statics = build_statics(config, body, chosen.contacts, pressure, stiffness)
        conditions = least_friction_conditions(statics, chosen.grazing)
        solution = None
        for grip, unknowns in starts:
            if np.array_equal(grip.contacts.corners, chosen.contacts.corners):
                bent = grip.statics.bent_under(unknowns, statics.bent.structure)
                initial = replace(statics, bent=bent)
                solution = initial.settle(unknowns, wrench, conditions, steps)
                break
        if solution is None:  # from straight tubes at the measured pose
            solution = statics.settle(statics.start(), wrench, conditions, steps)
        return None if solution is None else HeldGrip.of(*solution, wrench)

    return solve


def least_friction_conditions(
    statics: ContactStatics, grazing: int | None = None
) -> ContactConditions:
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
    indices, body, owners = statics.places, statics.body, statics.contacts.owners
    count = len(owners)
    member_count = int(owners[-1]) + 1
    has_two_members = member_count == 2
    has_faces = count > member_count
    is_face_pressed = has_faces and grazing is None
    ratio_forms = _ratio_forms(statics.contacts, is_face_pressed and has_two_members)
    # Rows: equal ratios, then the position between two members, then linear conditions.
    position_row = len(ratio_forms)
    linear_row = position_row + has_two_members

    # The chord is the mean of the first member's normals minus that of the second member's.
    chord_shares = np.where(owners == 0, 1.0, -1.0) / np.bincount(owners)[owners]

    # Linear conditions: coefficients times unknowns are equal to constants.
    coefficients, constants = np.zeros((count, indices.size)), np.zeros(count)
    if grazing is not None:
        coefficients[linear_row, indices.normal.start + grazing] = 1.0
    elif not has_faces:
        coefficients[linear_row, ANGLE] = body.arm
        constants[linear_row] = body.arm * body.pose.angle
    if not has_two_members:
        # The friction of each member is zero, or else the differences between the members.
        friction_sums = np.eye(member_count)
        if not is_face_pressed:
            friction_sums = (friction_sums - np.roll(friction_sums, 1, axis=1))[:-1]
        by_friction = FRICTION_COMPLIANCE * friction_sums[:, owners]
        last_rows = slice(-len(friction_sums), None)
        coefficients[last_rows, indices.friction] = by_friction

    def conditions(unknowns: Array, normals: Points) -> tuple[Array, Array]:
        residual = coefficients @ unknowns - constants
        derivative = coefficients.copy()
        # Ratios T / N are equal: quadratic forms of the forces, divided by the squeeze.
        if has_faces:
            forces = unknowns[indices.forces]
            squeeze = max(float(np.abs(forces[:count]).sum()), 1e-3)
            ratio_slopes = ratio_forms @ forces * FRICTION_COMPLIANCE / squeeze
            residual[:position_row] = 0.5 * ratio_slopes @ forces
            derivative[:position_row, indices.forces] = ratio_slopes
        # The displacement d of the centroid across the chord is zero: Re(across* d) = 0, where the
        # unit vector across the chord turns with the tubes.
        if has_two_members:
            chord = complex(chord_shares @ normals)
            length = max(abs(chord), 1e-9)
            across = 1j * chord / length
            centroid = cmath.rect(1.0, unknowns[ANGLE]) * body.shape.centroid
            displacement = complex(unknowns[0], unknowns[1]) + centroid - body.middle
            residual[position_row] = (across.conjugate() * displacement).real
            # Derivatives by the pose, and by the inclinations, which turn normals and chord.
            position_slope = derivative[position_row]
            by_object_angle = (across.conjugate() * 1j * centroid).real
            position_slope[:POSE] = across.real, across.imag, by_object_angle
            by_chord_angle = (across.conjugate() * -1j * displacement).real
            chord_turns = (chord.conjugate() * 1j * normals).imag * chord_shares / length**2
            position_slope[indices.inclinations] = by_chord_angle * chord_turns
        return residual, derivative

    return conditions


def _ratio_forms(contacts: PressedContacts, compares_members: bool) -> Array:
    """
    Return quadratic forms Q (q, 2k, 2k) of contact forces f that are zero if |T| / N are equal.

    The first ones compare both ends of each face; the last one compares two members. The value f Q
    f / 2 is the sum of T_one N_other + sign T_other N_one over pairs of contacts, with f = (N, T).
    """
    # Two groups of contacts; the sign is -1 if T / N has the same sign in both, else 1.
    pairs = [(ends[:1], ends[1:], -1.0) for ends in contacts.by_member if len(ends) == 2]
    if compares_members:
        pairs.append((contacts.by_member[0], contacts.by_member[1], 1.0))
    count = len(contacts.members)
    forms = np.zeros((len(pairs), 2 * count, 2 * count))
    for form, (one, other, sign) in zip(forms, pairs, strict=True):
        form[np.ix_(count + one, other)] = 1.0
        form[np.ix_(count + other, one)] = sign
    return forms + forms.transpose(0, 2, 1)
