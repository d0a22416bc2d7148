# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A frame with nodes where loads act inside its members."""

from __future__ import annotations

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
        cut = frame.pattern.cut(frame.members, piece, order)
        sections = (each[cut.whole] for each in frame.members[2:5])
        super().__init__(
            np.append(frame.points, frame.points[frame.members.start[piece]] + within * frame.axis[piece]),
            cut.members._replace(**dict(zip(('axial', 'flexural', 'shear'), sections, strict=True))),
            np.append(frame.held, np.zeros((len(piece), 3), dtype=bool), axis=0),
            [*frame.names, *map(str, cut.nodes)],
            frame.rows,
            frame.pattern,
            rated=True,
        )
        self.nodes, self.before, self.behind = cut.nodes, cut.before, cut.behind
        self.whole, self.chains, self.places = cut.whole, cut.chains, cut.places
        # Points in order along the members, by their member and the share of its length.
        self._behind, self._within = cut.behind[order], within[order]
        self._whole, self._keys = piece[order], (piece + within / frame.length[piece])[order]
        self._lengths = frame.length
        self.begins = np.append(np.zeros(len(frame.length)), within)

    def locate(self, piece: Indices, within: Array) -> tuple[Indices, Array]:
        """
        Return the parts of members that points are on, and distances (c,) from their starts [m].

        :param piece: (c,) numbers of the members of the frame that was cut.
        :param within: (c,) distances from their starts [m].
        """
        last = np.searchsorted(self._keys, piece + within / self._lengths[piece]) - 1
        beyond = (last >= 0) & (self._whole[last] == piece)
        begin = np.where(beyond, self._within[last], 0.0)
        return np.where(beyond, self._behind[last], piece), within - begin
