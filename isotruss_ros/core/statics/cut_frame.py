# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frame with additional nodes at points inside its members."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Flags, Indices
from isotruss_ros.core.statics.beam_column import BeamColumns, COMPLEX_STEP
from isotruss_ros.core.statics.elimination import Scaling
from isotruss_ros.core.statics.frame import Frame
from isotruss_ros.core.statics.frame_pattern import member_places
from isotruss_ros.core.statics.tangent import Tangent
import numpy as np

#: Minimum length of the parts into which cuts divide the members [m]. Loads and contacts nearer to
#: a guide ring act at this distance, by which displacements err by 1e-7. The relative rounding
#: errors of stiffnesses are inversely proportional to it.
SHORTEST_PART = 1e-8


class CutLayout(NamedTuple):
    """
    Connections of the parts of a frame whose k members are divided at c cuts in one order.

    The nodes at the cuts are the last nodes. The first part of a divided member has the member's
    index; the other parts have the last indices.

    :ivar count: number k of members of the uncut frame.
    :ivar piece: (c,) index of the member that each cut divides.
    :ivar order: (c,) indices that sort the cuts by member and along each member.
    :ivar whole: (k + c,) index of the uncut member to which each part belongs.
    :ivar start: (k + c,) indices of the start nodes.
    :ivar end: (k + c,) indices of the end nodes.
    :ivar places: (k + c, 6) indices of the displacements of the parts' ends.
    :ivar pins: two masks (k + c,) of starts and of ends that transmit no moment.
    :ivar before: (c,) indices of the parts that end at the cuts.
    :ivar behind: (c,) indices of the parts that begin at the cuts.
    :ivar members: (q,) indices of the divided members.
    :ivar parts: (c + q,) indices of their parts.
    :ivar ends: (q, 6) indices of the displacements of their end nodes.
    :ivar most: largest number b of cuts of a member.
    :ivar slot: (c,) number of each cut, if the cuts of each member are counted on from a multiple
        of b.
    :ivar local: places of the parts' stiffness in q matrices of the displacements at b cuts and at
        both ends.
    :ivar units: places of diagonal entries of these matrices that belong to no cut.
    """

    count: int  # type: ignore[assignment]
    piece: Indices
    order: Indices
    whole: Indices
    start: Indices
    end: Indices
    places: Indices
    pins: tuple[Flags, Flags]
    before: Indices
    behind: Indices
    members: Indices
    parts: Indices
    ends: Indices
    most: int
    slot: Indices
    local: Indices
    units: Indices

    @classmethod
    def of(cls, frame: Frame, piece: Indices, order: Indices) -> CutLayout:
        """Return the connections of a frame whose members `piece` are divided in an order."""
        count, cuts = len(frame.start), len(piece)
        nodes, behind = len(frame.points) + np.arange(cuts), count + np.arange(cuts)
        members, first = np.unique(piece[order], return_index=True)
        last = np.append(first[1:], cuts) - 1
        whole = np.append(np.arange(count), piece)
        start, end = frame.start[whole], frame.end[whole]
        pins = frame.pins[0][whole], frame.pins[1][whole]
        ahead = behind[order]  # part behind each cut, along the members
        before = np.roll(ahead, 1)
        before[first] = members
        start[ahead] = end[before] = nodes[order]
        end[ahead[last]] = frame.end[members]
        pins[0][ahead] = pins[1][before] = False
        parts = np.append(members, ahead)
        ends = member_places(frame.start[members], frame.end[members])
        # Numbers of nodes: the cuts of a member, then its ends.
        each = np.diff(np.append(first, cuts))
        most, number = int(each.max()), np.arange(len(members))
        slot = np.empty_like(piece)
        slot[order] = np.arange(cuts) + (most * number - first).repeat(each)
        node = np.append(np.full(len(frame.points), -1), slot)
        owner = np.searchsorted(members, whole[parts])
        begins, stops = node[start[parts]], node[end[parts]]
        begins = np.where(begins < 0, most, begins - most * owner)
        stops = np.where(stops < 0, most + 1, stops - most * owner)
        own, width = member_places(begins, stops), 3 * most + 6
        local = own[:, :, None] * width + own[:, None] + width**2 * owner.reshape(-1, 1, 1)
        none = np.setdiff1d(np.arange(most * len(members)), slot)
        none, inner = np.divmod(np.add.outer(3 * none, np.arange(3)), 3 * most)
        found = np.empty_like(piece)
        found[order] = before
        return cls(
            count,
            piece,
            order,
            whole,
            start,
            end,
            member_places(start, end),
            pins,
            found,
            behind,
            members,
            parts,
            ends,
            most,
            slot,
            local.ravel(),
            (none * width**2 + inner * (width + 1)).ravel(),
        )


class CutFrame(Frame):
    """
    Frame whose members are divided at points; its last nodes are at these points.

    :param frame: frame without nodes at these points, called the uncut frame.
    :param piece: (c,) index of the member of the uncut frame that contains each point.
    :param within: (c,) distances of the points from the members' starts [m].
    :param layout: layout of a frame with similar cuts, which is used if it fits; or None.
    """

    def __init__(
        self, frame: Frame, piece: Indices, within: Array, layout: CutLayout | None = None
    ) -> None:
        order = np.lexsort((within, piece))
        if layout is None or not (
            np.array_equal(order, layout.order) and np.array_equal(piece, layout.piece)
        ):
            layout = CutLayout.of(frame, piece, order)
        self.uncut, self.layout, self.whole = frame, layout, layout.whole
        self.names, self.rows, self.spans = frame.names, frame.rows, frame.spans
        places = frame.points[frame.start[piece]] + within * frame.axis[piece]
        self.points = np.append(frame.points, places)
        self.nodes = np.arange(len(frame.points), len(self.points))
        self.start, self.end, self.places = layout.start, layout.end, layout.places
        self.before, self.behind = layout.before, layout.behind
        self.section, self.pins = frame.section[:, self.whole], layout.pins
        self.begins = np.append(np.zeros(layout.count), within)
        # Nodes have rounding errors that would turn and lengthen short parts.
        ends = frame.length[self.whole]
        ends[self.before] = within
        self.axis, self.length = frame.axis[self.whole], ends - self.begins

    @cached_property
    def columns(self) -> BeamColumns:
        """Return the parts as beam-columns; imaginary parts are derivatives by rest lengths."""
        parts = self.layout.parts
        cut = BeamColumns.of(
            self.length[parts] + 1j * COMPLEX_STEP,
            self.section[:, parts],
            (self.pins[0][parts], self.pins[1][parts]),
        )
        found = []
        for whole, part in zip(self.uncut.columns, cut, strict=True):
            values = whole[..., self.whole].astype(complex)
            values[..., parts] = part
            found.append(values)
        return BeamColumns(*found)

    @property
    def held(self) -> Flags:
        """Return the mask (n, 3) of displacements that supports fix; none at cuts."""
        return np.append(self.uncut.held, np.zeros((len(self.nodes), 3), dtype=bool), axis=0)

    @property
    def scaling(self) -> Scaling:
        """Return the numbering and scaling of the uncut frame."""
        return self.uncut.scaling

    @cached_property
    def rest(self) -> Tangent:
        """Return the frame linearised without loads, with the uncut frame's factorisation."""
        return self.tangent(*self.no_loads, given=self.uncut.rest.factored)

    def locate(self, piece: Indices, within: Array) -> tuple[Indices, Array]:
        """
        Return the parts (c,) that contain points, and the distances (c,) from the parts' starts.

        :param piece: (c,) index of the member of the uncut frame at each point.
        :param within: (c,) distances of the points from the members' starts [m].
        """
        order, lengths = self.layout.order, self.uncut.length
        whole, places = self.layout.piece[order], self.begins[self.behind[order]]
        # Keys that increase from member to member, and along each member from 0 to 1.
        keys, wanted = whole + places / lengths[whole], piece + within / lengths[piece]
        last = np.searchsorted(keys, wanted) - 1
        beyond = (last >= 0) & (whole[last] == piece)
        begin = np.where(beyond, places[last], 0.0)
        return np.where(beyond, self.behind[order][last], piece), within - begin


def keep_apart(pieces: Indices, places: Array, length: Array) -> Array:
    """
    Return positions (c,) of cuts [m], shifted so that each part of a member has a minimum length.

    :param pieces: (c,) index of the member of each cut.
    :param places: (c,) distances of the cuts from the members' starts [m].
    :param length: (c,) length of the member of each cut [m].
    """
    apart = np.clip(places, SHORTEST_PART, length - SHORTEST_PART)
    order = np.lexsort((apart, pieces)).tolist()
    pairs = [pair for pair in pairwise(order) if pieces[pair[0]] == pieces[pair[1]]]
    for first, second in pairs:
        apart[second] = max(apart[second], apart[first] + SHORTEST_PART)
    apart = np.minimum(apart, length - SHORTEST_PART)
    for first, second in reversed(pairs):
        apart[first] = min(apart[first], apart[second] - SHORTEST_PART)
    return apart
