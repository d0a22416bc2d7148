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
        """Return the connections of a frame whose members `piece` are divided in an order."""
        count, cuts = len(frame.start), len(piece)
        nodes, behind = len(frame.points) + np.arange(cuts), count + np.arange(cuts)
        members, first = np.unique(piece[order], return_index=True)
        each = np.diff(np.append(first, cuts))
        whole = np.append(np.arange(count), piece)
        start, end = frame.start[whole], frame.end[whole]
        pins = frame.pins[0][whole], frame.pins[1][whole]
        ahead = behind[order]  # part behind each cut, along the members
        before = np.roll(ahead, 1)
        before[first] = members
        start[ahead] = end[before] = nodes[order]
        end[ahead[first + each - 1]] = frame.end[members]
        pins[0][ahead] = pins[1][before] = False
        parts, found = np.append(members, ahead), np.empty_like(piece)
        found[order] = before
        beside = np.append(found, behind)
        # Within a divided member, its cuts are numbered first, then its ends.
        most, width = int(each.max()), 3 * int(each.max()) + 6
        number = np.full(len(frame.points) + cuts, -1)
        number[nodes[order]] = np.arange(cuts) - first.repeat(each)
        begins, stops = number[start], number[end]
        begins, stops = np.where(begins < 0, most, begins), np.where(stops < 0, most + 1, stops)
        own = member_places(begins, stops)
        row = own + width * np.searchsorted(members, whole).reshape(-1, 1)
        matrix, unit = np.divmod(np.flatnonzero(np.arange(most) >= each[:, None]), most)
        unit = (3 * unit + np.arange(3)[:, None]) * (width + 1) + width**2 * matrix
        both = member_places(start, end), member_places(frame.start[members], frame.end[members])
        parted = start, end, both[0], pins, found, behind, members, parts, both[1]
        local = (row[parts, :, None] * width + own[parts, None]).ravel(), unit.ravel()
        longer = (parts[:, None] == found).astype(float) - (parts[:, None] == behind)
        sided = (beside[:, None] == parts).argmax(axis=1)
        sides = row[found, 3:], beside, row[beside], np.repeat([-1.0, 1.0], cuts), sided, longer
        key = piece.tobytes() + order.tobytes()
        return cls(count, key, piece, order, whole, *parted, width, *local, *sides)


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
