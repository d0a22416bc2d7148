# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Linearised frame, and its equilibrium under loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.samples import sum_at, take
from isotruss_ros.core.numerics.tolerances import (
    COINCIDENCE,
    EPSILON,
    MAX_CONDITION,
    MAX_NEWTON_ITERATIONS,
)
from isotruss_ros.core.statics.blocks import Condensed, eliminate
from isotruss_ros.core.statics.frame import (
    BeamColumns,
    chord_motions,
    chord_stiffness,
    end_forces,
    EndForces,
    Frame,
    largest_motion,
)
from isotruss_ros.core.statics.unloaded_blocks import UnloadedBlocks
import numpy as np

# Frame of beam-columns linearised about displacements: forces and stiffness (1) to (4).

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


# Equilibria of a frame under loads on its nodes.
#
# `solve` is linear about the unloaded frame, as in the paper. `bend` finds the equilibrium of the
# bent frame by Newton's method; its first step is `solve`. `follow_loads` increases the loads up
# to the limit load, at which the stiffness is singular; at larger loads there is no stable
# equilibrium nearby. Newton's method may still converge to an unstable equilibrium, which negative
# pivots of the factorised stiffness indicate.

#: Largest admissible ratio of the displacements to those of the linear prediction [-].
MAX_GROWTH = 1.5
#: Largest displacement of a node in a load step, by linear prediction [m].
MAX_DISPLACEMENT_STEP = 0.01
#: Relative tolerance of a limit load [-].
LIMIT_TOLERANCE = 1e-3


@dataclass(frozen=True, eq=False)
class FrameState:
    """Displacements, reactions and member forces of a frame under loads."""

    #: (n, 3) displacements ux, uy [m], theta [rad]; theta is zero at nodes at which all members
    #: are pinned
    displacements: Array
    #: (n, 3) forces fx, fy [N] and moments m [N m] of the supports on the frame; zero at nodes
    #: without support
    reactions: Array
    #: (p, 6) forces of the nodes on the parts; at the start and then at the end, the force along
    #: the chord and across it [N] and the moment [N m]
    end_forces: Array
    #: (p,) axial forces that amplify moments inside parts [N]; zero in the linear model
    bowing: Array


def unloaded(frame: Frame) -> Tangent:
    """Return a frame linearised without loads; raise StructureError if it is a mechanism."""
    tangent = linearize(frame, np.zeros(len(frame.scale)))
    solve_unloaded(tangent, np.zeros((3 * len(frame.points), 0)))
    return tangent


def solve_unloaded(tangent: Tangent, loads: Array) -> tuple[Condensed, Array]:
    """
    Return the condensed matrix and the linear responses of a frame linearised without loads.

    The responses (..., u, p) are the unknowns by loads (3 n, p) on the nodes. Raise StructureError
    if the frame is a mechanism; its message is that of the first sample.
    """
    frame = tangent.frame
    rows, columns = frame.layout.numbering.rows, loads.shape[1]
    right = np.zeros((*frame.scale.shape, columns + 1))
    right[..., rows:, :columns] = loads
    # The response to an irregular load is a lower bound of the condition number.
    right[..., columns] = irregular_loads(frame)
    try:
        condensed, solution = tangent.solve(right)
        condition = np.abs(solution[..., columns] / frame.scale).max()
    except StructureError:
        condition = np.inf
    if condition < MAX_CONDITION:  # the stiffness matrix (4) is regular
        return condensed, solution[..., :columns]
    if frame.scale.ndim > 1:  # one by one
        for i in range(len(frame.scale)):
            solve_unloaded(take(tangent, i), loads)
    raise StructureError(
        f'the structure is a mechanism: {", ".join(_find_loose_nodes(tangent))} can move '
        'without resistance; support it or connect it'
    )


def irregular_loads(frame: Frame) -> Array:
    """Return loads (..., u) whose scaled response is a lower bound of the condition number."""
    return np.cos(np.arange(frame.scale.shape[-1]) ** 2) / frame.scale


def _find_loose_nodes(tangent: Tangent) -> list[str]:
    """Return the names of the nodes that can move without force in a singular frame."""
    frame, numbering = tangent.frame, tangent.frame.layout.numbering
    matrix, free = np.zeros((len(frame.scale),) * 2), numbering.free
    for group, blocks in zip(frame.layout.groups, tangent.assembled.matrices, strict=True):
        for indices, block in zip(np.hstack([group.outer, group.inner]), blocks, strict=True):
            matrix[np.ix_(indices, indices)] += block
    eigenvalues, modes = np.linalg.eigh(matrix[np.ix_(free, free)])
    is_loose = np.abs(eigenvalues) < np.abs(eigenvalues).max() / MAX_CONDITION**0.5
    is_loose[np.abs(eigenvalues).argmin()] = True
    motions = np.zeros(len(free))
    motions[free] = np.abs(frame.scale[free, None] * modes[:, is_loose]).max(axis=1)
    of_nodes = frame.displacements(motions).max(axis=1)
    return [numbering.names[i] for i in np.flatnonzero(of_nodes > 1e-3 * of_nodes.max())]


def solve(tangent: Tangent, loads: Array) -> FrameState:
    """Return displacements, reactions and member forces under loads (n, 3) by linear (4)."""
    frame, layout = tangent.frame, tangent.frame.layout
    changes = tangent.respond(loads.reshape(-1, 1))
    displacements = frame.motions(changes)
    forces, _ = tangent.force_changes(displacements)
    carried = tangent.sum_forces(np.arange(len(frame.length)), forces)[:, 0]
    multipliers = changes[: layout.numbering.rows, 0]
    slopes = layout.numbering.constraints.slopes(frame.points, layout.rows)
    row_forces = slopes * multipliers[layout.rows, None]
    carried += np.bincount(layout.row_places[:, 1:].ravel(), row_forces.ravel(), len(carried))
    return FrameState(
        displacements[..., 0],
        _reactions(frame, frame.displacements(carried) - loads),
        end_forces(forces[..., 0], tangent.length),
        np.zeros(len(frame.length)),
    )


@np.errstate(over='ignore', invalid='ignore', divide='ignore')
def bend(start: Tangent, loads: Array) -> Tangent | None:
    """Return the bent frame in equilibrium under loads (n, 3), found by Newton's method."""
    tangent, frame, predicted = start, start.frame, np.inf
    applied = np.append(np.zeros(frame.layout.numbering.rows), loads)
    for count in range(MAX_NEWTON_ITERATIONS):
        _, step = tangent.solve((applied - tangent.assembled.carried)[:, None])
        moved = frame.motions(step)
        largest = largest_motion(moved[..., 0])
        from_start = tangent.displacements + moved[..., 0] - start.displacements
        if count == 0:
            predicted = largest
        # An equilibrium far beyond the linear prediction is on another branch.
        elif not largest_motion(from_start) <= MAX_GROWTH * predicted:
            return None
        force_changes, _ = tangent.force_changes(moved)
        axial = tangent.forces.values[:, 0] + force_changes[:, 0, 0]
        tangent = linearize(frame, tangent.unknowns + step[:, 0], axial)
        if TUBE_CURVATURE * largest**2 <= COINCIDENCE:
            return tangent
    return None


def state_under(tangent: Tangent, loads: Array) -> FrameState:
    """Return displacements, reactions and member forces of a bent frame."""
    carried = tangent.frame.displacements(tangent.assembled.carried)
    return FrameState(
        tangent.displacements,
        _reactions(tangent.frame, carried - loads),
        end_forces(tangent.forces.values, tangent.length),
        tangent.forces.values[:, 0],
    )


def _reactions(frame: Frame, missing: Array) -> Array:
    """Return the support reactions (n, 3) from the residual (n, 3) of the balance."""
    reactions, held = np.zeros((len(frame.points), 3)), frame.layout.numbering.held
    reactions[: len(held)] = missing[: len(held)] * held
    return reactions


class LoadPath(NamedTuple):
    """Stable equilibria of a frame under increasing loads."""

    factors: list[float]  #: (s,) factors on the loads, increasing from 0
    tangents: list[Tangent]  #: (s,) frames linearised about the equilibria at these factors
    limit: float  #: factor of the limit load; infinite if the path ends before it


def follow_loads(
    start: Tangent, loads: Array, last_factor: float, farthest: float = np.inf
) -> LoadPath:
    """Follow loads (n, 3) from zero to a last factor, or to displacements of `farthest` [m]."""
    path = LoadPath([0.0], [start], np.inf)
    step = last_factor
    for _ in range(400):
        factor, tangent = path.factors[-1], path.tangents[-1]
        if factor >= last_factor or largest_motion(tangent.displacements) > farthest:
            return path
        moved = start.frame.motions(tangent.respond(loads.reshape(-1, 1)))
        motion = float(largest_motion(moved[..., 0]))
        bounded_step = MAX_DISPLACEMENT_STEP / motion if motion > 0.0 else np.inf
        step = min(2.0 * step, bounded_step, last_factor - factor)
        bent = bend(tangent, (factor + step) * loads)
        while bent is None or not bent.is_stable:
            if step <= LIMIT_TOLERANCE * factor:
                return path._replace(limit=factor + step)
            step *= 0.5
            bent = bend(tangent, (factor + step) * loads)
        path.factors.append(factor + step)
        path.tangents.append(bent)
    return path
