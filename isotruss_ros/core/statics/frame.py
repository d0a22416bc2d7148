# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plane frames of beam-columns, each fixed to a node or pinned at its start, with constraints."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.tolerances import EPSILON
from isotruss_ros.core.statics.beam_column import BeamColumns
from isotruss_ros.core.statics.blocks import lay_out, Layout, Numbering
import numpy as np

#: Minimum length of the parts into which cuts divide the members [m]. Loads and contacts nearer to
#: a guide ring act at this distance, by which displacements err by 1e-7. The relative rounding
#: errors of stiffnesses are inversely proportional to it.
SHORTEST_PART = 1e-8


@dataclass(frozen=True, eq=False)
class Frame:
    """Plane frame of beam-columns: p parts of members between n nodes, the last c at cuts."""

    points: Points  #: (n,) nodes x + iy [m]
    layout: Layout  #: connections of the parts
    #: (3, p) EA [N], EI [N m^2] and GA [N] of the parts; GA is infinite without shear deformation
    section: Array
    length: Array  #: (p,) lengths [m]
    axis: Points  #: (p,) unit vectors from start to end, x + iy
    begins: Array  #: (p,) distances of the parts' starts from the starts of their members [m]
    columns: BeamColumns  #: the parts; imaginary parts are derivatives by their lengths
    scale: Array  #: (u,) scale of each unknown, by which stiffnesses are about 1
    uncut: Frame | None = None  #: frame without cuts; None: this frame

    @classmethod
    def of(cls, points: Points, section: Array, numbering: Numbering) -> Frame:
        """Return a frame without cuts, with nodes (n,) and members of given sections (3, k)."""
        start, end, rows = numbering.start, numbering.end, numbering.constraints
        span = points[end] - points[start]
        length = np.abs(span)
        columns = BeamColumns.of(length, section, numbering.pinned)
        # Displacements along both axes have one scale: across a bar the stiffness is zero.
        turning = 0.25 * (columns.values[2] + columns.values[4])
        along, turn = (
            sum(np.bincount(ends, stiff, len(points)) for ends in (start, end))
            for stiff in (1.0 / columns.values[1], turning)
        )
        stiff = np.stack([along, along, turn], axis=1).ravel()
        scale = 1.0 / np.sqrt(np.where(stiff > 0.0, stiff, 1.0))
        count, none = numbering.rows, np.zeros((len(points), 3))
        slopes, _, _ = rows.linearize(points, none, np.zeros(count), np.arange(count))
        norms = np.linalg.norm(slopes * scale[rows.places], axis=1)
        scale = np.append(1.0 / np.where(norms > 0.0, norms, 1.0), scale)
        arrays = length, span / length, np.zeros(len(length)), columns, scale
        return cls(points, numbering.whole, section, *arrays)

    def cut(self, piece: Indices, within: Array, active: Indices | None = None) -> Frame:
        """Return the parts of `active` blocks, or of all, with nodes in members `piece` (c,)."""
        numbering, active = self.layout.numbering, self.layout.active if active is None else active
        order = np.lexsort((within, piece))
        layout = lay_out(numbering, piece.tobytes(), order.tobytes(), active.tobytes())
        start = numbering.start[piece]
        points = np.append(self.points, self.points[start] + within * self.axis[piece])
        begins = np.append(np.zeros(len(layout.whole) - len(piece)), within)
        # Nodes have rounding errors that would turn and lengthen short parts.
        length = self.length[layout.whole]
        length[layout.before] = within
        length -= begins
        section = self.section[:, layout.whole]
        parts, values = layout.parts, self.columns.values[:, layout.whole].astype(complex)
        varied = length[parts] + 1j * EPSILON
        columns = BeamColumns.of(varied, section[:, parts], layout.pinned[parts])
        values[:, parts] = columns.values
        scale = np.append(
            self.scale, self.scale[numbering.rows + 3 * start[:, None] + np.arange(3)]
        )
        arrays = length, self.axis[layout.whole], begins, BeamColumns(values), scale, self
        return Frame(points, layout, section, *arrays)

    def displacements(self, unknowns: Array) -> Array:
        """Return ux, uy and theta of the nodes, (n, 3, ...), among unknowns (u, ...)."""
        rows = self.layout.numbering.rows
        return unknowns[rows:].reshape(-1, 3, *unknowns.shape[1:])

    def locate(self, piece: Indices, within: Array) -> Indices:
        """Return the index (q,) of the part at each point; -1 if its member has no parts."""
        reached = (self.layout.whole == piece[:, None]) & (self.begins <= within[:, None])
        part = np.where(reached, self.begins, -1.0).argmax(axis=1)
        return np.where(reached.any(axis=1), part, -1)

    def interpolate(self, displacements: Array, piece: Indices, within: Array) -> Array:
        """Return the displacements (q, 3) of points inside members, with cubic centre lines."""
        uncut, part = self.uncut, self.locate(piece, within)

        def at(of_parts: Array, of_members: Array) -> Array:
            return np.where(part < 0, of_members[..., piece], of_parts[..., part])

        layout, straight = self.layout, uncut.layout
        begin, end = at(layout.start, straight.start), at(layout.end, straight.end)
        pinned, section = at(layout.pinned, straight.pinned), at(self.section, uncut.section)
        length, inside = at(self.length, uncut.length), within - at(self.begins, uncut.begins)
        start, end, axis = displacements[begin], displacements[end], uncut.axis[piece]
        first = (start[:, 0] + 1j * start[:, 1]) * axis.conj()
        apart = (end[:, 0] + 1j * end[:, 1]) * axis.conj() - first
        chord = length + apart
        turned, x = np.angle(chord), inside / length
        before, after = start[:, 2] - turned, end[:, 2] - turned
        skew = 12.0 * section[1] / section[2] / length**2
        # The moment at a pinned start is zero.
        before = np.where(pinned, (skew - 2.0) / (skew + 4.0) * after, before)
        even, odd = before + after, before - after
        bow = 0.5 * x * (1.0 - x) * (odd + (1.0 - 2.0 * x) / (1.0 + skew) * even)
        slope = 0.5 * ((1.0 - 2.0 * x) * odd + (1.0 - 6.0 * x * (1.0 - x) / (1.0 + skew)) * even)
        moved = axis * (first + x * apart + 1j * bow * chord)
        return np.stack([moved.real, moved.imag, turned + slope], axis=1)


def keep_apart(pieces: Indices, positions: Array, length: Array) -> Array:
    """Return positions (c,) of cuts [m], shifted so that no part of a member is too short."""
    apart, ends, piece_of = positions.tolist(), length.tolist(), pieces.tolist()
    for piece in set(piece_of):
        cuts, nearest = [i for i, at in enumerate(piece_of) if at == piece], 0.0
        cuts.sort(key=apart.__getitem__)
        for behind, i in zip(range(len(cuts), 0, -1), cuts, strict=True):
            farthest = ends[i] - behind * SHORTEST_PART
            nearest = apart[i] = max(nearest + SHORTEST_PART, min(apart[i], farthest))
    return np.array(apart)
