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
    tension, sides = _wall_tension(state, bent, gauge, radius), np.sign(state.loads[:, 1])
    # Values of each contact, which are added or compared for each member.
    begins, ends = np.full(len(skins), np.inf), np.full(len(skins), -np.inf)
    sums, maxima = np.zeros((2, len(skins), 3))
    for k, skin in enumerate(skins):
        is_pressed = skin.forces > 0.0
        if not is_pressed.any():
            continue
        slopes = np.diff(skin.heights) / skin.spacing
        bends = np.append(slopes, slopes[-1]) - np.append(slopes[0], slopes)
        curvature = np.maximum(bends / skin.spacing, 0.0)  # of the object's surface
        pressure = gauge[k] + tension[k] * curvature[is_pressed]
        load = skin.forces[is_pressed] / skin.spacing
        # The pressure at which a contact over half of the circumference carries the load.
        flat_pressure = load / (np.pi * radius)
        is_flat = (flat_pressure >= pressure).any()
        pressure = np.maximum(pressure, flat_pressure)
        around = load / pressure
        along = state.feet[k] - sides[k] * skin.positions[is_pressed]
        begins[k] = along.min() - 0.5 * skin.spacing
        ends[k] = along.max() + 0.5 * skin.spacing
        sums[k] = skin.spacing * len(along), skin.spacing * around.sum(), skin.forces.sum()
        maxima[k] = around.max(), pressure.max(), is_flat
    starts = contacts.member_starts
    spans = [np.minimum.reduceat(begins, starts), np.maximum.reduceat(ends, starts)]
    lengths, areas, forces = contacts.sum_by_member(sums).T
    widths, peaks, flattened = np.maximum.reduceat(maxima, starts).T
    return ContactPatches(
        np.stack(spans, axis=1), lengths, widths, areas, forces / areas, peaks, flattened > 0.0
    )


def _wall_tension(state: ContactForces, bent: BentTubes, gauge: Array, radius: float) -> Array:
    """Return the tension (k,) along the tube in its wall on the object's side [N/m]."""
    end_forces, _ = bent.end_forces(state.loads, state.feet)
    before = end_forces[bent.frame.layout.before]
    behind = end_forces[bent.frame.layout.behind]
    # Bending away from the object's force stretches the wall on the object's side. Friction acts
    # at the skin, so the moment differs before and behind the contact.
    moment = 0.5 * bent.cuts.directions * (before[:, 5] - behind[:, 2])
    compression = np.maximum(-before[:, 3], behind[:, 0])
    bending = 2.0 / radius * moment * np.sign(state.loads[:, 1])
    pull = gauge * np.pi * radius**2 + bending - compression
    return np.maximum(pull / (2.0 * np.pi * radius), 0.0)
