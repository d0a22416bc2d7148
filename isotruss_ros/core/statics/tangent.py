# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frame of beam-columns linearised about displacements: forces and stiffness (1) to (4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
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


@dataclass(frozen=True, eq=False)
class Tangent:
    """Frame linearised about given unknowns (corotational formulation), see `linearize`."""

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
    #: (u,) gaps of the constraints, then loads and reactions that hold the frame [N, N m]
    carried: Array
    matrices: list[Array]  #: scaled stiffness of each group of blocks, see `eliminate`
    #: the other blocks, and the forces (b, t) on their hinges and their stiffness (b, t, t)
    kept: tuple[Sequence[UnloadedBlocks], list[Array], list[Array]]

    @property
    def displacements(self) -> Array:
        """Return ux, uy [m] and theta [rad] of the nodes, (n, 3)."""
        return self.frame.displacements(self.unknowns)

    def solve(self, right: Array) -> tuple[Condensed, Array]:
        """Return the condensed matrix of (4), and solutions (u, p) for p columns of `right`."""
        frame, scale = self.frame, self.frame.scale[:, None]
        kept = [
            stiff * frame.scale[blocks.outer, None] * frame.scale[blocks.outer][:, None]
            for blocks, _, stiff in zip(*self.kept, strict=True)
        ]
        try:
            condensed, solution = eliminate(frame.layout, self.matrices, kept, right * scale)
        except np.linalg.LinAlgError as error:
            raise StructureError(
                'the structure has no stiffness in its bent shape: the loads must be smaller'
            ) from error
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
        """Return the loads (u, c) on the nodes that balance `EndForces` (q, 3, c) of q parts."""
        count, size = forces.shape[2], len(self.unknowns) * forces.shape[2]
        at_ends = self.motions[parts, :3].swapaxes(1, 2) @ forces
        indices = self.frame.layout.places[parts, :, None] * count + np.arange(count)
        return np.bincount(indices.ravel(), at_ends.ravel(), size).reshape(-1, count)

    def slopes(self, parts: Indices, signs: Array) -> Slopes:
        """Return the inclinations at ends of parts (q,), see `InclinationWeights`."""
        # Relative to the chord they are (t - Q/GA) / (1 + N/GA), with the section's rotation t and
        # the transverse force Q.
        length, (axial, moment_sum, _) = self.length[parts], self.forces.values[parts].T
        shear_compliance = 1.0 / self.frame.section[2, parts]
        transverse = moment_sum / length
        reduction = 1.0 / (1.0 + axial * shear_compliance)
        # The rotation is s - b at the end of a part before a cut, s + b at the start behind it.
        sway, bow = self.rotations[:, parts]
        slope = (sway + signs * bow - transverse * shear_compliance) * reduction
        chord_turn = self.axis[parts] * self.frame.axis[parts].conj()
        by_transverse = -shear_compliance * reduction
        by_forces = np.zeros((len(parts), 3))
        by_forces[:, 0], by_forces[:, 1] = by_transverse * slope, by_transverse / length
        # By length, s, b and rotation of the chord: due to the forces, and at constant forces.
        by_chord = np.empty((len(parts), 1, 4))
        by_chord[:, :, :3] = by_forces[:, None] @ self.forces.stiffness[parts]
        by_chord[:, 0, 3] = 1.0
        by_chord[:, 0, 0] -= by_transverse * transverse / length
        by_chord[:, 0, 1] += reduction
        by_chord[:, 0, 2] += signs * reduction
        return Slopes(
            values=np.arctan2(chord_turn.imag, chord_turn.real) + slope,
            by_ends=by_chord @ self.motions[parts],
            by_forces=by_forces,
            # By ln GA: the change of 1/GA is -(1/GA) times that of ln GA.
            by_shear=-by_transverse * (transverse + axial * slope),
        )

    def force_changes(self, moved: Array) -> tuple[Array, Array]:
        """Return changes of forces (p, 3, c) and elongations (p, c) by c motions (n, 3, c)."""
        chords = self.motions @ moved.reshape(-1, moved.shape[2])[self.frame.layout.ends]
        return self.forces.stiffness @ chords[:, :3], chords[:, 0]

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
    """Return a frame linearised about unknowns (u,), near axial forces (p,) [N]."""
    layout, count = frame.layout, frame.layout.numbering.rows
    multipliers, displacements = unknowns[:count], unknowns[count:].reshape(-1, 3)

    # Forces and stiffness of the parts.
    chord, elongations, rotations = _displace_chords(frame, displacements)
    length = np.abs(chord)
    # Complex-step derivatives by rest lengths: in divided members, these have imaginary parts in
    # the columns, and elongations have the opposite ones.
    complex_elongations = elongations + (frame.length - frame.columns.values[0])
    evaluated = frame.columns.evaluate(complex_elongations, rotations, axial)
    stiffness = chord_stiffness(length, evaluated)
    forces = evaluated.values.real.copy()
    axis = frame.axis * chord / length
    motions = chord_motions(axis, length)
    node_forces = (motions[:, :3].swapaxes(1, 2) @ forces[:, :, None])[..., 0]
    carried = np.bincount(layout.places.ravel(), node_forces.ravel(), len(unknowns))
    scaled_motions = motions * frame.scale[layout.places][:, None]
    member_matrices = scaled_motions.swapaxes(1, 2) @ stiffness @ scaled_motions

    row_forces, row_matrices = _linearize_constraints(frame, displacements, multipliers)
    carried += np.bincount(layout.row_places.ravel(), row_forces.ravel(), len(unknowns))
    scale = frame.scale[layout.row_places]
    row_matrices *= scale[:, :, None] * scale[:, None]

    # Blocks that are kept undeformed.
    kept_forces, kept_stiffnesses = [], []
    for blocks in kept:
        hinge_forces, hinge_stiffness = blocks.linearize(unknowns)
        carried += np.bincount(blocks.outer.ravel(), hinge_forces.ravel(), len(unknowns))
        kept_forces.append(hinge_forces)
        kept_stiffnesses.append(hinge_stiffness)
    return Tangent(
        frame=frame,
        unknowns=unknowns,
        axis=axis,
        length=length,
        elongations=elongations,
        rotations=rotations,
        forces=EndForces(forces, stiffness[:, :3, :3], evaluated.stressed.real),
        length_rates=evaluated.values.imag / EPSILON,
        motions=motions,
        carried=carried,
        matrices=[group.assemble(member_matrices, row_matrices) for group in layout.groups],
        kept=(kept, kept_forces, kept_stiffnesses),
    )


def _displace_chords(frame: Frame, displacements: Array) -> tuple[Points, Array, Array]:
    """
    Return the chords between displaced nodes, in axes of the members at rest.

    :return: (p,) chords, x + iy [m]; (p,) their elongations [m]; and (2, p) rotations s and b of
        the ends relative to the chords, see `EndForces` [rad].
    """
    start, end = frame.layout.start, frame.layout.end
    shifts, turns = displacements[:, 0] + 1j * displacements[:, 1], displacements[:, 2]
    difference = (shifts[end] - shifts[start]) * frame.axis.conj()
    chord = frame.length + difference
    # (l^2 - l0^2) / (l + l0), because l - l0 has large rounding errors.
    square_growth = 2.0 * frame.length * difference.real + difference.real**2 + difference.imag**2
    elongations = square_growth / (np.abs(chord) + frame.length)
    rotations = np.array([turns[start] + turns[end], turns[start] - turns[end]])
    rotations *= 0.5
    rotations[0] -= np.arctan2(chord.imag, chord.real)
    return chord, elongations, rotations


def _linearize_constraints(
    frame: Frame, displacements: Array, multipliers: Array
) -> tuple[Array, Array]:
    """
    Return the constraints' gaps and forces on nodes, and their symmetric matrices.

    Rows (q, 1 + w) belong to the multiplier of a constraint, and then to displacements of nodes.
    """
    rows = frame.layout.rows
    slopes, gaps, geometric_stiffness = frame.layout.numbering.constraints.linearize(
        frame.points, displacements, multipliers, rows
    )
    matrices = np.zeros((len(slopes), slopes.shape[1] + 1, slopes.shape[1] + 1))
    matrices[:, 0, 1:] = matrices[:, 1:, 0] = slopes
    matrices[:, 1:, 1:] = geometric_stiffness
    return np.column_stack([gaps, slopes * multipliers[rows, None]]), matrices
