# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Connections of a frame whose members are divided at points, and the arrays of a frame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.statics.beam_column import BeamColumns
from isotruss_ros.core.statics.elimination import Scaling
from isotruss_ros.core.statics.frame_pattern import member_places, TurnRows
import numpy as np


class CutLayout(NamedTuple):
    """
    Connections of the parts of a frame whose k members are divided at c cuts in one order.

    The nodes at the cuts are the last nodes. The first part of a divided member has the member's
    index; the other parts have the last indices.
    """

    #: number k of members of the uncut frame
    count: int  # type: ignore[assignment]
    key: bytes  #: bytes of `piece` and `order`, by which layouts are compared
    piece: Indices  #: (c,) index of the member that each cut divides
    order: Indices  #: (c,) indices that sort the cuts by member and along each member
    whole: Indices  #: (k + c,) index of the uncut member to which each part belongs
    start: Indices  #: (k + c,) indices of the start nodes
    end: Indices  #: (k + c,) indices of the end nodes
    places: Indices  #: (k + c, 6) indices of the displacements of the parts' ends
    pins: tuple[Flags, Flags]  #: two masks (k + c,) of starts and of ends that transmit no moment
    before: Indices  #: (c,) indices of the parts that end at the cuts
    behind: Indices  #: (c,) indices of the parts that begin at the cuts
    members: Indices  #: (q,) indices of the divided members
    parts: Indices  #: (c + q,) indices of their parts
    ends: Indices  #: (q, 6) indices of the displacements of their end nodes
    #: size w of the stiffness matrix of a divided member: the displacements at its cuts, units if
    #: another member has more cuts, and the displacements of both ends
    width: int
    #: places of the stiffness of `parts` among the entries of these matrices (q, w, w)
    local: Indices
    units: Indices  #: places of the units
    cut: Indices  #: (c, 3) places of the displacements at the cuts among those of all q w
    beside: Indices  #: (2 c,) indices of the parts before, then behind the cuts
    sides: Indices  #: (2 c, 6) places of the displacements of their ends among those of all q w
    signs: Array  #: (2 c,) -1 for parts before, 1 for parts behind the cuts
    sided: Indices  #: (2 c,) index of each of these parts in `parts`
    longer: Array  #: (c + q, c) changes of the lengths of `parts` by unit motions of the cuts [-]

    @classmethod
    def of(cls, frame: FrameArrays, piece: Indices, order: Indices) -> CutLayout:
        """Return the layout of a frame whose members `piece` are cut in a given order."""
        count, nodes, number = len(frame.start), len(frame.points), len(piece)
        whole, behind = np.append(np.arange(count), piece), count + np.arange(number)
        start, end, before = frame.start[whole], frame.end[whole], np.empty_like(piece)
        pins = frame.pins[0][whole], frame.pins[1][whole]
        divided: dict[int, list[int]] = {}  # cuts along each divided member
        for cut in order.tolist():
            divided.setdefault(int(piece[cut]), []).append(cut)
        most, parts, begins, stops, units = max(map(len, divided.values())), [], [], [], []
        width = 3 * most + 6
        for owner, (member, cuts) in enumerate(divided.items()):
            chain, first = [member, *(count + cut for cut in cuts)], (most + 2) * owner
            start[chain[1:]] = end[chain[:-1]] = [nodes + cut for cut in cuts]
            end[chain[-1]], before[cuts] = frame.end[member], chain[:-1]
            pins[0][chain[1:]] = pins[1][chain[:-1]] = False
            # Within a divided member, its cuts are numbered first, then its ends.
            inner = range(first, first + len(cuts))
            begins += [first + most, *inner]
            stops += [*inner, first + most + 1]
            units += [width**2 * owner + (width + 1) * i for i in range(3 * len(cuts), 3 * most)]
            parts += chain
        row, members = member_places(np.array(begins), np.array(stops)), np.array(list(divided))
        index = np.empty(len(whole), dtype=np.intp)
        index[parts] = np.arange(len(parts))
        beside, longer = np.append(before, behind), np.zeros((len(parts), number))
        sided, cuts = index[beside], np.arange(number)
        longer[sided[:number], cuts] = 1.0
        longer[sided[number:], cuts] -= 1.0
        places = member_places(start, end), member_places(frame.start[members], frame.end[members])
        parted = start, end, places[0], pins, before, behind, members, np.array(parts), places[1]
        local = (row[:, :, None] * width + row[:, None] % width).ravel()
        numbered = width, local, np.array(units, dtype=np.intp), row[sided[:number], 3:], beside
        signs, key = np.repeat([-1.0, 1.0], number), piece.tobytes() + order.tobytes()
        sides = row[sided], signs, sided, longer
        return cls(count, key, piece, order, whole, *parted, *numbered, *sides)


class FrameArrays:
    """Arrays of the nodes, members and constraints of a frame."""

    points: Points  #: (n,) nodes x + iy [m]
    start: Indices  #: (k,) indices of the members' start nodes
    end: Indices  #: (k,) indices of the members' end nodes
    section: Array  #: (3, k) EA [N], EI [N m^2] and GA [N] of the members
    pins: tuple[Flags, Flags]  #: two masks (k,) of starts and of ends that transmit no moment
    length: Array  #: (k,) lengths of the members [m]
    axis: Points  #: (k,) unit vectors of the members from start to end, x + iy
    places: Indices  #: (k, 6) indices of the displacements of the members' ends
    #: mask (., 3) of the displacements ux, uy, theta that supports fix; the nodes at cuts are not
    #: in it
    held: Flags
    names: Sequence[str]  #: (n,) names of the nodes for error messages
    rows: TurnRows  #: constraints on rotations, see `TurnRows`
    spans: Points  #: (s,) spans of the constraints without loads, x + iy [m]
    whole: Indices  #: (k,) index of the uncut member of which each member is a part
    begins: Array  #: (k,) distance of each member's start from the start of the uncut member [m]
    nodes: Indices  #: (c,) indices of the nodes at the cuts
    before: Indices  #: (c,) indices of the members that end at the cuts
    behind: Indices  #: (c,) indices of the members that begin at the cuts
    layout: CutLayout | None  #: connections of the parts; None without cuts
    columns: BeamColumns  #: members as beam-columns
    slide: Array  #: (2 c,) 1 / GA of the parts before, then behind the cuts [1/N]

    @property
    def scaling(self) -> Scaling:
        """Return the numbering and scaling of the matrix of (4)."""
        raise NotImplementedError
