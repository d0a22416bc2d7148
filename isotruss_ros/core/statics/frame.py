# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames of beam-columns, with their nodes, members and cuts."""

from __future__ import annotations

from dataclasses import dataclass
import functools
from typing import ClassVar, NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.numerics.samples import pick, sum_at
from isotruss_ros.core.numerics.tolerances import EPSILON
from isotruss_ros.core.statics.blocks import lay_out, Layout, Numbering
import numpy as np

# Planar beam-columns: the stiffness (2) of a straight member, with terms in the axial force.
#
# A member has the chord length l, the rest length l0, and end rotations t1 = s + b and t2 = s - b
# relative to the chord: the rotation s bends it to an S, and b to a bow. Its axial force N is the
# value at which the energy U is stationary,
#
#     U = N (l - l0) - N^2 l0 / (2 EA) + Ks s^2 + Ka b^2,
#     Ks = 6 EI / l0 / (1 + phi - y/15 + 2 y^2/315),   Ka = 2 EI / l0 (1 + y/3 - y^2/45),
#     phi = 12 EI / (GA l0^2),   y = N l0^2 / (4 EI (1 + N/GA)):
#
# the stability functions of a Timoshenko beam (Przemieniecki, Theory of Matrix Structural
# Analysis, chapter 15), expanded to N^2. For N = 0 this is (2). The terms in N describe that
# bending shortens the chord, and that tension stiffens the member as in a string. The rotation of
# a pinned start is eliminated by static condensation. In a short member Ks is much smaller than
# Ka, so their sum and difference, the stiffness with respect to t1 and t2, would lose Ks by
# rounding.


class EndForces(NamedTuple):
    """Forces of k bent members, and the derivatives of these forces with respect to (l, s, b)."""

    #: (k, 3) axial force N [N], and sum M1 + M2 and difference M1 - M2 of the moments at start and
    #: end [N m]
    values: Array
    stiffness: Array  #: (k, 3, 3) derivatives of `values` with respect to (l, s, b)
    #: (k, 3) `values` before the step of Newton's method that makes the energy stationary in N;
    #: from these values the geometric stiffness is computed
    stressed: Array


class BeamColumns(NamedTuple):
    """Members that bend under loads and are straight without loads; complex for complex steps."""

    #: (11, k) rest lengths l0 [m]; axial compliances l0 / EA [m/N]; and derivatives of (M1 + M2,
    #: M1 - M2) with respect to (s, b): those of the sum by s and by b, and that of the difference
    #: by b, first their constant terms, then their factors of N and of N^2
    values: Array

    @classmethod
    def of(cls, length: Array, section: Array, pinned: Flags) -> BeamColumns:
        """Return members (k,) of given rest lengths and sections; `pinned` at the start or not."""
        # Of n samples, lengths are (n, k), sections (n, 3, k) and values (n, 11, k).
        axial, flexural, shear = section.swapaxes(0, -2)
        shear_compliance = 1.0 / shear
        bend_compliance = 0.25 * length * length / flexural
        values = np.zeros((11, *length.shape), dtype=length.dtype)
        values[0], values[1] = length, length / axial
        # Derivatives 2 Ks of the sum by s, of the sum by b, and 2 Ka of the difference by b: their
        # coefficients of 1, N and N^2, see this module.
        sway, coupling, bow = values[2::3], values[3::3], values[4::3]
        bow[0] = length / bend_compliance  # 4 EI / l0
        bow[1] = length / 3.0
        bow[2] = length * (shear_compliance / -3.0 - bend_compliance / 45.0)
        share = bend_compliance / (bend_compliance + 3.0 * shear_compliance)  # 1 / (1 + phi)
        sway[0] = 3.0 * bow[0] * share
        sway[1] = 0.2 * (length * share * share)
        by_bending = bend_compliance * (0.04 / 3.0 * share - 2.0 / 105.0)
        sway[2] = length * share * share * (by_bending - 0.2 * shear_compliance)
        if pinned.any():  # the rotation of a pinned start is eliminated
            one_pin = _reciprocal(_reciprocal(sway) + _reciprocal(bow))
            coupling[:] = np.where(pinned, -one_pin, 0.0)
            sway[:], bow[:] = np.where(pinned, one_pin, sway), np.where(pinned, one_pin, bow)
        return cls(values.swapaxes(0, -2))

    def evaluate(
        self, elongation: Array, rotations: Array, axial: Array | None = None
    ) -> EndForces:
        """Return the end forces of bent members, by a Newton step from `axial` forces (k,)."""
        # Axes: power of N; sum by s, coupling, difference by b; member.
        values, rotations = self.values.swapaxes(0, -2), rotations.swapaxes(0, -2)
        compliance, rotary = values[1], values[2:].reshape(3, 3, *values.shape[1:])
        # Coefficients of the moments (M1 + M2, M1 - M2) by powers of N.
        moments = rotary[:, :2] * rotations[0] + rotary[:, 1:] * rotations[1]
        constant, linear, quadratic = moments
        _, shortening, softening = (moments * rotations).sum(axis=1)
        # The energy is stationary in N, with the derivative `stretching` of N by l.
        stretching = 1.0 / (compliance - softening)
        stationary = (elongation + 0.5 * shortening) * stretching
        pull = stationary if axial is None else axial
        moments_by_pull = linear + 2.0 * (pull * quadratic)
        moments_by_elongation = moments_by_pull * stretching
        stiffness = np.empty((3, 3, *pull.shape), dtype=stretching.dtype)
        stiffness[0, 0] = stretching
        stiffness[0, 1:] = stiffness[1:, 0] = moments_by_elongation
        # By s and b: at constant N, and due to the change of N.
        at_constant_pull = rotary[0] + pull * (rotary[1] + pull * rotary[2])
        stiffness[1, 1:], stiffness[2, 1:] = at_constant_pull[:2], at_constant_pull[1:]
        stiffness[1:, 1:] += moments_by_pull[:, None] * moments_by_elongation
        stressed_moments = constant + pull * (linear + pull * quadratic)
        stressed = np.concatenate([pull[None], stressed_moments])
        step = 0.0 if axial is None else stiffness[:, 0] * (stationary - pull) / stretching
        last = (*range(1, stressed.ndim), 0)
        return EndForces(
            (stressed + step).transpose(last),
            stiffness.transpose(*range(2, stiffness.ndim), 0, 1),
            stressed.transpose(last),
        )


def _reciprocal(series: Array) -> Array:
    """Return the first three coefficients (3, ...) of the reciprocal of power series (3, ...)."""
    constant, linear, quadratic = series
    inverse = 1.0 / constant
    slope = -linear * inverse**2
    return np.array([inverse, slope, -(quadratic * inverse + linear * slope) * inverse])


def chord_motions(axis: Points, length: Array) -> Array:
    """Return the derivatives (..., k, 4, 6) of chords' length, s, b and rotation by their ends."""
    # Axes: sample, member, change, end (start and end), displacement of this end (ux, uy, theta).
    motions, axis = np.zeros((*axis.shape, 4, 2, 3)), np.ascontiguousarray(axis)
    motions[..., 0, 1, :2] = axis.view(np.float64).reshape(*axis.shape, 2)
    turning = np.ascontiguousarray(1j * axis / length)
    motions[..., 3, 1, :2] = turning.view(np.float64).reshape(*axis.shape, 2)
    motions[..., 1, 1, :] = -motions[..., 3, 1, :]  # end rotations are relative to the chord
    motions[..., 0, :] = -motions[..., 1, :]
    motions[..., 1, :, 2] = 0.5
    motions[..., 2, :, 2] = 0.5, -0.5
    return motions.reshape(*axis.shape, 4, 6)


def chord_stiffness(length: Array, forces: EndForces) -> Array:
    """Return the stiffness (..., k, 4, 4) of bent members, coordinates as in `chord_motions`."""
    stiffness = np.zeros((*length.shape, 4, 4))
    stiffness[..., :3, :3] = forces.stiffness.real
    stiffness[..., 0, 3] = stiffness[..., 3, 0] = forces.stressed[..., 1].real / length
    stiffness[..., 3, 3] = forces.stressed[..., 0].real * length
    return stiffness


def end_forces(forces: Array, length: Array) -> Array:
    """Return end forces (..., k, 6) as in `FrameState`, from values (k, 3) as in `EndForces`."""
    pull, moment_sum, moment_difference = (forces[..., i] for i in range(3))
    across = moment_sum / length
    start = 0.5 * (moment_sum + moment_difference)
    end = 0.5 * (moment_sum - moment_difference)
    return np.stack([-pull, across, start, pull, -across, end], axis=-1)


def local_stiffness(length: Array, axial: Array, flexural: Array, shear: Array) -> Array:
    """Return the members' stiffness matrices, equation (2), in axes from start to end."""
    pinned, straight = np.zeros(len(length), dtype=bool), np.zeros((3, len(length)))
    columns = BeamColumns.of(length, np.stack([axial, flexural, shear]), pinned)
    stiffness = chord_stiffness(length, columns.evaluate(straight[0], straight[1:]))
    motions = chord_motions(np.ones(len(length), dtype=np.complex128), length)
    return motions.swapaxes(1, 2) @ stiffness @ motions


# Plane frames of beam-columns, each fixed to a node or pinned at its start, with constraints.

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
