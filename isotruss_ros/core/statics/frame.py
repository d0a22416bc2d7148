# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plane frames of beam-columns, each fixed to a node or pinned at its start, with constraints."""

from __future__ import annotations

from dataclasses import dataclass
import functools
from typing import ClassVar

from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.samples import pick, sum_at
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
    """
    Plane frame of beam-columns: p parts of members between n nodes, the last c at cuts.

    Of several samples with one layout, all arrays have the samples as their first axis.
    """

    shared: ClassVar[tuple[str, ...]] = ('layout',)
    points: Points  #: (n,) nodes x + iy [m]
    layout: Layout  #: connections of the parts
    #: (3, p) EA [N], EI [N m^2] and GA [N] of the parts; GA is infinite without shear deformation
    section: Array
    length: Array  #: (p,) lengths [m]
    axis: Points  #: (p,) unit vectors from start to end, x + iy
    begins: Array  #: (p,) distances of the parts' starts from the starts of their members [m]
    columns: BeamColumns  #: the parts; imaginary parts are derivatives by their lengths
    uncut: Frame | None = None  #: frame without cuts; None: this frame

    @classmethod
    def of(cls, points: Points, section: Array, numbering: Numbering) -> Frame:
        """Return a frame without cuts, with nodes (n,) and members of given sections (3, k)."""
        start, end = numbering.start, numbering.end
        span = points.take(end, axis=-1) - points.take(start, axis=-1)
        length = np.abs(span)
        columns = BeamColumns.of(length, section, numbering.pinned)
        begins = np.zeros(length.shape)
        return cls(points, numbering.whole, section, length, span / length, begins, columns)

    @functools.cached_property
    def scale(self) -> Array:
        """Return scales (u,) of the unknowns, by which stiffnesses are about 1."""
        if self.uncut is not None:
            return self.uncut.scale.take(self.layout.scaled_as, axis=-1)
        numbering, count = self.layout.numbering, self.points.shape[-1]
        start, end = numbering.start, numbering.end
        # Sums of the members' stiffnesses at each node: EA / l, and by the rotation of one end. It
        # changes s and b by a half each, so a quarter of their stiffnesses counts. Displacements
        # along both axes have one scale, because across a bar the stiffness is zero.
        axial = 1.0 / self.columns.values[..., 1, :]
        rotary = 0.25 * (self.columns.values[..., 2, :] + self.columns.values[..., 4, :])
        along = sum_at(start, axial, count) + sum_at(end, axial, count)
        turning = sum_at(start, rotary, count) + sum_at(end, rotary, count)
        stiffness = np.stack([along, along, turning], axis=-1).reshape(*self.points.shape[:-1], -1)
        scale = 1.0 / np.sqrt(np.where(stiffness > 0.0, stiffness, 1.0))
        # The multipliers are scaled so that the derivatives of each constraint have the norm 1.
        constraints = numbering.constraints
        slopes = constraints.slopes(self.points, np.arange(numbering.rows))
        norms = np.linalg.norm(slopes * scale[..., constraints.places], axis=-1)
        row_scale = 1.0 / np.where(norms > 0.0, norms, 1.0)
        return np.concatenate([row_scale, scale], axis=-1)

    def cut(self, piece: Indices, within: Array, active: Indices | None = None) -> Frame:
        """Return the parts of `active` blocks, or of all, with nodes in members `piece` (c,)."""
        numbering = self.layout.numbering
        active = self.layout.active if active is None else active
        # All samples have the same order of the cuts.
        order = np.lexsort((within.reshape(-1, len(piece))[0], piece))
        layout = lay_out(numbering, piece.tobytes(), order.tobytes(), active.tobytes())
        whole, starts = layout.whole, self.points.take(numbering.start[piece], axis=-1)
        at_cuts = starts + within * self.axis.take(piece, axis=-1)
        points = np.concatenate([self.points, at_cuts], axis=-1)
        begins = np.zeros((*within.shape[:-1], len(whole)))
        begins[..., layout.behind] = within
        # From the distances in the members: the nodes have rounding errors, which would turn and
        # lengthen short parts.
        ends = self.length.take(whole, axis=-1)
        ends[..., layout.before] = within
        length = ends - begins
        section, divided = self.section.take(whole, axis=-1), layout.parts
        values = self.columns.values.take(whole, axis=-1).astype(complex)
        values[..., divided] = BeamColumns.of(
            length.take(divided, axis=-1) + 1j * EPSILON,
            section.take(divided, axis=-1),
            layout.pinned[divided],
        ).values
        columns, axis = BeamColumns(values), self.axis.take(whole, axis=-1)
        return Frame(points, layout, section, length, axis, begins, columns, self)

    def displacements(self, unknowns: Array) -> Array:
        """Return ux, uy and theta of the nodes, (..., n, 3), among unknowns (..., u)."""
        of_nodes = unknowns[..., slice(self.layout.numbering.rows, None)]
        return of_nodes.reshape(*of_nodes.shape[:-1], -1, 3)

    def motions(self, changes: Array) -> Array:
        """Return the nodes' displacements (..., n, 3, c) in c changes (..., u, c) of unknowns."""
        of_nodes = changes[..., slice(self.layout.numbering.rows, None), :]
        *lead, _, columns = of_nodes.shape
        return of_nodes.reshape(*lead, -1, 3, columns)

    def locate(self, piece: Indices, within: Array) -> Indices:
        """Return the index (..., q) of the part at each point; -1 if its member has no parts."""
        begins = self.begins[..., None, :]
        reached = (self.layout.whole == piece[..., None]) & (begins <= within[..., None])
        part = np.where(reached, begins, -1.0).argmax(axis=-1)
        return np.where(reached.any(axis=-1), part, -1)

    def interpolate(self, displacements: Array, piece: Indices, within: Array) -> Array:
        """Return the displacements (..., q, 3) of points in members, with cubic centre lines."""
        layout, uncut, part = self.layout, self.uncut, self.locate(piece, within)
        # Indices among the parts and then the members, for the members that have no parts.
        index = np.where(part < 0, len(layout.whole) + piece, part)

        def of_parts(values: Array, of_members: Array) -> Array:
            """Return values (..., q) of the parts or members, among those of all."""
            return pick(np.concatenate([values, of_members], axis=-1), index)

        start, end = (
            np.take_along_axis(displacements, np.append(*nodes)[index][..., None], -2)
            for nodes in ((layout.start, uncut.layout.start), (layout.end, uncut.layout.end))
        )
        pinned = np.append(layout.pinned, uncut.layout.pinned)[index]
        length = of_parts(self.length, uncut.length)
        flexural = of_parts(self.section[..., 1, :], uncut.section[..., 1, :])
        shear = of_parts(self.section[..., 2, :], uncut.section[..., 2, :])
        # Position in the part, from 0 to 1.
        x = (within - of_parts(self.begins, uncut.begins)) / length
        # Displacements of the ends along + i across the undeformed member, and the chord.
        axis = pick(uncut.axis, np.broadcast_to(piece, index.shape))
        start_shift = (start[..., 0] + 1j * start[..., 1]) * axis.conj()
        difference = (end[..., 0] + 1j * end[..., 1]) * axis.conj() - start_shift
        chord = length + difference
        rotation = np.angle(chord)
        # Slopes relative to the chord. The moment at a pinned start is zero.
        end_slope = end[..., 2] - rotation
        phi = 12.0 * flexural / shear / length**2
        pinned_slope = (phi - 2.0) / (phi + 4.0) * end_slope
        start_slope = np.where(pinned, pinned_slope, start[..., 2] - rotation)
        sway, bow = start_slope + end_slope, start_slope - end_slope
        height = 0.5 * x * (1.0 - x) * (bow + (1.0 - 2.0 * x) / (1.0 + phi) * sway)
        sway_slope = 1.0 - 6.0 * x * (1.0 - x) / (1.0 + phi)
        slope = 0.5 * ((1.0 - 2.0 * x) * bow + sway_slope * sway)
        moved = axis * (start_shift + x * difference + 1j * height * chord)
        return np.stack([moved.real, moved.imag, rotation + slope], axis=-1)


def largest_motion(displacements: Array) -> Array:
    """Return the largest component of the nodes' translations, from displacements (..., n, 3)."""
    return np.abs(displacements[..., :2]).max(axis=(-2, -1))


def keep_apart(pieces: Indices, positions: Array, length: Array) -> Array:
    """Return positions (..., c) of cuts [m], shifted so that no part is too short."""
    # A cut is near itself. If none is near another one or an end, none is shifted.
    are_near = np.abs(positions[..., None] - positions[..., None, :]) < SHORTEST_PART
    are_near &= pieces[..., None] == pieces[..., None, :]
    to_ends = np.minimum(positions, length - positions)
    if np.count_nonzero(are_near) == positions.size and (to_ends >= SHORTEST_PART).all():
        return positions
    if positions.ndim > 1:
        return np.array(list(map(keep_apart, pieces, positions, length)))
    shifted, lengths, piece_of = positions.tolist(), length.tolist(), pieces.tolist()
    for piece in set(piece_of):
        cuts = [i for i, other in enumerate(piece_of) if other == piece]
        previous = 0.0
        for number, i in enumerate(sorted(cuts, key=shifted.__getitem__)):
            farthest = lengths[i] - (len(cuts) - number) * SHORTEST_PART
            previous = max(previous + SHORTEST_PART, min(shifted[i], farthest))
            shifted[i] = previous
    return np.array(shifted)
