# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frame with nodes at loads inside its members."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise

from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.statics.frame import Frame, Tangent
import numpy as np


class CutFrame(Frame):
    """
    Frame with members cut at points, its last nodes.

    The first part of a member has its index; further parts are the last members.

    :param frame: uncut frame.
    :param piece: (c,) indices of the members with points inside.
    :param within: (c,) distances of the points from the members' starts [m].
    """

    def __init__(self, frame: Frame, piece: Indices, within: Array) -> None:
        order = np.lexsort((within, piece))
        cut = frame.pattern.cut(frame.members, frame.held, piece, order)
        axial, flexural, shear = (each[cut.whole] for each in frame.members[2:5])
        points = frame.points[frame.members.start[piece]] + within * frame.axis[piece]
        super().__init__(
            np.append(frame.points, points),
            cut.members._replace(axial=axial, flexural=flexural, shear=shear),
            cut.held,
            frame.names,
            frame.rows,
            frame.pattern,
            rated=True,
        )
        self.nodes, self.before, self.behind = cut.nodes, cut.before, cut.behind
        self.whole, self.chains, self.places = cut.whole, cut.chains, cut.places
        self.begins = np.append(np.zeros(len(frame.length)), within)
        self._frame, self._lengths = frame, frame.length
        self._cut = (piece[order], within[order], cut.behind[order])

    @cached_property
    def rest(self) -> Tangent:
        """
        Return the frame linearised without loads; its factor is that of the uncut frame.

        :raises StructureError: the frame is a mechanism; names the nodes that move.
        """
        tangent = self.straight
        tangent.borrow(self._frame.rest)
        return tangent

    def locate(self, piece: Indices, within: Array) -> tuple[Indices, Array]:
        """
        Return the parts of members at points, and distances (c,) from their starts [m].

        :param piece: (c,) indices of the members of the uncut frame.
        :param within: (c,) distances from their starts [m].
        """
        whole, places, behind = self._cut
        # In order by their member and the share of its length.
        keys, wanted = whole + places / self._lengths[whole], piece + within / self._lengths[piece]
        last = np.searchsorted(keys, wanted) - 1
        beyond = (last >= 0) & (whole[last] == piece)
        begin = np.where(beyond, places[last], 0.0)
        return np.where(beyond, behind[last], piece), within - begin


def keep_apart(pieces: Indices, places: Array, length: Array, shortest: float) -> Array:
    """
    Return places on members that leave no part between them shorter than a length.

    :param pieces: (c,) numbers of the members.
    :param places: (c,) distances from the members' starts [m].
    :param length: (c,) of the members [m].
    :param shortest: length of the shortest part [m].
    """
    apart = np.clip(places, shortest, length - shortest)
    order = np.lexsort((apart, pieces)).tolist()
    pairs = [pair for pair in pairwise(order) if pieces[pair[0]] == pieces[pair[1]]]
    for first, second in pairs:
        apart[second] = max(apart[second], apart[first] + shortest)
    apart = np.minimum(apart, length - shortest)
    for first, second in reversed(pairs):
        apart[first] = min(apart[first], apart[second] - shortest)
    return apart
