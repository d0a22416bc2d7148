# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Derivatives of the bent tubes of one sample by loads, load points, and sections."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.statics.bent_tubes import BentTubes
from isotruss_ros.core.statics.load_responses import find_slopes
import numpy as np


class TubeRates(NamedTuple):
    """Derivatives of the tubes' displacements and forces with respect to p parameters."""

    #: (n, 3, p) of the displacements of the frame's nodes [m, rad]; zero inside of kept tubes
    nodes: Array
    inclinations: Array  #: (k, p) of the bent centre lines at the load points [rad]
    forces: Array  #: (c, 3, p) of the `EndForces` of the frame's parts with fixed nodes


def find_load_changes(bent: BentTubes, loads: Array, motions: Array) -> TubeRates:
    """Return the tubes' changes by p changes of loads (k, 3, p) and of positions (k, p)."""
    factors = np.concatenate([loads.reshape(-1, loads.shape[2]), motions])
    nodes = bent.tangent.frame.motions(bent.responses.unknowns[:, :-1] @ factors)
    inclinations = bent.at_points[:, 2, :-1] @ factors
    lengths = (bent.length_by_motions @ motions)[:, None]
    return TubeRates(nodes, inclinations, bent.tangent.length_rates[..., None] * lengths)


def find_section_changes(bent: BentTubes, changes: Array, nodes: Points) -> TubeRates:
    """
    Return the tubes' changes by p changes of sections (4, c, p) of the frame's parts.

    The nodes of the undeformed robot move by `nodes` (n, p), x + iy. Tubes that are kept
    undeformed move alike, in axes that turn with them.
    """
    frame, tangent = bent.tangent.frame, bent.tangent
    ends, slopes = find_slopes(bent.structure, tangent)
    # Forces of the changed parts between fixed nodes, then the unknowns in equilibrium.
    parts = np.flatnonzero(changes.any(axis=(0, 2)))
    forces = np.zeros((len(frame.length), 3, changes.shape[2]))
    forces[parts] = tangent.force_rates(parts) @ changes[:, parts].swapaxes(0, 1)
    right = -tangent.sum_forces(parts, forces[parts])
    for blocks, _, stiffness in zip(*tangent.kept, strict=True):
        hinges = nodes[(blocks.outer[:, ::2] - frame.layout.numbering.rows) // 3]
        moved = blocks.turn_motions(tangent.unknowns, hinges)
        np.add.at(right, blocks.outer, stiffness @ moved)
    _, unknowns = tangent.solve(right)
    at_ends = unknowns[frame.layout.places[ends.parts]]
    by_bending = slopes.by_forces[:, None] @ forces[ends.parts] + slopes.by_ends @ at_ends
    by_shear = (slopes.by_shear / frame.section[2, ends.parts])[:, None]
    inclinations = ends.weights @ (by_bending[:, 0] + by_shear * changes[3, ends.parts])
    # A guide ring moves toward or away from a load point.
    by_length = (ends.by_length @ slopes.values)[:, None]
    inclinations += by_length * changes[0, ends.between]
    return TubeRates(frame.motions(unknowns), inclinations, forces)
