# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Contact regions: lengths, widths and pressures of the tubes on the object.

The wall of a flattened section is straight across the tube. Along the tube it has the tension T
and follows an object with the radius of curvature r. So the contact pressure is p + T / r with the
gauge pressure p. The width of the contact is the load per length over this pressure. It is at most
half of the tube's circumference, pi R; then the section is flat, and the pressure is higher.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from isotruss_ros.core.contact.contact_points import ContactPoints, ContactState
from isotruss_ros.core.contact.grasp_analysis import SolvedContact
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.beam_column import end_forces
from isotruss_ros.core.statics.structure import Structure
from isotruss_ros.core.statics.wrinkling import find_utilisation, Utilisation
import numpy as np


def find_wrinkling(
    structure: Structure, contact_points: ContactPoints, contact: ContactState
) -> tuple[Utilisation, Array]:
    """
    Return the utilisation of the members under contact forces, and the tension of the tube walls.

    :param structure: structural model of the robot.
    :param contact_points: candidate contact points.
    :param contact: contact with its forces.
    :return: utilisation of the members; and (c,) tension along the tube at each point, in
        the wall on the object's side, not negative [N/m].
    """
    topology, tubes = structure.config.robot.topology, contact_points.bent
    radius = 0.5 * structure.config.robot.description.tube_diameter
    touching = np.flatnonzero(contact.forces > 0.0)
    frame, linear = tubes.frame, tubes.is_straight
    changes, longer = tubes.tangent.force_changes(contact_points.move(contact.push)[0][..., None])
    forces = tubes.tangent.forces.values + changes[..., 0]
    length = tubes.tangent.length + longer[:, 0]
    ends, pull = end_forces(forces, length), forces[:, 0]
    sections = find_utilisation(structure, frame, ends, 0.0 * pull if linear else pull)
    aside = np.sign((contact.push * contact_points.axis.conj()).imag)[touching]
    before, behind = frame.before[touching], frame.behind[touching]
    moment = tubes.ahead[touching] * ends[before, 5]
    compression = np.maximum(-ends[before, 3], ends[behind, 0])
    # Bending away from the object's force stretches the wall on the object's side.
    pressure = np.array(structure.pressures)[topology.tube]
    tension = (pressure * np.pi * radius**2)[contact_points.member]
    tension[touching] += 2.0 / radius * moment * aside - compression
    tension /= 2.0 * np.pi * radius
    return sections, np.maximum(tension, 0.0)


def assess_members(structure: Structure, solved: SolvedContact) -> dict[str, Any]:
    """
    Return the fields of a `GraspAnalysis` that are dictionaries with members as keys.

    :param structure: structural model of the robot.
    :param solved: the solved contact.
    """
    robot, (points, contact, length, spans, _) = structure.config.robot, solved
    sections, tension = find_wrinkling(structure, points, contact)
    gauge = np.array(structure.pressures)[robot.topology.tube[points.member]]
    forces, local = contact.forces, gauge + tension / contact.radii
    # The pressure at which a contact over half of the circumference carries the force.
    flat = forces / (0.5 * np.pi * robot.description.tube_diameter * points.spacing)
    pressed_flat = np.zeros(len(robot.member_names), dtype=bool)
    if points.dents.any():
        pressed_flat[points.member[flat >= local]] = True
    local = np.maximum(local, flat)
    count = robot.topology.n_modules
    force, area = (np.bincount(points.member, each, count) for each in (forces, forces / local))
    width, peak = np.zeros(count), np.zeros(count)
    np.maximum.at(width, points.member, forces / local / points.spacing)
    np.maximum.at(peak, points.member, np.where(forces > 0.0, local, 0.0))
    mean = np.divide(force, area, out=np.zeros(count), where=area > 0.0)
    names, touching = robot.member_names, np.flatnonzero(length).tolist()
    wide = touching if points.dents.any() else []

    def named(values: Array, members: Iterable[int] = range(len(names))) -> dict[str, float]:
        return {names[i]: values.item(i) for i in members}

    return {
        'contact_lengths': named(length, touching),
        'contact_spans': {names[i]: tuple(spans[i].tolist()) for i in touching},
        'contact_forces': named(force, touching),
        'contact_widths': named(width, wide),
        'contact_areas': named(area, wide),
        'contact_pressures': named(mean, wide),
        'peak_pressures': named(peak, wide),
        'flattened': tuple(names[i] for i in np.flatnonzero(pressed_flat)),
        'utilisation': named(sections.used),
        'utilisation_places': named(sections.place),
    }
