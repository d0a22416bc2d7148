# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A frame with nodes where loads act inside its members."""

from __future__ import annotations

from itertools import pairwise

from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.statics.frame import Frame
import numpy as np


class CutFrame(Frame):
    """
    A frame with members cut at points, which become its last nodes.

    The members themselves become their first parts; the others are the last members.

    :param frame: to be cut.
    :param piece: (c,) numbers of the members with points inside.
    :param within: (c,) distances of these from the members' starts [m].
    """

    def __init__(self, frame: Frame, piece: Indices, within: Array) -> None:
        order = np.lexsort((within, piece))
        cut = frame._pattern.cut(frame.members, frame._held, piece, order)
        sections = (each[cut.whole] for each in frame.members[2:5])
        members = cut.members._replace(
            **dict(zip(('axial', 'flexural', 'shear'), sections, strict=True))
        )
        points = frame.points[frame.members.start[piece]] + within * frame.axis[piece]
        super().__init__(
            np.append(frame.points, points),
            members,
            cut.held,
            [*frame._names, *map(str, cut.nodes)],
            frame.rows,
            cut.pattern,
            rated=True,
        )
        self.nodes, self.before, self.behind = cut.nodes, cut.before, cut.behind
        self.whole = cut.whole
        self._piece, self._within = piece, within

    def locate(self, piece: Indices, within: Array) -> tuple[Indices, Array]:
        """
        Return the parts of members that points are on, and distances (c,) from their starts [m].

        :param piece: (c,) numbers of the members of the frame that was cut.
        :param within: (c,) distances from their starts [m].
        """
        part, begin = piece.copy(), np.zeros(len(piece))
        for i in np.argsort(self._within).tolist():
            beyond = (piece == self._piece[i]) & (within > self._within[i])
            part[beyond], begin[beyond] = self.behind[i], self._within[i]
        return part, within - begin


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
