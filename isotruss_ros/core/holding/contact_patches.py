# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Contact patches of a held object: lengths, widths, areas and pressures on the skin of the tubes.

The wall of a flattened section is straight across the tube. Along the tube it has the tension T
and follows the object with the curvature k. So the contact pressure is p + T k with the gauge
pressure p, and the width of the contact is the load per length over this pressure. The width is at
most half of the tube's circumference, pi R; then the section is flat, and the pressure is higher.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.contact.pressed_skin import PressedSkin
from isotruss_ros.core.holding.pressed_contacts import ContactForces, PressedContacts
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.numerics.arrays import Array, Flags
from isotruss_ros.core.numerics.samples import column
from isotruss_ros.core.statics.blocks import Layout
import numpy as np


class ContactPatches(NamedTuple):
    """Contact patches on the m grasping members."""

    spans: Array  #: (m, 2) first and last point in contact, from the member's start [m]
    lengths: Array  #: (m,) length of tube in contact [m]
    widths: Array  #: (m,) largest width around the tube [m]
    areas: Array  #: (m,) area of contact [m^2]
    pressures: Array  #: (m,) mean contact pressure [Pa]
    peaks: Array  #: (m,) largest contact pressure [Pa]
    flattened: Flags  #: (m,) whether a section is flat, so that the model of the dents is invalid


def find_patches(
    contacts: PressedContacts,
    state: ContactForces,
    config: Configuration,
    pressures: Array,
    layout: Layout,
    directions: Array,
    end_forces: tuple[Array, Array],
    skins: PressedSkin,
) -> ContactPatches:
    """
    Return the contact patches of an object in equilibrium.

    For `end_forces` see `BentTubes.end_forces`, for `skins` see `Dents.press`.
    """
    radius = 0.5 * config.robot.description.tube_diameter
    gauge = pressures[config.robot.topology.tube[contacts.members]]
    tension = _wall_tension(state, layout, directions, end_forces[0], gauge, radius)
    spacing, is_pressed = column(skins.spacing), skins.forces > 0.0
    # Curvature of the object's surface, zero at the ends and where the surface is hollow.
    curvature = np.zeros(skins.heights.shape)
    curvature[:, 1:-1] = np.maximum(np.diff(skins.heights, 2) / spacing**2, 0.0)
    # Pressures of a round section, by the equilibrium of its wall. The section is flat if a
    # contact over half of its circumference needs a higher pressure to carry the loads.
    round_pressures = gauge[:, None] + tension[:, None] * curvature
    loads = skins.forces / spacing
    flat_pressures = loads / (np.pi * radius)
    pressures = np.maximum(round_pressures, flat_pressures)
    widths = loads / pressures
    positions = state.feet[:, None] - np.sign(state.loads[:, 1:2]) * skins.positions
    begins = np.where(is_pressed, positions, np.inf).min(axis=1) - 0.5 * skins.spacing
    ends = np.where(is_pressed, positions, -np.inf).max(axis=1) + 0.5 * skins.spacing
    # Length, area and force of each contact; its largest width and pressure, and flatness.
    sums = is_pressed.sum(axis=1), widths.sum(axis=1), loads.sum(axis=1)
    peaks = np.where(is_pressed, pressures, 0.0).max(axis=1)
    maxima = widths.max(axis=1), peaks, (flat_pressures >= round_pressures).any(axis=1)
    starts = contacts.member_starts
    spans = [np.minimum.reduceat(begins, starts), np.maximum.reduceat(ends, starts)]
    lengths, areas, forces = contacts.sum_by_member(skins.spacing * np.array(sums), axis=1)
    max_widths, peaks, flattened = np.maximum.reduceat(np.array(maxima), starts, axis=1)
    return ContactPatches(
        np.stack(spans, axis=1), lengths, max_widths, areas, forces / areas, peaks, flattened > 0.0
    )


def _wall_tension(
    state: ContactForces,
    layout: Layout,
    directions: Array,
    end_forces: Array,
    gauge: Array,
    radius: float,
) -> Array:
    """Return the tension (k,) along the tube in its wall on the object's side [N/m]."""
    # Columns of `FrameState.end_forces`: along, across and moment at the start and at the end.
    before = end_forces[layout.before]
    behind = end_forces[layout.behind]
    # Bending away from the object's force stretches the wall on the object's side. Friction acts
    # at the skin, so the moment differs before and behind the contact.
    moment = 0.5 * directions * (before[:, 5] - behind[:, 2])
    compression = np.maximum(-before[:, 3], behind[:, 0])
    bending_pull = 2.0 / radius * moment * np.sign(state.loads[:, 1])
    wall_pull = gauge * np.pi * radius**2 + bending_pull - compression
    return np.maximum(wall_pull / (2.0 * np.pi * radius), 0.0)
