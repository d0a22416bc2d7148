# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frame with additional nodes at points inside its members."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise

from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.statics.frame import Frame
from isotruss_ros.core.statics.frame_pattern import cut_pattern
from isotruss_ros.core.statics.tangent import Tangent
import numpy as np

#: Minimum length of the parts into which cuts divide the members [m]. Loads and contacts nearer to
#: a guide ring act at this distance, by which displacements err by 1e-7. The relative rounding
#: errors of stiffnesses are inversely proportional to it.
SHORTEST_PART = 1e-8


class CutFrame(Frame):
    """
    Frame whose members are divided at points; its last nodes are at these points.

    The first part of a divided member has the member's index; the other parts have the last
    indices.

    :param frame: frame without nodes at these points, called the uncut frame.
    :param piece: (c,) index of the member of the uncut frame that contains each point.
    :param within: (c,) distances of the points from the members' starts [m].
    """

    def __init__(self, frame: Frame, piece: Indices, within: Array) -> None:
        order = np.lexsort((within, piece))
        cut = cut_pattern(frame.pattern, piece.tobytes(), order.tobytes())
        axial, flexural, shear = (each[cut.whole] for each in frame.members[2:5])
        points = frame.points[frame.members.start[piece]] + within * frame.axis[piece]
        super().__init__(
            np.append(frame.points, points),
            cut.members._replace(axial=axial, flexural=flexural, shear=shear),
            cut.held,
            frame.names,
            frame.rows,
            frame.pattern,
        )
        self.nodes, self.before, self.behind = cut.nodes, cut.before, cut.behind
        self.whole, self.chains, self.places = cut.whole, cut.chains, cut.places
        self.begins = np.append(np.zeros(len(frame.length)), within)
        # Nodes have rounding errors that would turn and lengthen short parts.
        ends = frame.length[cut.whole]
        ends[cut.before] = within
        self.axis, self.length = frame.axis[cut.whole], ends - self.begins
        self._frame, self._lengths = frame, frame.length
        self._cut = (piece[order], within[order], cut.behind[order])

    @cached_property
    def rest(self) -> Tangent:
        """
        Return the frame linearised without loads, with the factorisation of the uncut frame.

        :raises StructureError: the frame is a mechanism; the message names the nodes that move.
        """
        tangent = self.straight
        tangent.borrow(self._frame.rest)
        return tangent

    def locate(self, piece: Indices, within: Array) -> tuple[Indices, Array]:
        """
        Return the parts (c,) that contain points, and the distances (c,) from the parts' starts.

        :param piece: (c,) index of the member of the uncut frame at each point.
        :param within: (c,) distances of the points from the members' starts [m].
        """
        whole, places, behind = self._cut
        # Keys that increase from member to member, and along each member from 0 to 1.
        keys, wanted = whole + places / self._lengths[whole], piece + within / self._lengths[piece]
        last = np.searchsorted(keys, wanted) - 1
        beyond = (last >= 0) & (whole[last] == piece)
        begin = np.where(beyond, places[last], 0.0)
        return np.where(beyond, behind[last], piece), within - begin


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
