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
from isotruss_ros.core.numerics.arrays import Array, Flags
from isotruss_ros.core.statics.bent_tubes import BentTubes
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
    contacts: PressedContacts, state: ContactForces, bent: BentTubes, skins: list[PressedSkin]
) -> ContactPatches:
    """Return the contact patches of an object in equilibrium; `skins` are those of `Dents`."""
    structure = bent.structure
    radius = 0.5 * structure.config.robot.description.tube_diameter
    gauge = np.array(structure.pressures)[structure.config.robot.topology.tube[contacts.members]]
    tension = _wall_tension(state, bent, gauge, radius)
    sides = np.sign(state.loads[:, 1])
    begins, ends = np.full(len(skins), np.inf), np.full(len(skins), -np.inf)
    # Columns: length, area and force of each contact; its largest width and pressure, flatness.
    sums, maxima = np.zeros((2, len(skins), 3))
    for k, skin in enumerate(skins):
        is_pressed = skin.forces > 0.0
        if not is_pressed.any():
            continue
        # Curvature of the object's surface, zero at the ends and where the surface is hollow.
        curvature = np.zeros(len(skin.heights))
        curvature[1:-1] = np.maximum(np.diff(skin.heights, 2) / skin.spacing**2, 0.0)
        # Pressures of a round section, by the equilibrium of its wall. The section is flat if a
        # contact over half of its circumference needs a higher pressure to carry the loads.
        round_pressures = gauge[k] + tension[k] * curvature[is_pressed]
        loads = skin.forces[is_pressed] / skin.spacing
        flat_pressures = loads / (np.pi * radius)
        is_flat = (flat_pressures >= round_pressures).any()
        pressures = np.maximum(round_pressures, flat_pressures)
        widths = loads / pressures
        positions = state.feet[k] - sides[k] * skin.positions[is_pressed]
        begins[k] = positions.min() - 0.5 * skin.spacing
        ends[k] = positions.max() + 0.5 * skin.spacing
        sums[k] = skin.spacing * len(widths), skin.spacing * widths.sum(), skin.forces.sum()
        maxima[k] = widths.max(), pressures.max(), is_flat
    starts = contacts.member_starts
    spans = [np.minimum.reduceat(begins, starts), np.maximum.reduceat(ends, starts)]
    lengths, areas, forces = contacts.sum_by_member(sums).T
    max_widths, peaks, flattened = np.maximum.reduceat(maxima, starts).T
    return ContactPatches(
        np.stack(spans, axis=1), lengths, max_widths, areas, forces / areas, peaks, flattened > 0.0
    )


def _wall_tension(state: ContactForces, bent: BentTubes, gauge: Array, radius: float) -> Array:
    """Return the tension (k,) along the tube in its wall on the object's side [N/m]."""
    # Columns of `FrameState.end_forces`: along, across and moment at the start and at the end.
    end_forces, _ = bent.end_forces(state.loads, state.feet)
    before = end_forces[bent.frame.layout.before]
    behind = end_forces[bent.frame.layout.behind]
    # Bending away from the object's force stretches the wall on the object's side. Friction acts
    # at the skin, so the moment differs before and behind the contact.
    moment = 0.5 * bent.cuts.directions * (before[:, 5] - behind[:, 2])
    compression = np.maximum(-before[:, 3], behind[:, 0])
    bending_pull = 2.0 / radius * moment * np.sign(state.loads[:, 1])
    wall_pull = gauge * np.pi * radius**2 + bending_pull - compression
    return np.maximum(wall_pull / (2.0 * np.pi * radius), 0.0)
