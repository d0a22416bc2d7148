# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The equations of a held object from where it presses into tubes, and a start for their solution.

It presses with one corner, or with both ends of a face.
"""

from __future__ import annotations

from isotruss_ros.core.contact.dents import (
    corner_dents,
    Indentation,
    skin_indentation,
    SkinIndentation,
)
from isotruss_ros.core.holding.contact_forces import PressedContacts
from isotruss_ros.core.holding.contact_statics import ContactStatics, TubeModel
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.depths import member_lines
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.shapes import Face, Shape
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.statics.bent_tubes import BentTubes
from isotruss_ros.core.statics.structure import Structure, structure_of
import numpy as np

#: Ends of a face that are nearer than this many tube radii along the tube share one dent.
LEAST_FACE = 1.0
#: Tubes of the robot file, which flatten.
AS_MODELLED = TubeModel()
#: Tables of dents are for normals in steps of this [rad].
ANGLE_STEP = 0.01
#: Objects that only touch are taken to be this deep, as a share of their size.
LEAST_DEPTH = 1e-3


def find_pressed(config: Configuration, body: ConvexObject, members: Indices) -> PressedContacts:
    """
    Return where members touch an object: with one corner, or both ends of a face.

    :param config: configuration of the robot.
    :param body: the object in its place.
    :param members: (m,) numbers of the members, which rise.
    """
    if not body.shape.faces_at(0):
        count = len(members)
        return PressedContacts(
            members, np.zeros(count, dtype=np.intp), np.full((count, 2), np.inf)
        )
    starts, normals = facing_lines(config, body, members)
    own = normals * body.turn.conjugate()
    away = ((starts - body.center) * normals.conj()).real
    radius = 0.5 * config.robot.description.tube_diameter
    found: list[tuple[int, int, float, float]] = []
    for member, normal, distance in zip(
        members.tolist(), own.tolist(), away.tolist(), strict=True
    ):
        corner = body.shape.corners_at(normal, 0.0)[0]
        face = _deeper_face(body.shape, corner, normal)
        if face is None or not _is_laid(body.shape, corner, face, normal, distance, radius):
            found.append((member, corner, np.inf, np.inf))
            continue
        one, other = (corner, face.corner)[:: face.step]
        half = 0.5 * face.length
        found += [(member, one, np.inf, half), (member, other, half, np.inf)]
    numbers, corners, before, behind = zip(*found, strict=True)
    return PressedContacts(np.array(numbers), np.array(corners), np.column_stack([before, behind]))


def _is_laid(
    shape: Shape, corner: int, face: Face, normal: complex, distance: float, radius: float
) -> bool:
    """Return whether the other end of a face is in the tube too, and not in the same dent."""
    back, end = normal.conjugate(), shape.point_at(face.corner, normal)
    apart = face.step * ((end - shape.point_at(corner, normal)) * back).imag
    deep = (end * back).real - distance + radius
    return apart >= LEAST_FACE * radius and deep > 0.0


def _deeper_face(shape: Shape, corner: int, normal: complex) -> Face | None:
    """Return the face at a corner whose other end is farther out along a normal, if it has any."""
    faces = shape.faces_at(corner)
    if not faces:
        return None
    back = normal.conjugate()
    return max(faces, key=lambda face: (shape.point_at(face.corner, normal) * back).real)


def facing_lines(
    config: Configuration, body: ConvexObject, members: Indices
) -> tuple[Points, Points]:
    """
    Return where members start, and their normals out of an object, (m,) each, x + iy [m].

    :param config: configuration of the robot.
    :param body: the object in its place.
    :param members: (m,) numbers of the members.
    """
    starts, ends = member_lines(config)[members].T
    axes = (ends - starts) / np.abs(ends - starts)
    aside = (axes.conj() * (body.middle - starts)).imag
    return starts, -1j * np.where(aside < 0.0, -axes, axes)


def build_statics(
    config: Configuration,
    body: ConvexObject,
    contacts: PressedContacts,
    tubes: TubeModel = AS_MODELLED,
    normals: Points | None = None,
) -> ContactStatics:
    """
    Return the equations of an object at some contacts, the tubes straight yet.

    :param config: configuration of the robot.
    :param body: the object in its place.
    :param contacts: its contacts.
    :param tubes: what is assumed of the tubes.
    :param normals: (k,) of the tubes as they are bent, for the dents; straight ones if None.
    :raises StructureError: see `structure_of`.
    """
    structure = structure_of(config, tubes.pressure)
    starts, straight = facing_lines(config, body, contacts.members)
    points, _ = body.shape.surface_at(contacts.corners, straight * body.turn.conjugate())
    # On the right of a member the object is on the side of its normals.
    starting, ending = member_lines(config)[contacts.members].T
    axis = (ending - starting) / np.abs(ending - starting)
    sides = np.sign((straight * axis.conj()).imag)
    feet = ((body.center + body.turn * points - starts) * axis.conj()).real
    bent = BentTubes(
        structure,
        contacts.members,
        np.clip(feet, 0.0, np.abs(ending - starting)),
        tubes.stiffness_scale,
        tubes.paper_model,
    )
    return ContactStatics(
        bent=bent,
        body=body,
        contacts=contacts,
        tube_radius=0.5 * config.robot.description.tube_diameter,
        sides=sides,
        indentation=find_dents(
            structure, body, contacts, tubes, straight if normals is None else normals
        ),
    )


def start_at(statics: ContactStatics, body: ConvexObject) -> Array:
    """
    Return unknowns (3 + 4k,) to begin the search for an equilibrium with.

    :param statics: the equations.
    :param body: the object where it was measured.
    """
    places, bent = statics.places, statics.bent
    start = np.zeros(places.size)
    start[:3] = body.center.real, body.center.imag, body.pose.angle
    normals = statics.straight_normals
    points, _ = body.shape.surface_at(statics.contacts.corners, normals * body.turn.conjugate())
    start[places.feet] = bent.places
    across = (bent.axis.conj() * (body.center + body.turn * points - bent.start)).imag
    depths = statics.tube_radius + statics.sides * across
    depths = np.maximum(depths, LEAST_DEPTH * statics.body.arm)
    own = np.einsum('iaia->ia', bent.matrix)[:, 1]
    _, dent = statics.indentation(depths / own)
    start[places.normal] = depths / (own + dent)
    return start


def find_dents(
    structure: Structure,
    body: ConvexObject,
    contacts: PressedContacts,
    tubes: TubeModel,
    normals: Points,
) -> Indentation:
    """
    Return the dents at all contacts.

    :param structure: the frame of the robot.
    :param body: the object in its place.
    :param contacts: its contacts.
    :param tubes: what is assumed of the tubes.
    :param normals: (k,) of the tubes, from the object.
    """
    if tubes.paper_model:
        return Indentation()
    pressures = None if tubes.pressure is None else structure.pressures
    tables = _dents(structure.config, body, contacts, normals, pressures)
    return Indentation(tables, tubes.stiffness_scale)


def _dents(
    config: Configuration,
    body: ConvexObject,
    contacts: PressedContacts,
    normals: Points,
    pressures: tuple[float, ...] | None,
) -> list[SkinIndentation]:
    """Return the dents at all contacts."""
    tubes = config.robot.topology.tube[contacts.members]
    if body.shape.is_round:
        radius = body.shape.reach
        return [skin_indentation(config.robot, int(tube), radius, pressures) for tube in tubes]
    angles = ANGLE_STEP * np.round(np.angle(normals * body.turn.conjugate()) / ANGLE_STEP)
    return [
        corner_dents(
            config.robot,
            int(tube),
            body.shape,
            float(angle),
            int(corner),
            (float(cut[0]), float(cut[1])),
            pressures,
        )
        for tube, angle, corner, cut in zip(
            tubes, angles, contacts.corners, contacts.cuts, strict=True
        )
    ]
