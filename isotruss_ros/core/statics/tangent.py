# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frame of beam-columns linearised about displacements: forces and stiffness (1) to (4)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
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
    """Inclinations (p,) of bent centre lines before and behind cuts, with derivatives."""

    values: Array  #: (p,) inclinations [rad]
    #: (p, 1, 6) derivatives of the inclinations by (ux, uy, theta) at start and end
    by_ends: Array
    #: (p, 3) derivatives of the inclinations by `EndForces.values` with fixed nodes
    by_forces: Array
    #: (p,) derivatives of the inclinations by the logarithm of GA with fixed nodes and constant
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
    #: (p,) elongations [m], and (2, p) rotations s and b, see `EndForces` [rad]
    stretched: tuple[Array, Array]
    forces: EndForces  #: axial forces and end moments of the parts
    #: (p, 3) derivatives of `EndForces.values` by the rest lengths of the parts of divided
    #: members, with fixed nodes; zero for other parts
    length_rates: Array
    motions: Array  #: (p, 4, 6) derivatives of the chords, see `chord_motions`
    #: (u,) gaps of the constraints, then loads and reactions that hold the frame [N, N m]
    carried: Array
    matrices: list[Array]  #: scaled stiffness of each group of blocks, see `eliminate`
    #: the other blocks, and the forces (b, t) on their hinges and their stiffness (b, t, t)
    kept: tuple[tuple[UnloadedBlocks, ...], list[Array], list[Array]]

    @property
    def displacements(self) -> Array:
        """Return ux, uy [m] and theta [rad] of the nodes, (n, 3)."""
        return self.frame.displacements(self.unknowns)

    @cached_property
    def condensed(self) -> tuple[Condensed, float]:
        """Return the condensed matrix of (4), and a lower bound of its condition number."""
        right = np.cos(np.arange(len(self.unknowns)) ** 2)  # irregular
        condensed, moved = self.solve((right / self.frame.scale)[:, None])
        return condensed, float(np.abs(moved[:, 0] / self.frame.scale).max())

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

    def force_rates(self, parts: Indices, changes: Array) -> Array:
        """Return the changes (q, 3, c) of q parts' `EndForces` due to c changes of sections."""
        frame, count = self.frame, changes.shape[2]
        repeated = parts.repeat(count)
        # Derivatives by complex steps have no rounding error of differences.
        steps = 1j * EPSILON * changes.reshape(4, -1)
        section = np.vstack([frame.length, frame.section])[:, repeated] + steps
        columns = BeamColumns.of(section[0], section[1:], frame.layout.pinned[repeated])
        longer, turns = self.stretched
        stressed = self.forces.stressed[repeated, 0]
        changed = columns.evaluate(longer[repeated] - steps[0], turns[:, repeated], stressed)
        rates = changed.values.imag / EPSILON
        return rates.reshape(len(parts), count, 3).swapaxes(1, 2)

    def sum_forces(self, parts: Indices, forces: Array) -> Array:
        """Return the sums (u, c) at the unknowns of the nodes' forces on q parts (q, 3, c)."""
        pushed, count = self.motions[parts, :3].swapaxes(1, 2) @ forces, forces.shape[2]
        indices = self.frame.layout.places[parts, :, None] * count + np.arange(count)
        size = len(self.unknowns) * count
        return np.bincount(indices.ravel(), pushed.ravel(), size).reshape(-1, count)

    @cached_property
    def slopes(self) -> Slopes:
        """Return the inclinations of the bent centre lines before, then behind the cuts."""
        # Relative to the chord they are (t - Q/GA) / (1 + N/GA), with the section's rotation t and
        # the transverse force Q.
        frame, layout = self.frame, self.frame.layout
        parts, signs = layout.beside, layout.signs
        length, forces = self.length[parts], self.forces.values[parts]
        slide = 1.0 / frame.section[2, parts]
        across, compliance = forces[:, 1] / length, 1.0 / (1.0 + forces[:, 0] * slide)
        sway, bow = self.stretched[1][:, parts]
        inclined = (sway + signs * bow - across * slide) * compliance
        turn = self.axis[parts] * frame.axis[parts].conj()
        aside, turned = -slide * compliance, np.arctan2(turn.imag, turn.real)
        by_forces, by_chord = np.zeros((len(parts), 3)), np.ones((len(parts), 1, 4))
        by_forces[:, 0], by_forces[:, 1] = aside * inclined, aside / length
        by_chord[:, :, :3] = by_forces[:, None] @ self.forces.stiffness[parts]
        by_chord[:, 0, 0] -= aside * across / length
        by_chord[:, 0, 1] += compliance
        by_chord[:, 0, 2] += signs * compliance
        by_ends = by_chord @ self.motions[parts]
        by_shear = -aside * (across + forces[:, 0] * inclined)
        return Slopes(turned + inclined, by_ends, by_forces, by_shear)

    def force_changes(self, moved: Array) -> tuple[Array, Array]:
        """Return changes of forces (p, 3, c) and of chords (p, c) by motion (n, 3, c) of nodes."""
        chords = self.motions @ moved.reshape(-1, moved.shape[2])[self.frame.layout.ends]
        return self.forces.stiffness @ chords[:, :3], chords[:, 0]

    @property
    def is_stable(self) -> bool:
        """Return whether the frame's equilibrium is stable under the constraints."""
        return self.condensed[0].negative_pivots == self.frame.layout.numbering.rows


def linearize(
    frame: Frame, unknowns: Array, pull: Array | None = None, kept: tuple[UnloadedBlocks, ...] = ()
) -> Tangent:
    """Linearise a frame about unknowns (u,); `pull` (p,) are near its axial forces [N], or NaN."""
    layout, columns, at_rest = frame.layout, frame.columns, frame.length
    rows, start, end = layout.numbering.rows, layout.start, layout.end
    displacements = unknowns[rows:].reshape(-1, 3)
    shifts, turns = displacements[:, 0] + 1j * displacements[:, 1], displacements[:, 2]
    apart = (shifts[end] - shifts[start]) * frame.axis.conj()
    span = at_rest + apart
    length = np.abs(span)
    # (l^2 - l0^2) / (l + l0), because l - l0 has large rounding errors.
    longer = (2.0 * at_rest * apart.real + apart.real**2 + apart.imag**2) / (length + at_rest)
    first, second = turns[start], turns[end]
    chords = np.array([first + second, first - second])
    chords *= 0.5
    chords[0] -= np.arctan2(span.imag, span.real)
    # The imaginary parts of columns are derivatives by rest lengths.
    evaluated = columns.evaluate(longer + (at_rest - columns.values[0]), chords, pull)
    core, rates = chord_stiffness(length, evaluated), evaluated.values.imag / EPSILON
    forces = EndForces(evaluated.values.real.copy(), core[:, :3, :3], evaluated.stressed.real)
    axis = frame.axis * span / length
    motions = chord_motions(axis, length)
    pushed = (motions[:, :3].swapaxes(1, 2) @ forces.values[:, :, None])[..., 0]
    scaled = motions * frame.scale[layout.places][:, None]
    stiffness = scaled.swapaxes(1, 2) @ core @ scaled

    multipliers, chosen = unknowns[:rows], layout.rows
    constraints = layout.numbering.constraints
    slopes, gaps, curved = constraints.linearize(frame.points, displacements, multipliers, chosen)
    bound = np.zeros((len(chosen), slopes.shape[1] + 1, slopes.shape[1] + 1))
    bound[:, 0, 1:] = bound[:, 1:, 0] = slopes
    bound[:, 1:, 1:] = curved
    carried = np.bincount(layout.places.ravel(), pushed.ravel(), len(unknowns))
    held = slopes * multipliers[chosen, None]
    carried += np.bincount(layout.row_places[:, 1:].ravel(), held.ravel(), len(unknowns))
    carried[chosen] = gaps
    scale = frame.scale[layout.row_places]
    bound *= scale[:, :, None] * scale[:, None]

    pushes, stiffnesses = [], []
    for blocks in kept:
        push, stiff = blocks.linearize(unknowns)
        carried += np.bincount(blocks.outer.ravel(), push.ravel(), len(unknowns))
        pushes.append(push)
        stiffnesses.append(stiff)
    matrices = [group.assemble(stiffness, bound) for group in layout.groups]
    elements = axis, length, (longer, chords), forces, rates, motions
    return Tangent(frame, unknowns, *elements, carried, matrices, (kept, pushes, stiffnesses))
