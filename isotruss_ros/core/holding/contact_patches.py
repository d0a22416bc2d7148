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
    owners, structure = contacts.owners, bent.structure
    radius = 0.5 * structure.config.robot.description.tube_diameter
    gauge = np.array(structure.pressures)[structure.config.robot.topology.tube[contacts.members]]
    tension, sides = _wall_tension(state, bent, gauge, radius), np.sign(state.loads[:, 1])
    count = int(owners[-1]) + 1
    spans = np.tile([np.inf, -np.inf], (count, 1))
    lengths, forces, areas, widths, peaks = np.zeros((5, count))
    flattened = np.zeros(count, dtype=bool)
    for k, skin in enumerate(skins):
        owner, pressed = owners[k], skin.forces > 0.0
        if not pressed.any():
            continue
        steps = np.diff(skin.heights) / skin.spacing
        turns = np.append(steps, steps[-1]) - np.append(steps[0], steps)
        curvature = np.maximum(turns / skin.spacing, 0.0)  # of the object's surface
        local = gauge[k] + tension[k] * curvature[pressed]
        load = skin.forces[pressed] / skin.spacing
        # The pressure at which a contact over half of the circumference carries the load.
        flat = load / (np.pi * radius)
        flattened[owner] |= bool((flat >= local).any())
        local = np.maximum(local, flat)
        along = state.feet[k] - sides[k] * skin.positions[pressed]
        spans[owner, 0] = min(spans[owner, 0], along.min() - 0.5 * skin.spacing)
        spans[owner, 1] = max(spans[owner, 1], along.max() + 0.5 * skin.spacing)
        lengths[owner] += skin.spacing * np.count_nonzero(pressed)
        forces[owner] += skin.forces.sum()
        areas[owner] += skin.spacing * float((load / local).sum())
        widths[owner] = max(widths[owner], float((load / local).max()))
        peaks[owner] = max(peaks[owner], float(local.max()))
    return ContactPatches(spans, lengths, widths, areas, forces / areas, peaks, flattened)


def _wall_tension(state: ContactForces, bent: BentTubes, gauge: Array, radius: float) -> Array:
    """Return the tension (k,) along the tube in its wall on the object's side [N/m]."""
    ends, _ = bent.end_forces(state.loads, state.feet)
    before, behind = bent.frame.layout.before, bent.frame.layout.behind
    # Bending away from the object's force stretches the wall on the object's side. Friction acts
    # at the skin, so the moment differs before and behind the contact.
    moment = 0.5 * bent.cuts.directions * (ends[before, 5] - ends[behind, 2])
    compression = np.maximum(-ends[before, 3], ends[behind, 0])
    bending = 2.0 / radius * moment * np.sign(state.loads[:, 1])
    pull = gauge * np.pi * radius**2 + bending - compression
    return np.maximum(pull / (2.0 * np.pi * radius), 0.0)
