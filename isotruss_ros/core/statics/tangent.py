# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frame of beam-columns linearised about displacements: forces and stiffness (1) to (4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.samples import sum_at
from isotruss_ros.core.numerics.tolerances import EPSILON
from isotruss_ros.core.statics.beam_column import (
    BeamColumns,
    chord_motions,
    chord_stiffness,
    EndForces,
)
from isotruss_ros.core.statics.blocks import Condensed, eliminate
from isotruss_ros.core.statics.frame import Frame
from isotruss_ros.core.statics.unloaded_blocks import UnloadedBlocks
import numpy as np

#: Error of displacements that are predicted from another state, per square of the displacement of
#: a node between both states [1/m].
TUBE_CURVATURE = 15.0


class Slopes(NamedTuple):
    """Inclinations (q,) of bent centre lines at ends of parts, with derivatives."""

    values: Array  #: (q,) inclinations [rad]
    #: (q, 1, 6) derivatives of the inclinations by (ux, uy, theta) at start and end
    by_ends: Array
    #: (q, 3) derivatives of the inclinations by `EndForces.values` with fixed nodes
    by_forces: Array
    #: (q,) derivatives of the inclinations by the logarithm of GA with fixed nodes and constant
    #: forces
    by_shear: Array


class Assembled(NamedTuple):
    """Sums over all parts of a frame and its constraints."""

    #: (u,) gaps of the constraints, then loads and reactions that hold the frame [N, N m]
    carried: Array
    matrices: list[Array]  #: scaled stiffness of each group of blocks, see `eliminate`


@dataclass(frozen=True, eq=False)
class Tangent:
    """
    Frame linearised about given unknowns (corotational formulation), see `linearize`.

    Of several samples, all arrays have the samples as their first axis.
    """

    shared: ClassVar[tuple[str, ...]] = ()
    frame: Frame  #: the frame
    #: (u,) Lagrange multipliers of the constraints, then displacements ux, uy [m], theta [rad]
    unknowns: Array
    axis: Points  #: (p,) unit vectors of the chords, x + iy
    length: Array  #: (p,) lengths of the chords [m]
    elongations: Array  #: (p,) elongations of the chords [m]
    rotations: Array  #: (2, p) rotations s and b, see `EndForces` [rad]
    forces: EndForces  #: axial forces and end moments of the parts
    #: (p, 3) derivatives of `EndForces.values` by the rest lengths of the parts of divided
    #: members, with fixed nodes; zero for other parts
    length_rates: Array
    motions: Array  #: (p, 4, 6) derivatives of the chords, see `chord_motions`
    #: the blocks that are kept undeformed, and the forces (b, t) on their hinges and their
    #: stiffness (b, t, t)
    kept: tuple[Sequence[UnloadedBlocks], list[Array], list[Array]]

    @property
    def displacements(self) -> Array:
        """Return ux, uy [m] and theta [rad] of the nodes, (n, 3)."""
        return self.frame.displacements(self.unknowns)

    @cached_property
    def assembled(self) -> Assembled:
        """Return the sums over all parts, which the forces of the parts do not need."""
        frame, layout, (*lead, size) = self.frame, self.frame.layout, self.unknowns.shape
        at_ends = self.motions[..., :3, :].swapaxes(-1, -2) @ self.forces.values[..., None]
        carried = sum_at(layout.places.ravel(), at_ends.reshape(*lead, -1), size)
        scaled = self.motions * frame.scale.take(layout.places, axis=-1)[..., None, :]
        stiffness = chord_stiffness(self.length, self.forces)
        members = scaled.swapaxes(-1, -2) @ stiffness @ scaled

        multipliers = self.unknowns[..., : layout.numbering.rows]
        row_forces, rows = _linearize_constraints(frame, self.displacements, multipliers)
        carried += sum_at(layout.row_places.ravel(), row_forces.reshape(*lead, -1), size)
        scale = frame.scale.take(layout.row_places, axis=-1)
        rows *= scale[..., None] * scale[..., None, :]

        for blocks, forces, _ in zip(*self.kept, strict=True):
            carried += sum_at(blocks.outer.ravel(), forces.reshape(*lead, -1), size)
        return Assembled(carried, [group.assemble(members, rows) for group in layout.groups])

    def solve(self, right: Array) -> tuple[Condensed, Array]:
        """
        Return the condensed matrix of (4), and solutions (..., u, p) for p columns of `right`.

        The solution of a sample without stiffness is NaN, unless it is the only one.
        """
        frame, scale = self.frame, self.frame.scale[..., None]
        kept = []
        for blocks, _, stiffness in zip(*self.kept, strict=True):
            of_hinges = frame.scale[..., blocks.outer]
            kept.append(stiffness * of_hinges[..., None] * of_hinges[..., None, :])
        try:
            matrices = self.assembled.matrices
            condensed, solution = eliminate(frame.layout, matrices, kept, right * scale)
            is_singular = right.ndim == 2 and np.isnan(solution).any()
        except np.linalg.LinAlgError:
            is_singular = True
        if is_singular:
            raise StructureError(
                'the structure has no stiffness in its bent shape: the loads must be smaller'
            )
        return condensed, solution * scale

    def respond(self, loads: Array) -> Array:
        """Return the changes (u, p) of the unknowns by additional loads (3 n, p) on the nodes."""
        rows = self.frame.layout.numbering.rows
        right = np.concatenate([np.zeros((rows, loads.shape[1])), loads])
        return self.solve(right)[1]

    def force_rates(self, parts: Indices) -> Array:
        """Return the derivatives (q, 3, 4) of q parts' `EndForces` by length, EA, EI and GA."""
        frame, repeated = self.frame, parts.repeat(4)
        # Derivatives by complex steps have no rounding error of differences. Each part occurs four
        # times, with a step of its length, EA, EI and GA.
        steps = 1j * EPSILON * np.tile(np.eye(4), len(parts))
        sections = np.vstack([frame.length, frame.section])[:, repeated] + steps
        columns = BeamColumns.of(sections[0], sections[1:], frame.layout.pinned[repeated])
        elongations, rotations = self.elongations[repeated] - steps[0], self.rotations[:, repeated]
        varied = columns.evaluate(elongations, rotations, self.forces.stressed[repeated, 0])
        rates = varied.values.imag / EPSILON
        return rates.reshape(len(parts), 4, 3).swapaxes(1, 2)

    def sum_forces(self, parts: Indices, forces: Array) -> Array:
        """Return loads (..., u, c) on the nodes that balance `EndForces` (q, 3, c) of q parts."""
        *lead, size = self.unknowns.shape
        count = forces.shape[-1]
        motions = self.motions[..., :3, :].take(parts, axis=-3)
        at_ends = motions.swapaxes(-1, -2) @ forces
        indices = self.frame.layout.places[parts, :, None] * count + np.arange(count)
        sums = sum_at(indices.ravel(), at_ends.reshape(*lead, -1), size * count)
        return sums.reshape(*lead, size, count)

    def slopes(self, parts: Indices, signs: Array) -> Slopes:
        """Return the inclinations at ends of parts (q,), see `InclinationWeights`."""
        # Relative to the chord they are (t - Q/GA) / (1 + N/GA), with the section's rotation t and
        # the transverse force Q.
        length, forces = self.length.take(parts, axis=-1), self.forces.values.take(parts, axis=-2)
        axial, moment_sum = forces[..., 0], forces[..., 1]
        shear_compliance = 1.0 / self.frame.section[..., 2, :].take(parts, axis=-1)
        transverse = moment_sum / length
        reduction = 1.0 / (1.0 + axial * shear_compliance)
        # The rotation is s - b at the end of a part before a cut, s + b at the start behind it.
        rotations = self.rotations.take(parts, axis=-1)
        sway, bow = rotations[..., 0, :], rotations[..., 1, :]
        slope = (sway + signs * bow - transverse * shear_compliance) * reduction
        chord_turn = self.axis.take(parts, axis=-1) * self.frame.axis.take(parts, axis=-1).conj()
        by_transverse = -shear_compliance * reduction
        by_forces = np.zeros((*length.shape, 3))
        by_forces[..., 0], by_forces[..., 1] = by_transverse * slope, by_transverse / length
        # By length, s, b and rotation of the chord: due to the forces, and at constant forces.
        by_chord = np.empty((*length.shape, 1, 4))
        stiffness = self.forces.stiffness.take(parts, axis=-3)
        by_chord[..., :3] = by_forces[..., None, :] @ stiffness
        by_chord[..., 0, 3] = 1.0
        by_chord[..., 0, 0] -= by_transverse * transverse / length
        by_chord[..., 0, 1] += reduction
        by_chord[..., 0, 2] += signs * reduction
        return Slopes(
            values=np.arctan2(chord_turn.imag, chord_turn.real) + slope,
            by_ends=by_chord @ self.motions.take(parts, axis=-3),
            by_forces=by_forces,
            # By ln GA: the change of 1/GA is -(1/GA) times that of ln GA.
            by_shear=-by_transverse * (transverse + axial * slope),
        )

    def force_changes(self, moved: Array) -> tuple[Array, Array]:
        """Return changes of forces (p, 3, c) and elongations (p, c) by c motions (n, 3, c)."""
        *lead, _, _, count = moved.shape
        of_nodes = moved.reshape(*lead, -1, count)
        chords = self.motions @ of_nodes.take(self.frame.layout.ends, axis=-2)
        return self.forces.stiffness @ chords[..., :3, :], chords[..., 0, :]

    @property
    def is_stable(self) -> bool:
        """Return whether the frame's equilibrium is stable under the constraints."""
        condensed, _ = self.solve(np.zeros((len(self.unknowns), 1)))
        return condensed.negative_pivots == self.frame.layout.numbering.rows


def linearize(
    frame: Frame,
    unknowns: Array,
    axial: Array | None = None,
    kept: Sequence[UnloadedBlocks] = (),
) -> Tangent:
    """Return a frame linearised about unknowns (..., u), near axial forces (..., p) [N]."""
    chord, elongations, rotations = _displace_chords(frame, frame.displacements(unknowns))
    length = np.abs(chord)
    # Complex-step derivatives by rest lengths: in divided members, these have imaginary parts in
    # the columns, and elongations have the opposite ones.
    complex_elongations = elongations + (frame.length - frame.columns.values[..., 0, :])
    forces = frame.columns.evaluate(complex_elongations, rotations, axial)
    axis = frame.axis * chord / length
    of_kept = [blocks.linearize(unknowns) for blocks in kept]
    return Tangent(
        frame=frame,
        unknowns=unknowns,
        axis=axis,
        length=length,
        elongations=elongations,
        rotations=rotations,
        forces=EndForces(*(values.real.copy() for values in forces)),
        length_rates=forces.values.imag / EPSILON,
        motions=chord_motions(axis, length),
        kept=(kept, [values for values, _ in of_kept], [values for _, values in of_kept]),
    )


def _displace_chords(frame: Frame, displacements: Array) -> tuple[Points, Array, Array]:
    """
    Return the chords between displaced nodes, in axes of the members at rest.

    :return: (..., p) chords, x + iy [m]; (..., p) their elongations [m]; and (..., 2, p) rotations
        s and b of the ends relative to the chords, see `EndForces` [rad].
    """
    start, end = frame.layout.start, frame.layout.end
    shifts, turns = displacements[..., 0] + 1j * displacements[..., 1], displacements[..., 2]
    difference = shifts.take(end, axis=-1) - shifts.take(start, axis=-1)
    difference *= frame.axis.conj()
    chord = frame.length + difference
    # (l^2 - l0^2) / (l + l0), because l - l0 has large rounding errors.
    square_growth = 2.0 * frame.length * difference.real + difference.real**2 + difference.imag**2
    elongations = square_growth / (np.abs(chord) + frame.length)
    at_start, at_end = 0.5 * turns.take(start, axis=-1), 0.5 * turns.take(end, axis=-1)
    sway = at_start + at_end - np.arctan2(chord.imag, chord.real)
    rotations = np.empty((*sway.shape[:-1], 2, sway.shape[-1]))
    rotations[..., 0, :], rotations[..., 1, :] = sway, at_start - at_end
    return chord, elongations, rotations


def _linearize_constraints(
    frame: Frame, displacements: Array, multipliers: Array
) -> tuple[Array, Array]:
    """
    Return the constraints' gaps and forces on nodes, and their symmetric matrices.

    Rows (..., q, 1 + w) belong to the multiplier of a constraint, and then to displacements of
    nodes.
    """
    rows = frame.layout.rows
    slopes, gaps, geometric_stiffness = frame.layout.numbering.constraints.linearize(
        frame.points, displacements, multipliers, rows
    )
    width = slopes.shape[-1] + 1
    matrices = np.zeros((*gaps.shape, width, width))
    matrices[..., 0, 1:] = matrices[..., 1:, 0] = slopes
    matrices[..., 1:, 1:] = geometric_stiffness
    forces = slopes * multipliers[..., rows, None]
    return np.concatenate([gaps[..., None], forces], axis=-1), matrices
