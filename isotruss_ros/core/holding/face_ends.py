# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faces with one end in contact, and the depth of their other end in the bent tube."""

from __future__ import annotations

import cmath

from isotruss_ros.core.holding.contact_forces import ANGLE, ContactForces, PressedContacts
from isotruss_ros.core.holding.contact_statics import ContactStatics
from isotruss_ros.core.model.shapes import Face
from isotruss_ros.core.statics.bent_tubes import BentTubes
import numpy as np


def open_faces(statics: ContactStatics) -> list[tuple[int, Face]]:
    """
    Return each single contact at a corner with each of the two faces at this corner.

    The face after the corner (counter-clockwise) comes first.

    :param statics: equations of equilibrium of the object.
    """
    owners, corners = statics.contacts.owners, statics.contacts.corners
    alone = np.flatnonzero(np.bincount(owners)[owners] == 1).tolist()
    shape = statics.body.shape
    return [(k, face) for k in alone for face in reversed(shape.faces_at(int(corners[k])))]


def is_short(statics: ContactStatics, face: Face) -> bool:
    """
    Return whether a face is so short that only one of its ends is in contact at a time.

    :param statics: equations of equilibrium of the object.
    :param face: face of the object.
    """
    return face.length < statics.tube_radius


def far_end_depth(
    statics: ContactStatics, state: ContactForces, k: int, face: Face, gap: float = 0.0
) -> float:
    """
    Return the depth of a face's far end in the bent tube; negative for a gap [m].

    :param statics: equations of equilibrium of the object.
    :param state: solution of the equations.
    :param k: index of the contact at the near end of the face.
    :param face: the face.
    :param gap: largest gap for which the bent tube is computed [m]; for larger gaps the result is
        the depth in the straight tube, which is an upper bound.
    """
    bent, turn = statics.bent, cmath.rect(1.0, state.unknowns[ANGLE])
    normal = complex(statics.straight_normals[k])
    point = state.center + turn * statics.body.shape.point_at(face.corner, normal / turn)
    place = (point - bent.start[k]) / bent.axis[k]
    if not 0.0 < place.real < bent.length[k]:
        return -np.inf
    depth = float(statics.tube_radius + statics.sides[k] * place.imag)
    if depth <= -gap:
        return depth
    return depth - displacement_at(statics, state, int(bent.members[k]), place.real, normal)


def displacement_at(
    statics: ContactStatics, state: ContactForces, number: int, foot: float, normal: complex
) -> float:
    """
    Return the displacement of a member along a normal at a point without contact [m].

    :param statics: equations of equilibrium of the object.
    :param state: solution of the equations.
    :param number: index of the member.
    :param foot: distance of the point from the member's start [m].
    :param normal: unit vector, x + iy.
    """
    bent = statics.bent
    members, feet = np.append(bent.members, number), np.append(state.feet, foot)
    cut = BentTubes(bent.structure, members, feet, bent.stiffness)
    # The linear response to the loads suffices to find whether the point is in contact.
    along, across, _ = cut.respond(np.vstack([state.loads, np.zeros(3)]), feet)[-1].tolist()
    return float((normal.conjugate() * complex(along, across) * cut.axis[-1]).real)


def with_far_end(contacts: PressedContacts, k: int, face: Face) -> tuple[PressedContacts, int]:
    """
    Return the contacts with the far end of a face added, and the index of the far end.

    :param contacts: contacts of the object.
    :param k: index of the contact at the near end.
    :param face: the face.
    """
    half, new = 0.5 * face.length, k + (face.step > 0)
    cuts = contacts.cuts.copy()
    cuts[k], cut = ((np.inf, half), (half, np.inf))[:: face.step]
    members = np.insert(contacts.members, new, contacts.members[k])
    corners = np.insert(contacts.corners, new, face.corner)
    return PressedContacts(members, corners, np.insert(cuts, new, cut, axis=0)), new
