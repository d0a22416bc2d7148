# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Construction of the equilibrium equations of a held object, and of their initial guess.

A corner has one contact; a face has one contact at each end.
"""

from __future__ import annotations

import cmath

from isotruss_ros.core.contact.dents import corner_dents, Dents, disc_dents
from isotruss_ros.core.contact.flattening import flattening_of
from isotruss_ros.core.holding.contact_forces import PressedContacts
from isotruss_ros.core.holding.contact_statics import ContactStatics, TubeModel
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.depths import member_lines
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.shapes import PLANNED_DEPTH, Shape
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.statics.bent_tubes import BentTubes
from isotruss_ros.core.statics.structure import Structure, structure_of
import numpy as np

#: Tube model with flattening and with pressure and stiffness of the robot file.
NOMINAL_TUBES = TubeModel()


def find_pressed(config: Configuration, body: ConvexObject, members: Indices) -> PressedContacts:
    """Return the contacts of given members with an object, see `Shape.contact_patch`."""
    starts, normals = facing_lines(config, body, members)
    own = normals * body.turn.conjugate()
    radius = 0.5 * config.robot.description.tube_diameter
    skins = ((starts - body.center) * normals.conj()).real - radius
    found: list[tuple[int, int]] = []
    for member, normal, skin in zip(members.tolist(), own.tolist(), skins.tolist(), strict=True):
        patch = body.shape.contact_patch(normal, radius, skin)
        found += [(member, end.corner) for end in patch]
    numbers, corners = np.array(found).T
    return contacts_at(body.shape, numbers, corners, radius)


def contacts_at(
    shape: Shape, members: Indices, corners: Indices, tube_radius: float
) -> PressedContacts:
    """
    Return the contacts of members with given corners of an object.

    The two ends of a face share it, whether or not both are in contact. So the forces are
    continuous if an end gains contact. A face shorter than a tube radius has one contact.
    """
    cuts = np.full((len(members), 2), np.inf)
    for k, corner in enumerate(corners.tolist()):
        for side, face in enumerate(shape.faces_at(corner)):
            if face.length >= tube_radius:
                cuts[k, side] = 0.5 * face.length
    return PressedContacts(members, corners, cuts)


def facing_lines(
    config: Configuration, body: ConvexObject, members: Indices
) -> tuple[Points, Points]:
    """Return the starts (m,) of members [m], and their normals (m,) away from an object."""
    starts, ends = member_lines(config)[members].T
    axes = (ends - starts) / np.abs(ends - starts)
    aside = (axes.conj() * (body.middle - starts)).imag
    return starts, -1j * np.where(aside < 0.0, -axes, axes)


def build_statics(
    config: Configuration,
    body: ConvexObject,
    contacts: PressedContacts,
    tubes: TubeModel = NOMINAL_TUBES,
    normals: Points | None = None,
) -> ContactStatics:
    """
    Return the equilibrium equations of an object with given contacts, for straight tubes.

    The dents depend on the normals (k,) of the tubes at the contacts; None: straight tubes.
    """
    structure = structure_of(config, tubes.pressure)
    starts, straight = facing_lines(config, body, contacts.members)
    points, _ = body.shape.surface_at(contacts.corners, straight * body.turn.conjugate())
    # The normals point away from the object: left of the member if the object is on its right.
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
        dents=find_dents(
            structure, body, contacts, tubes, straight if normals is None else normals
        ),
    )


def start_at(statics: ContactStatics, body: ConvexObject) -> Array:
    """Return an initial guess of the unknowns (3 + 4k,)."""
    places, bent = statics.places, statics.bent
    start = np.zeros(places.size)
    start[:3] = body.center.real, body.center.imag, body.pose.angle
    normals = statics.straight_normals
    points, _ = body.shape.surface_at(statics.contacts.corners, normals * body.turn.conjugate())
    start[places.feet] = bent.places
    across = (bent.axis.conj() * (body.center + body.turn * points - bent.start)).imag
    depths = statics.tube_radius + statics.sides * across
    depths = np.maximum(depths, PLANNED_DEPTH * statics.tube_radius)
    own = np.einsum('iaia->ia', bent.matrix)[:, 1]
    _, dent = statics.dents(depths / own)
    start[places.normal] = depths / (own + dent)
    return start


def find_dents(
    structure: Structure,
    body: ConvexObject,
    contacts: PressedContacts,
    tubes: TubeModel,
    normals: Points,
) -> Dents:
    """Return the depths of the dents at all contacts as functions of the normal forces."""
    if tubes.paper_model:
        return Dents()
    robot, shape = structure.config.robot, body.shape
    tubes_pressed = robot.topology.tube[contacts.members].tolist()
    kernels = [flattening_of(robot, structure.pressures[tube]) for tube in tubes_pressed]
    if shape.is_round:
        return Dents(
            [disc_dents(kernel, shape.reach) for kernel in kernels], tubes.stiffness_scale
        )
    angles = map(cmath.phase, (normals * body.turn.conjugate()).tolist())
    corners, cuts = contacts.corners.tolist(), map(tuple, contacts.cuts.tolist())
    tables = [
        corner_dents(kernel, shape, *at)
        for kernel, *at in zip(kernels, angles, corners, cuts, strict=True)
    ]
    return Dents(tables, tubes.stiffness_scale)
