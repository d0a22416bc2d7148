# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Conditions of least friction, which replace those of rolling for an unknown contact history."""

from __future__ import annotations

import functools

from isotruss_ros.core.holding.contact_statics import (
    ContactConditions,
    ContactStatics,
    FRICTION_COMPLIANCE,
)
from isotruss_ros.core.holding.pressed_contacts import (
    ANGLE,
    group_by_member,
    Places,
    PressedContacts,
)
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np


def least_friction_conditions(
    contacts: PressedContacts, grazing: int | None = None
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
    return _conditions_of(tuple(contacts.owners.tolist()), grazing)


@functools.lru_cache(maxsize=64)
def _conditions_of(owner_of_contact: tuple[int, ...], grazing: int | None) -> ContactConditions:
    """Return the conditions of contacts by their `PressedContacts.owners`, cached."""
    owners = np.array(owner_of_contact)
    count, indices = len(owners), Places.of(len(owners))
    member_count = int(owners[-1]) + 1
    has_two_members = member_count == 2
    has_faces = count > member_count
    is_face_pressed = has_faces and grazing is None
    ratio_forms = _ratio_forms(owners, is_face_pressed and has_two_members)
    # Rows: equal ratios, then the position between two members, then linear conditions.
    position_row = len(ratio_forms)
    linear_row = position_row + has_two_members
    keeps_angle = grazing is None and not has_faces

    # The chord is the mean of the first member's normals minus that of the second member's.
    chord_shares = np.where(owners == 0, 1.0, -1.0) / np.bincount(owners)[owners]

    # Linear conditions: coefficients times unknowns are zero.
    coefficients = np.zeros((count, indices.size))
    if grazing is not None:
        coefficients[linear_row, indices.normal.start + grazing] = 1.0
    if not has_two_members:
        # The friction of each member is zero, or else the differences between the members.
        friction_sums = np.eye(member_count)
        if not is_face_pressed:
            friction_sums = (friction_sums - np.roll(friction_sums, 1, axis=1))[:-1]
        by_friction = FRICTION_COMPLIANCE * friction_sums[:, owners]
        last_rows = slice(-len(friction_sums), None)
        coefficients[last_rows, indices.friction] = by_friction

    def conditions(
        statics: ContactStatics, unknowns: Array, normals: Points
    ) -> tuple[Array, Array]:
        body = statics.body
        residual = unknowns @ coefficients.T
        derivative = np.empty((*normals.shape, indices.size))
        derivative[...] = coefficients
        if keeps_angle:
            residual[..., linear_row] = body.arm * (unknowns[..., ANGLE] - body.angle)
            derivative[..., linear_row, ANGLE] = body.arm
        # Ratios T / N are equal: quadratic forms of the forces, divided by the squeeze.
        if has_faces:
            forces = unknowns[..., None, indices.forces]
            squeeze = np.abs(forces[..., :count]).sum(axis=-1, keepdims=True)
            factor = FRICTION_COMPLIANCE / np.maximum(squeeze, 1e-3)
            ratio_slopes = (ratio_forms @ forces[..., None])[..., 0] * factor
            residual[..., :position_row] = 0.5 * (ratio_slopes * forces).sum(axis=-1)
            derivative[..., :position_row, indices.forces] = ratio_slopes
        # The displacement d of the centroid across the chord is zero: Re(across* d) = 0, where the
        # unit vector across the chord turns with the tubes.
        if has_two_members:
            chord = normals @ chord_shares
            length = np.maximum(np.abs(chord), 1e-9)
            across = (-1j * chord.conj()) / length  # conjugate
            centroid = np.exp(1j * unknowns[..., ANGLE]) * body.shape.centroid
            displacement = unknowns[..., 0] + 1j * unknowns[..., 1] + centroid - body.middle
            residual[..., position_row] = (across * displacement).real
            # Derivatives by the pose, and by the inclinations, which turn normals and chord.
            position_slope = derivative[..., position_row, :]
            position_slope[..., 0], position_slope[..., 1] = across.real, -across.imag
            position_slope[..., ANGLE] = (across * 1j * centroid).real
            by_chord_angle = (across * -1j * displacement).real / length**2
            chord_turns = (chord.conj()[..., None] * 1j * normals).imag * chord_shares
            position_slope[..., indices.inclinations] = by_chord_angle[..., None] * chord_turns
        return residual, derivative

    return conditions


def _ratio_forms(owners: Indices, compares_members: bool) -> Array:
    """
    Return quadratic forms Q (q, 2k, 2k) of contact forces f that are zero if |T| / N are equal.

    The first ones compare both ends of each face; the last one compares two members. The value f Q
    f / 2 is the sum of T_one N_other + sign T_other N_one over pairs of contacts, with f = (N, T).
    """
    # Two groups of contacts; the sign is -1 if T / N has the same sign in both, else 1.
    by_member = group_by_member(owners)
    pairs = [(ends[:1], ends[1:], -1.0) for ends in by_member if len(ends) == 2]
    if compares_members:
        pairs.append((by_member[0], by_member[1], 1.0))
    count = len(owners)
    forms = np.zeros((len(pairs), 2 * count, 2 * count))
    for form, (one, other, sign) in zip(forms, pairs, strict=True):
        form[np.ix_(count + one, other)] = 1.0
        form[np.ix_(count + other, one)] = sign
    return forms + forms.transpose(0, 2, 1)
