# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frame with additional nodes at points inside its members."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise

from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.tolerances import EPSILON
from isotruss_ros.core.statics.beam_column import BeamColumns
from isotruss_ros.core.statics.cut_layout import CutLayout, FrameArrays
from isotruss_ros.core.statics.elimination import Scaling
from isotruss_ros.core.statics.frame import Frame
from isotruss_ros.core.statics.tangent import Tangent
import numpy as np

#: Minimum length of the parts into which cuts divide the members [m]. Loads and contacts nearer to
#: a guide ring act at this distance, by which displacements err by 1e-7. The relative rounding
#: errors of stiffnesses are inversely proportional to it.
SHORTEST_PART = 1e-8


class CutFrame(Frame):
    """
    Frame whose members are divided at points; its last nodes are at these points.

    :param frame: frame without nodes at these points, called the uncut frame.
    :param piece: (c,) index of the member of the uncut frame that contains each point.
    :param within: (c,) distances of the points from the members' starts [m].
    :param like: frame with cuts of the same members, whose scaling is used, and whose layout if it
        fits; or None.
    """

    def __init__(
        self, frame: Frame, piece: Indices, within: Array, like: FrameArrays | None = None
    ) -> None:
        order = np.lexsort((within, piece))
        layout = None if like is None else like.layout
        if layout is None or layout.key != piece.tobytes() + order.tobytes():
            layout = CutLayout.of(frame, piece, order)
        self.uncut, self.layout, self.whole = frame, layout, layout.whole
        self._scaling = None if like is None else like.scaling
        self.names, self.held = frame.names, frame.held
        self.rows, self.spans = frame.rows, frame.spans
        places = frame.points[frame.start[piece]] + within * frame.axis[piece]
        self.points = np.concatenate([frame.points, places])
        self.nodes = np.arange(len(frame.points), len(self.points))
        self.start, self.end, self.places = layout.start, layout.end, layout.places
        self.before, self.behind = layout.before, layout.behind
        self.section, self.pins = frame.section[:, self.whole], layout.pins
        self.begins = np.concatenate([frame.begins, within])
        # Nodes have rounding errors that would turn and lengthen short parts.
        ends = frame.length[self.whole]
        ends[self.before] = within
        self.axis, self.length = frame.axis[self.whole], ends - self.begins
        # Imaginary parts are derivatives by the rest lengths.
        parts = layout.parts
        cut = BeamColumns.of(
            self.length[parts] + 1j * EPSILON,
            self.section[:, parts],
            (self.pins[0][parts], self.pins[1][parts]),
        )
        values = frame.columns.values[:, self.whole].astype(complex)
        values[:, parts] = cut.values
        self.columns = BeamColumns(values)
        self.slide = 1.0 / self.section[2, layout.beside]

    @property
    def scaling(self) -> Scaling:
        """Return the numbering and scaling of the uncut frame, or those of a similar frame."""
        return self._scaling or self.uncut.scaling

    @cached_property
    def rest(self) -> Tangent:
        """Return the frame linearised without loads, with the uncut frame's factorisation."""
        return self.tangent(*self.no_loads, given=self.uncut.rest.factored)

    def locate(self, piece: Indices, within: Array) -> tuple[Indices, Array]:
        """Return the parts (c,) that contain points, and the distances from the parts' starts."""
        order, lengths = self.layout.order, self.uncut.length
        whole, places = self.layout.piece[order], self.begins[self.behind[order]]
        # Keys that increase from member to member, and along each member from 0 to 1.
        keys, wanted = whole + places / lengths[whole], piece + within / lengths[piece]
        last = np.searchsorted(keys, wanted) - 1
        beyond = (last >= 0) & (whole[last] == piece)
        begin = np.where(beyond, places[last], 0.0)
        return np.where(beyond, self.behind[order][last], piece), within - begin


def keep_apart(pieces: Indices, places: Array, length: Array) -> Array:
    """Return positions (c,) of cuts [m], shifted so that no part of a member is too short."""
    ends = length.tolist()
    apart = [
        max(SHORTEST_PART, min(place, end - SHORTEST_PART))
        for place, end in zip(places.tolist(), ends, strict=True)
    ]
    order = sorted(range(len(ends)), key=lambda i: (pieces[i], apart[i]))
    pairs = [pair for pair in pairwise(order) if pieces[pair[0]] == pieces[pair[1]]]
    for first, second in pairs:
        apart[second] = max(apart[second], apart[first] + SHORTEST_PART)
    for first, second in reversed(pairs):
        apart[second] = min(apart[second], ends[second] - SHORTEST_PART)
        apart[first] = min(apart[first], apart[second] - SHORTEST_PART)
    return np.array(apart)
