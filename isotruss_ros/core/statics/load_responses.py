# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Responses of bent tubes to unit loads and to unit motions of k load points.

If a load point moves along its member, the part before it becomes longer and the part behind it
shorter.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.samples import apply
from isotruss_ros.core.numerics.tolerances import MAX_CONDITION
from isotruss_ros.core.statics.equilibrium import irregular_loads
from isotruss_ros.core.statics.inclinations import InclinationWeights
from isotruss_ros.core.statics.structure import Structure
from isotruss_ros.core.statics.tangent import Slopes, Tangent
import numpy as np


class LoadResponses(NamedTuple):
    """
    Changes of bent tubes by unit loads and by unit motions of k load points along their members.

    The columns are 3k loads, k motions, and a last one for the loads that the linearised state
    lacks for equilibrium.
    """

    unknowns: Array  #: (u, 4k + 1) changes of the frame's unknowns
    #: (k, 4, 4k + 1) changes of the responses, see `BentTubes`; the last column is their value
    at_points: Array


def find_slopes(structure: Structure, tangent: Tangent) -> tuple[InclinationWeights, Slopes]:
    """Return the weights of the inclinations, and the inclinations that they weight."""
    ends = InclinationWeights.of(structure, tangent.frame)
    return ends, tangent.slopes(ends.parts, ends.signs)


def find_responses(
    structure: Structure, tangent: Tangent, turns: Array, loads: Array, length_by_motions: Array
) -> LoadResponses:
    """
    Return the responses about a linearised state under loads (k, 3).

    For `turns` see `Lines`. The lengths of the frame's parts change by `length_by_motions` (p, k)
    for unit motions of the load points.
    """
    frame, layout, count = tangent.frame, tangent.frame.layout, turns.shape[-3]
    motions, points = slice(3 * count, 4 * count), np.arange(count)
    right = _right_sides(tangent, turns, loads, length_by_motions)
    # Straight tubes lack no loads for equilibrium, so the last column is free for a probe.
    is_probed = not layout.kept and not tangent.unknowns.any()
    if is_probed:
        right[..., -1] = irregular_loads(frame)
    try:
        _, unknowns = tangent.solve(right)
    except StructureError:  # as of one of several samples
        unknowns = np.full(right.shape, np.nan)
    if is_probed:
        condition = np.abs(unknowns[..., -1] / frame.scale).max()
        if not condition < MAX_CONDITION:
            _ = structure.unloaded  # raises an error that names the moving parts
        unknowns[..., -1] = 0.0
    # Displacements of the nodes in axes of the members, relative to their places, which move along
    # the members. The nodes are the last ones.
    to_member = turns.swapaxes(-1, -2)
    *lead, size, columns = unknowns.shape
    last_rows = slice(size - 3 * count, None)
    of_nodes = unknowns[..., last_rows, :].reshape(*lead, count, 3, columns)
    at_points = np.empty((*lead, count, 4, columns))
    at_points[..., :3, :] = to_member @ of_nodes
    at_points[..., points, 0, motions.start + points] -= 1.0
    # The last column includes the responses in the linearised state.
    at_points[..., :3, -1] += apply(to_member, tangent.displacements[..., -count:, :])
    at_points[..., 3, :] = at_points[..., 2, :]  # rotations of the sections
    # Inclinations. The length of a part between two load points depends on both.
    ends, slopes = find_slopes(structure, tangent)
    at_ends = unknowns.take(layout.places[ends.parts], axis=-2)
    of_ends = (slopes.by_ends @ at_ends)[..., 0, :]
    rates = slopes.by_forces * tangent.length_rates.take(ends.parts, axis=-2)
    of_ends[..., motions] += rates.sum(axis=-1)[..., None] * length_by_motions[ends.parts]
    of_ends[..., -1] += slopes.values
    at_points[..., 2, :] = ends.weights @ of_ends
    if ends.is_at_ring:
        weight_rates = ends.by_length @ of_ends[..., -1, None]
        at_points[..., 2, motions] += weight_rates * length_by_motions[ends.between]
    return LoadResponses(unknowns, at_points)


def _right_sides(tangent: Tangent, turns: Array, loads: Array, length_by_motions: Array) -> Array:
    """Return the loads (u, 4k + 1) to which the columns of `LoadResponses` respond."""
    parts, count = tangent.frame.layout.parts, turns.shape[-3]
    right = np.zeros((*tangent.unknowns.shape, 4 * count + 1))
    # Unit loads on the nodes at the load points, which are the last ones; from member axes.
    node_rows, load_columns = tangent.frame.layout.unit_loads
    right[..., node_rows, load_columns] = turns
    # Forces of lengthened parts.
    by_motions = length_by_motions[parts, None]
    forces = tangent.length_rates.take(parts, axis=-2)[..., None] * by_motions
    right[..., slice(3 * count, 4 * count)] = -tangent.sum_forces(parts, forces)
    # Loads without equilibrium in the linearised state: unit loads are on the last nodes only.
    right[..., -1] = -tangent.assembled.carried
    on_nodes = right[..., slice(-3 * count, None), -1].reshape(loads.shape)
    on_nodes += apply(turns, loads)
    return right
