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

from isotruss_ros.core.holding.contact_statics import ANGLE, Closure, ContactStatics
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
    owners, places = statics.contacts.owners, statics.places
    members = int(owners[-1]) + 1
    ends = [np.flatnonzero(owners == i) for i in range(members)]
    faces = [own for own in ends if len(own) == 2]

    def rows(unknowns: Array, normals: Points) -> tuple[Array, Array]:
        count = len(owners)
        left, derivative = np.zeros(count), np.zeros((count, places.size))
        number = 0
        normal, friction = unknowns[places.normal], unknowns[places.friction]
        squeeze = max(float(np.abs(normal).sum()), 1e-3)
        scale = SOFTNESS / squeeze

        def alike(one: Indices, other: Indices, sign: float) -> None:
            """Add the row T_one N_other + sign T_other N_one = 0."""
            nonlocal number
            sums = [
                float(values[own].sum()) for own in (one, other) for values in (friction, normal)
            ]
            rubs, presses, rubs_too, presses_too = sums
            left[number] = scale * (rubs * presses_too + sign * rubs_too * presses)
            row = derivative[number]
            row[places.friction.start + one] += scale * presses_too
            row[places.normal.start + other] += scale * rubs
            row[places.friction.start + other] += scale * sign * presses
            row[places.normal.start + one] += scale * sign * rubs_too
            number += 1

        for own in faces:
            alike(own[:1], own[1:], -1.0)
        if members == 2:
            left[number] = _along(statics, unknowns, normals, ends, center, derivative[number])
            number += 1
            if faces:
                alike(ends[0], ends[1], 1.0)
                return left, derivative
        if not faces:
            left[number] = statics.arm * (unknowns[ANGLE] - angle)
            derivative[number, ANGLE] = statics.arm
            number += 1
        if members > 2:
            sums = np.array([friction[own].sum() for own in ends])
            signs = np.eye(members)[: len(left) - number]
            if not faces:
                signs = signs - np.roll(signs, 1, axis=1)
            left[number:] = SOFTNESS * (signs @ sums)
            derivative[number:, places.friction] = SOFTNESS * signs[:, owners]
        return left, derivative

    return rows


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
    chord = complex(normals[one] - normals[other])
    size = max(abs(chord), 1e-9)
    along = 1j * chord / size
    away = complex(unknowns[0], unknowns[1]) - center
    row[0], row[1] = along.real, along.imag
    for i, sign in ((one, 1.0), (other, -1.0)):
        moved = sign * 1j * complex(normals[i])  # of the chord, as the tube inclines
        turned = (chord.conjugate() * moved).imag / size**2
        place = statics.places.inclinations.start + i
        row[place] = turned * ((1j * along).conjugate() * away).real
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
