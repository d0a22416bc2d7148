# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Equations of equilibrium of objects at their measured poses, on straight or bent tubes."""

from __future__ import annotations

from collections.abc import Sequence

from isotruss_ros.core.contact.dent_interpolation import find_table, InterpolatedTable
from isotruss_ros.core.contact.dent_table import DentTable
from isotruss_ros.core.contact.dents import Dents
from isotruss_ros.core.holding.contact_statics import ContactStatics
from isotruss_ros.core.holding.pressed_contacts import ANGLE, PressedContacts
from isotruss_ros.core.model.convex_object import ConvexObject, facing_normals
from isotruss_ros.core.model.object_samples import ObjectSamples
from isotruss_ros.core.model.shapes import PLANNED_DEPTH, Shape
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.samples import column
from isotruss_ros.core.statics.bent_tubes import BentTubes
from isotruss_ros.core.statics.load_points import Lines
from isotruss_ros.core.statics.structure import Structure
import numpy as np


def build_statics(
    structure: Structure,
    body: ConvexObject | ObjectSamples,
    contacts: PressedContacts,
    feet: Array,
    deforms: bool,
) -> ContactStatics:
    """
    Return the equilibrium equations of an object, for straight tubes with contacts at `feet`.

    All tubes are deformable from the start if `deforms` is true, see `UnloadedBlocks`.
    """
    bent = BentTubes.of(structure, contacts.members, feet, deforms=deforms)
    return statics_of(bent, body, contacts)


def statics_of(
    bent: BentTubes, body: ConvexObject | ObjectSamples, contacts: PressedContacts
) -> ContactStatics:
    """Return the equilibrium equations of an object with given contacts on bent tubes."""
    normals = facing_normals(column(body.middle), bent.lines.start, bent.lines.axis)
    return ContactStatics(
        bent=bent,
        body=body,
        contacts=contacts,
        tube_radius=0.5 * bent.structure.config.robot.description.tube_diameter,
        sides=np.sign((normals * bent.lines.axis.conj()).imag),
        dents=find_dents(bent.structure, body, contacts),
    )


def find_feet(
    structure: Structure, body: ConvexObject | ObjectSamples, contacts: PressedContacts
) -> Array:
    """Return the positions (k,) of contacts on straight members, not beyond their ends [m]."""
    lines = Lines.of(structure, contacts.members)
    turn, center = column(body.turn), column(body.center)
    normals = facing_normals(column(body.middle), lines.start, lines.axis)
    points, _ = body.shape.surface_at(contacts.corners, normals * turn.conj())
    feet = ((center + turn * points - lines.start) * lines.axis.conj()).real
    return np.clip(feet, 0.0, lines.length)


def find_dents(
    structure: Structure, body: ConvexObject | ObjectSamples, contacts: PressedContacts
) -> Dents:
    """Return the dents at all contacts, as functions of normal forces and angles."""
    robot, corners = structure.config.robot, contacts.corners.tolist()
    tubes = robot.topology.tube[contacts.members].tolist()

    def tables(pressures: Sequence[float], shape: Shape) -> list[DentTable | InterpolatedTable]:
        """Return the tables of one object."""
        return [
            find_table(robot, tube, pressures[tube], shape, corner)
            for tube, corner in zip(tubes, corners, strict=True)
        ]

    if isinstance(body, ConvexObject):
        return Dents(tables(structure.pressures, body.shape))
    pressures = np.asarray(structure.pressures).tolist()
    return Dents([tables(p, b.shape) for p, b in zip(pressures, body.objects, strict=True)])


def start_unknowns(statics: ContactStatics) -> Array:
    """Return an initial guess of the unknowns (3 + 4k,) at the object's measured pose."""
    indices, bent, body = statics.places, statics.bent, statics.body
    unknowns = np.zeros((*statics.sides.shape[:-1], indices.size))
    unknowns[..., 0], unknowns[..., 1] = np.real(body.center), np.imag(body.center)
    unknowns[..., ANGLE], unknowns[..., indices.feet] = body.angle, bent.places
    in_object = statics.straight_normals * column(body.turn).conj()
    depths = np.maximum(measure_overlaps(statics), PLANNED_DEPTH * statics.tube_radius)
    # The depth is that of the tube's displacement across the member and of the dent. The
    # displacement is each contact's response to its own load.
    by_across = slice(1, 3 * len(bent.members), 3)
    tube_compliance = np.einsum('...kk->...k', bent.at_points[..., 1, by_across])
    _, dent_compliance, _ = statics.dents(depths / tube_compliance, np.angle(in_object))
    unknowns[..., indices.normal] = depths / (tube_compliance + dent_compliance)
    return unknowns


def measure_overlaps(statics: ContactStatics) -> Array:
    """Return the overlaps (k,) of the object at its measured pose with the straight tubes [m]."""
    body, lines = statics.body, statics.bent.lines
    turn, center = column(body.turn), column(body.center)
    in_object = statics.straight_normals * turn.conj()
    points, _ = body.shape.surface_at(statics.contacts.corners, in_object)
    from_start = center + turn * points - lines.start
    return statics.tube_radius + statics.sides * (lines.axis.conj() * from_start).imag
