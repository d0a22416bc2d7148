# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frame of beam-columns linearised about displacements, with its factorised matrix (4)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
import math
from typing import NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.factorization import count_negative_pivots
from isotruss_ros.core.numerics.tolerances import EPSILON
from isotruss_ros.core.statics.beam_column import (
    BeamColumns,
    chord_motions,
    chord_stiffness,
    end_forces,
    EndForces,
)
from isotruss_ros.core.statics.cut_layout import FrameArrays
from isotruss_ros.core.statics.elimination import Elimination
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


class CondensedCuts(NamedTuple):
    """
    Parts of q cut members; static condensation has eliminated the nodes at their cuts.

    Each member has displacements at b cuts; members with fewer cuts have units in their place.
    """

    stiffness: Array  #: (q, 3 b, 3 b) stiffness of the nodes at the cuts with fixed member ends
    inverse: Array  #: (q, 3 b, 3 b) its inverse
    #: (q, 3 b, 6) displacements of these nodes by unit displacements of the members' ends
    spread: Array
    members: Array  #: (q, 6, 6) condensed stiffness of the members


@dataclass(frozen=True, eq=False)
class Tangent:
    """Frame linearised about displacements of its nodes (corotational formulation)."""

    frame: FrameArrays  #: the frame
    displacements: Array  #: (n, 3) displacements ux, uy [m], theta [rad]
    multipliers: Array  #: (c,) Lagrange multipliers of the constraints
    axis: Points  #: (k,) unit vectors of the chords, x + iy
    length: Array  #: (k,) lengths of the chords [m]
    #: (k,) elongations [m], and (2, k) rotations s and b, see `EndForces` [rad]
    stretched: tuple[Array, Array]
    forces: EndForces  #: axial forces and end moments of the members
    core: Array  #: (k, 4, 4) stiffness of the members, see `chord_stiffness`
    #: (k, 3) derivatives of `EndForces.values` by the rest lengths of the parts beside cuts, with
    #: fixed nodes; zero for other members
    length_rates: Array
    constraints: tuple[Array, Array, Points]  #: see `TurnRows.linearize`
    given: Elimination | None = None  #: factorised matrix; None: it is computed

    @classmethod
    def of(
        cls,
        frame: FrameArrays,
        displacements: Array,
        multipliers: Array,
        pull: Array | None = None,
        given: Elimination | None = None,
    ) -> Tangent:
        """Linearise a frame about given displacements."""
        columns, rest, start, end = frame.columns, frame.length, frame.start, frame.end
        shifts, turns = displacements[:, 0] + 1j * displacements[:, 1], displacements[:, 2]
        apart = (shifts[end] - shifts[start]) * frame.axis.conj()
        span = rest + apart
        length = np.abs(span)
        # (l^2 - l0^2) / (l + l0), because l - l0 has large rounding errors.
        longer = (2.0 * rest * apart.real + apart.real**2 + apart.imag**2) / (length + rest)
        first, second = turns[start], turns[end]
        chords = np.array([first + second, first - second])
        chords *= 0.5
        chords[0] -= np.arctan2(span.imag, span.real)
        found = columns.evaluate(longer + (rest - columns.values[0]), chords, pull)
        core, rates = chord_stiffness(length, found), found.values.imag / EPSILON
        forces = EndForces(found.values.real.copy(), core[:, :3, :3], found.stressed.real)
        constraints = frame.rows.linearize(frame.spans, displacements)
        axis = frame.axis * span / length
        stretched = longer, chords
        return cls(
            frame,
            displacements,
            multipliers,
            axis,
            length,
            stretched,
            forces,
            core,
            rates,
            constraints,
            given,
        )

    @cached_property
    def motions(self) -> Array:
        """Return the derivatives (k, 4, 6) of the chords, see `chord_motions`."""
        return chord_motions(self.axis, self.length)

    @cached_property
    def matrices(self) -> Array:
        """Return the stiffness (k, 6, 6) of all members against (ux, uy, theta) at both ends."""
        return self.motions.swapaxes(1, 2) @ self.core @ self.motions

    @cached_property
    def cuts(self) -> CondensedCuts:
        """Return the cut members after static condensation of the nodes at their cuts."""
        layout, parts = self.frame.layout, self.matrices[self.frame.layout.parts]
        shape = len(layout.ends), layout.width, layout.width
        whole = np.bincount(layout.local, parts.ravel(), math.prod(shape))
        whole[layout.units] = 1.0
        whole = whole.reshape(shape)
        inner, coupling = whole[:, :-6, :-6], whole[:, :-6, -6:]
        try:
            inverse = np.linalg.inv(inner)
        except np.linalg.LinAlgError as error:
            raise StructureError(
                'a loaded member has no stiffness in its bent shape: its loads must be smaller'
            ) from error
        spread = -inverse @ coupling
        ends = whole[:, -6:, -6:] + coupling.swapaxes(1, 2) @ spread
        return CondensedCuts(inner, inverse, spread, ends)

    @property
    def entries(self) -> Array:
        """Return the entries of the matrix (4) of the uncut frame, see `FramePattern.entries`."""
        (values, _, spans), layout, matrices = self.constraints, self.frame.layout, self.matrices
        if layout is not None:
            matrices = matrices[: layout.count].copy()
            matrices[layout.members] = self.cuts.members
        curved = self.frame.rows.curvature(spans, self.multipliers)
        return np.concatenate([matrices.ravel(), values, values, curved])

    @cached_property
    def factored(self) -> Elimination:
        """Return the factorised matrix of (4), see `eliminate`."""
        if self.given is not None:
            return self.given
        return self.eliminate(np.zeros((len(self.frame.scaling.scale), 1)))[0]

    def eliminate(self, right: Array) -> tuple[Elimination, Array]:
        """Return the factorised matrix of (4), and the changes (u, p) of the unknowns."""
        if self.given is not None:
            return self.given, self.given.solve(right)
        try:
            return self.frame.scaling.eliminate(self.entries, right)
        except np.linalg.LinAlgError as error:
            raise StructureError(
                'the structure has no stiffness in its bent shape: the loads must be smaller'
            ) from error

    def respond(
        self, loads: Array, gaps: Array | float = 0.0, factored: Elimination | None = None
    ) -> tuple[Array, Array]:
        """Return changes of displacements (3 n, p) and multipliers (c, p) by p load cases."""
        factored = factored or self.factored
        layout, rows = self.frame.layout, self.frame.rows.count
        count, columns = len(loads) - 3 * len(self.frame.nodes), loads.shape[1]
        right = np.empty((count + rows, columns))
        right[:count], right[count:] = loads[:count], gaps
        if layout is None:
            found = factored.solve(right)
            return found[:count], found[count:]
        local = np.zeros((len(layout.ends) * layout.width, columns))
        local[layout.cut.ravel()] = loads[count:]
        _, found, local = self.respond_locally(right, local, factored)
        return np.concatenate([found[:count], local[layout.cut.ravel()]]), found[count:]

    def respond_locally(
        self, right: Array, local: Array, factored: Elimination | None = None
    ) -> tuple[Elimination, Array, Array]:
        """Return the factorised matrix, and changes by p load cases with loads on cut members."""
        (_, inverse, spread, _), ends = self.cuts, self.frame.layout.ends
        moved = local.reshape(len(ends), -1, local.shape[1])
        inner, outer = moved[:, :-6], moved[:, -6:]
        pushed = outer + spread.swapaxes(1, 2) @ inner
        for places, push in zip(ends, pushed, strict=True):
            right[places] += push
        if factored is None:
            factored, found = self.eliminate(right)
        else:
            found = factored.solve(right)
        outer = found[ends]
        moved = np.concatenate([inverse @ inner + spread @ outer, outer], axis=1)
        return factored, found, moved.reshape(local.shape)

    def balance(self, applied: Array, loads: Array | None = None) -> tuple[Array, Array]:
        """Return the changes by additional loads, and the step to equilibrium (last column)."""
        gaps, count = self.constraints[1], 0 if loads is None else loads.shape[1]
        columns, opened = np.empty((len(applied), count + 1)), np.zeros((len(gaps), count + 1))
        columns[:, :count] = loads
        columns[:, -1], opened[:, -1] = applied - self.carried, -gaps
        moved, multipliers = self.respond(columns, opened)
        return moved.reshape(-1, 3, count + 1), multipliers

    @cached_property
    def carried(self) -> Array:
        """Return the loads and reactions (3 n,) that hold the frame in this state [N, N m]."""
        frame, size = self.frame, self.displacements.size
        pushed = self.nodal_forces(slice(None), self.forces.values[:, :, None])
        held = self.constraints[0] * self.multipliers[frame.rows.row]
        return np.bincount(frame.places.ravel(), pushed.ravel(), size) + np.bincount(
            frame.rows.column, held, size
        )

    @property
    def end_forces(self) -> Array:
        """Return the forces (k, 6) of the nodes on the members, see `FrameState.end_forces`."""
        return end_forces(self.forces.values, self.length)

    def force_rates(self, parts: Indices, changes: Array) -> Array:
        """
        Return the changes (p, 3, c) of the forces of p members due to changes of their sections.

        For the forces see `EndForces`. The nodes are fixed. Each of the c columns is one change.
        """
        frame, count = self.frame, changes.shape[2]
        each = parts.repeat(count)
        # Derivatives by complex steps have no rounding error of differences.
        steps = 1j * EPSILON * changes.reshape(4, -1)
        section = np.vstack([frame.length, frame.section])[:, each] + steps
        pins = frame.pins[0][each], frame.pins[1][each]
        columns = BeamColumns.of(section[0], section[1:], pins)
        longer, turns = self.stretched
        known = self.forces.stressed[each, 0]
        found = columns.evaluate(longer[each] - steps[0], turns[:, each], known)
        rates = found.values.imag / EPSILON
        return rates.reshape(len(parts), count, 3).swapaxes(1, 2)

    def nodal_forces(self, parts: Indices | slice, rates: Array) -> Array:
        """Convert changes (p, 3, c) of members' forces to those (p, 6, c) of (fx, fy, m)."""
        return self.motions[parts, :3].swapaxes(1, 2) @ rates

    def slopes(self) -> Slopes:
        """
        Return the inclinations of the bent centre lines before, then behind the cuts.

        The inclination is the rotation of the section minus the shear angle. Relative to the chord
        it is (t - Q/GA) / (1 + N/GA) with the section's rotation t relative to the chord and the
        transverse force Q.
        """
        frame, parts, signs = self.frame, self.frame.layout.beside, self.frame.layout.signs
        length, slide, forces = self.length[parts], frame.slide, self.forces.values[parts]
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
        """Return changes of forces (k, 3, c) and of chords (k, c) by motion (n, 3, c) of nodes."""
        ends = moved.reshape(-1, moved.shape[2])[self.frame.places]
        chords = self.motions @ ends
        return self.forces.stiffness @ chords[:, :3], chords[:, 0]

    @property
    def is_stable(self) -> bool:
        """Return whether the frame's equilibrium is stable under the constraints."""
        cut = self.cuts.stiffness if len(self.frame.nodes) else ()
        softened = sum(count_negative_pivots(each, 0) for each in cut)
        return self.factored.factored.negative_pivots + softened == self.frame.rows.count
