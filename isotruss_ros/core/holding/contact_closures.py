# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What settles the equations of `contact_statics` that statics leaves open.

Contacts that stick roll with the tubes. With unknown contact history, friction is taken to be as
little as the balance needs: it settles what is stiff, and the measured pose what is not.
"""

from __future__ import annotations

from isotruss_ros.core.holding.contact_statics import (
    ANGLE,
    Closure,
    ContactStatics,
    Places,
)
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np

#: What turns forces into lengths, so that one tolerance serves both [m/N].
SOFTNESS = 1e-4


def rest(statics: ContactStatics, center: complex, angle: float) -> Closure:
    """
    Return the closure with unknown contact history: the pose is near to a measured one.

    The two ends of a face use friction alike. Two members press as hard as the measured place
    across their chord lets them; three as statics has it. The angle is the measured one, unless a
    face lies on a member: then it is the one at which the members use friction alike. Three
    members then need none, and without a face they rub alike.

    :param statics: the equations.
    :param center: measured origin of the object's frame, x + iy [m].
    :param angle: measured [rad].
    """
    owners, places, count = statics.contacts.owners, statics.places, len(statics.sides)
    members = int(owners[-1]) + 1
    ends = [np.flatnonzero(owners == i) for i in range(members)]
    alike = [(own[:1], own[1:], -1.0) for own in ends if len(own) == 2]
    faces, across = bool(alike), members == 2
    if faces and across:
        alike.append((ends[0], ends[1], 1.0))
    # Of three members the friction of the first ones, or their differences, that is to be none.
    signs = np.eye(members)[: count - len(alike) - (not faces)]
    if not faces:
        signs = signs - np.roll(signs, 1, axis=1)

    def rows(unknowns: Array, normals: Points) -> tuple[Array, Array]:
        left, derivative = np.zeros(count), np.zeros((count, places.size))
        for number, pair in enumerate(alike):
            left[number] = _use_alike(unknowns, places, *pair, derivative[number])
        number = len(alike)
        if across:
            left[number] = _along(statics, unknowns, normals, ends, center, derivative[number])
            number += 1
        if not faces:
            left[number] = statics.arm * (unknowns[ANGLE] - angle)
            derivative[number, ANGLE] = statics.arm
            number += 1
        if not across:
            friction = unknowns[places.friction]
            sums = np.array([friction[own].sum() for own in ends])
            left[number:] = SOFTNESS * (signs @ sums)
            derivative[number:, places.friction] = SOFTNESS * signs[:, owners]
        return left, derivative

    return rows


def _use_alike(
    unknowns: Array, places: Places, one: Indices, other: Indices, sign: float, row: Array
) -> float:
    """Return T_one N_other + sign T_other N_one of some contacts, in the row its derivative."""
    normal, friction = unknowns[places.normal], unknowns[places.friction]
    scale = SOFTNESS / max(float(np.abs(normal).sum()), 1e-3)
    rubs, presses, rubs_too, presses_too = (
        float(values[own].sum()) for own in (one, other) for values in (friction, normal)
    )
    row[places.friction.start + one] = scale * presses_too
    row[places.normal.start + other] = scale * rubs
    row[places.friction.start + other] = scale * sign * presses
    row[places.normal.start + one] = scale * sign * rubs_too
    return scale * (rubs * presses_too + sign * rubs_too * presses)


def _along(
    statics: ContactStatics,
    unknowns: Array,
    normals: Points,
    ends: list[Indices],
    center: complex,
    row: Array,
) -> float:
    """Return how far the object has moved across the chord of two members' normals [m]."""
    one, other = int(ends[0][0]), int(ends[1][0])
    first, second = normals.item(one), normals.item(other)
    chord = first - second
    size = max(abs(chord), 1e-9)
    along = 1j * chord / size
    away = complex(unknowns[0], unknowns[1]) - center
    row[0], row[1] = along.real, along.imag
    lever = (along.conjugate() * -1j * away).real / size**2
    inclinations = statics.places.inclinations.start
    # Of the chord, as the tubes incline.
    row[inclinations + one] = (chord.conjugate() * 1j * first).imag * lever
    row[inclinations + other] = -(chord.conjugate() * 1j * second).imag * lever
    return (along.conjugate() * away).real


def stick(
    statics: ContactStatics, anchors: Array, travel: Array, angles: Array, free: Indices
) -> Closure:
    """
    Return the closure for contacts that roll without slip, (17) integrated.

        kappa_i (s_i - phi_i) - arc(arg nu_i - theta) = A_i

    :param statics: the equations.
    :param anchors: (k,) A_i, see `find_anchors` [m].
    :param travel: (k,) phi_i of the modules at the members' starts [m].
    :param angles: (k,) of the normals in the object's frame before, not wrapped [rad].
    :param free: contacts that have only come to touch: they take no friction yet.
    """
    places = statics.places

    def rows(unknowns: Array, normals: Points) -> tuple[Array, Array]:
        derivative = statics.rolling_rows(unknowns, normals)
        left = find_anchors(statics, unknowns, normals, travel, angles) - anchors
        if len(free):
            left[free] = SOFTNESS * unknowns[places.friction][free]
            derivative[free] = 0.0
            derivative[free, places.friction.start + free] = SOFTNESS
        return left, derivative

    return rows


def find_anchors(
    statics: ContactStatics, unknowns: Array, normals: Points, travel: Array, angles: Array
) -> Array:
    """
    Return what stays as it is while the contacts roll, (k,) [m].

    :param statics: the equations.
    :param unknowns: see `ContactForces`.
    :param normals: (k,) from the object toward the tubes.
    :param travel: (k,) phi_i of the modules at the members' starts [m].
    :param angles: (k,) of the normals in the object's frame before, not wrapped [rad].
    """
    found = unwrapped(unknowns, normals, angles)
    arcs = statics.body.shape.unroll(found, statics.contacts.corners)
    return -statics.sides * (unknowns[statics.places.feet] - travel) - arcs


def unwrapped(unknowns: Array, normals: Points, angles: Array) -> Array:
    """
    Return the angles of normals in the object's frame, within half a turn of others, (k,) [rad].

    :param unknowns: see `ContactForces`.
    :param normals: (k,) from the object toward the tubes.
    :param angles: (k,) others, not wrapped [rad].
    """
    own = normals * np.exp(-1j * unknowns[ANGLE])
    return angles + np.angle(own * np.exp(-1j * angles))
