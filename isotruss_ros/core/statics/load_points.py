# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Load points on tubes: members, nodes at the load points, and samples divided alike.

Each load point is a node that divides its member into parts; its place is its distance from the
start of the member.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.numerics.samples import pick
from isotruss_ros.core.statics.frame import keep_apart
from isotruss_ros.core.statics.inclinations import RING_HALF_WIDTH
from isotruss_ros.core.statics.structure import Structure
import numpy as np


class Lines(NamedTuple):
    """Members of k load points: start x + iy [m], unit vector to the end x + iy, length [m]."""

    start: Points
    axis: Points
    length: Array
    turns: Array  #: (k, 3, 3) unit loads and displacements of the member's axes as (fx, fy, m)

    @classmethod
    def of(cls, structure: Structure, members: Indices) -> Lines:
        """Return the members with given indices (k,), from pinch point to pinch point."""
        config, topology = structure.config, structure.config.robot.topology
        start, axis = config.points[..., topology.b[members]], config.member_axes[..., members]
        turns = np.zeros((*axis.shape, 3, 3))
        turns[..., 0, 0] = turns[..., 1, 1] = axis.real
        turns[..., 1, 0], turns[..., 0, 1], turns[..., 2, 2] = axis.imag, -axis.imag, 1.0
        return cls(start, axis, config.member_lengths[..., members], turns)


class Cuts(NamedTuple):
    """Nodes of a frame at k load points, no two of them nearer than the shortest part."""

    pieces: Indices  #: (k,) members of the frame that the nodes divide
    within: Array  #: (k,) distances of the nodes from the starts of these members [m]
    directions: Array  #: (k,) 1 for a piece that runs along its member of the robot, else -1
    places: Array  #: (k,) distances of the nodes from the starts of the robot's members [m]

    @classmethod
    def of(cls, structure: Structure, members: Indices, positions: Array) -> Cuts:
        """Return the nodes at positions (k,) on members (k,) of the robot."""
        pieces, within, directions = structure.locate(members, positions)
        lengths = pick(structure.frame.length, pieces)
        inside = keep_apart(pieces, within, lengths)
        return cls(pieces, inside, directions, positions + directions * (inside - within))


def group_samples(
    structure: Structure, cuts: Cuts, chosen: Flags | None = None
) -> Sequence[Indices | None]:
    """
    Return the chosen samples, or all, in groups with equal layouts of cuts.

    None are all samples, or the only one.
    """
    if cuts.pieces.ndim == 1 or len(cuts.pieces) == 1:
        return [None]
    order = np.lexsort((cuts.within, cuts.pieces), axis=-1)
    rows = np.concatenate([cuts.pieces, order, are_at_rings(structure, cuts)], axis=-1)
    numbers = range(len(rows)) if chosen is None else np.flatnonzero(chosen).tolist()
    groups = defaultdict[bytes, list[int]](list)
    for i in numbers:
        groups[rows[i].tobytes()].append(i)
    return [None if len(group) == len(rows) else np.array(group) for group in groups.values()]


def are_at_rings(structure: Structure, cuts: Cuts) -> Flags:
    """Return whether cuts are at the start and at the end (..., 2k) of their piece."""
    lengths = pick(structure.frame.length, cuts.pieces)
    ends = np.concatenate([cuts.within, lengths - cuts.within], axis=-1)
    return ends < RING_HALF_WIDTH
