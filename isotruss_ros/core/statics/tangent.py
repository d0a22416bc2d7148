# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frame of beam-columns linearised about displacements, with its factorised matrix (4)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
import itertools
from typing import NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.factorization import count_negative_pivots, Factor, factorize
from isotruss_ros.core.numerics.tolerances import EPSILON
from isotruss_ros.core.statics.beam_column import BeamColumns, chord_stiffness, EndForces
from isotruss_ros.core.statics.frame_assembly import FrameAssembly
from isotruss_ros.core.statics.frame_pattern import Chains
import numpy as np
from scipy.sparse import csc_matrix

#: Relative error of responses if they are linearised about another state, per displacement of a
#: node between both states [1/m]. If the displacements of a state are predicted from another
#: state, their error is this factor times the square of the displacement between both states.
TUBE_CURVATURE = 15.0


class CondensedChains(NamedTuple):
    """
    Group of b cut members; static condensation has eliminated the nodes at their p cuts.

    :ivar chains: the cut members.
    :ivar inverse: (b, 3 p, 3 p) displacements of the nodes at the cuts due to unit loads on them,
        with fixed member ends.
    :ivar spread: (b, 3 p, 6) displacements of these nodes due to unit displacements of the ends.
    :ivar stiffness: (b, 3 p, 3 p) inverse of `inverse`.
    """

    chains: Chains
    inverse: Array
    spread: Array
    stiffness: Array


class Slopes(NamedTuple):
    """
    Inclinations of the bent centre lines at p ends of members, and their derivatives.

    :ivar values: (p,) inclinations [rad].
    :ivar by_ends: (p, 1, 6) derivatives of the inclinations by (ux, uy, theta) at start and end.
    :ivar by_forces: (p, 3) derivatives of the inclinations by `EndForces.values` with fixed nodes.
    :ivar by_shear: (p,) derivatives of the inclinations by the logarithm of GA with fixed nodes
        and constant forces.
    """

    values: Array
    by_ends: Array
    by_forces: Array
    by_shear: Array


class FactoredFrame(NamedTuple):
    """
    Factorised matrix of (4), which similar states use instead of their own, see `Tangent.borrow`.

    :ivar factor: factorisation of the scaled matrix.
    :ivar scale: (f + c,) scaling of its rows and columns: f unknown displacements, c constraints.
    :ivar points: (n,) positions of the displaced nodes, see `Tangent.points` [m].
    """

    factor: Factor
    scale: Array
    points: Points


@dataclass(frozen=True, eq=False)
class Tangent:
    """
    Frame linearised about displacements of its nodes (corotational formulation).

    :ivar displacements: (n, 3) displacements ux, uy [m], theta [rad].
    :ivar multipliers: (c,) Lagrange multipliers of the constraints.
    :ivar axis: (k,) unit vectors of the chords, x + iy.
    :ivar length: (k,) lengths of the chords [m].
    :ivar forces: axial forces and end moments of the members.
    :ivar motions: (k, 4, 6) derivatives of the chords, see `chord_motions`.
    :ivar stretched: (k,) elongations [m], and (k, 2) rotations s and b, see `EndForces` [rad].
    """

    displacements: Array
    multipliers: Array
    axis: Points
    length: Array
    motions: Array
    stretched: tuple[Array, Array]
    forces: EndForces
    _constraints: tuple[Array, Array, Points]  # see `TurnRows.linearize`
    _frame: FrameAssembly

    @cached_property
    def _condensed(self) -> tuple[Array, list[CondensedChains]]:
        """Return the stiffness (k, 6, 6) of uncut members, and the condensed chains."""
        core = chord_stiffness(self.length, self.forces)
        matrices = self.motions.swapaxes(1, 2) @ core @ self.motions
        try:
            chains = [_condense(matrices, chain) for chain in self._frame.chains]
        except np.linalg.LinAlgError as error:
            raise StructureError(
                'a loaded member has no stiffness in its bent shape: its loads must be smaller'
            ) from error
        return matrices[: self._frame.pattern.count], chains

    @cached_property
    def chains(self) -> list[CondensedChains]:
        """Return the cut members after static condensation of the nodes at the cuts."""
        return self._condensed[1]

    @cached_property
    def system(self) -> tuple[Array | csc_matrix, Array]:
        """
        Return the scaled matrix of (4), and the scaling (f + c,) of its rows and columns.

        The displacements of nodes at cuts are eliminated.
        """
        values, _, spans = self._constraints
        curvature = self._frame.rows.curvature(spans, self.multipliers)
        return self._frame.assemble(self._condensed[0], values, curvature)

    @cached_property
    def factored(self) -> FactoredFrame:
        """
        Return the factorisation of the scaled matrix of (4), see `system`.

        :raises StructureError: the structure has no stiffness in its bent shape.
        """
        matrix, scale = self.system
        try:
            return FactoredFrame(factorize(matrix.copy()), scale, self.points)
        except np.linalg.LinAlgError as error:
            raise StructureError(
                'the structure has no stiffness in its bent shape: the loads must be smaller'
            ) from error

    def respond(self, loads: Array, gaps: Array | float = 0.0) -> tuple[Array, Array]:
        """
        Return the changes of displacements (3 n, p) and multipliers (c, p) due to p load cases.

        :param loads: (3 n, p) additional loads, one column each [N, N m].
        :param gaps: (c, p) changes of the right-hand sides of the constraints.
        """
        borne = loads
        if self.chains:
            borne = loads.copy()
            for (_, inner, ends), _, spread, _ in self.chains:
                borne[ends] += spread.swapaxes(1, 2) @ loads[inner]
        solved, (factor, scaling, _) = self._frame.pattern.solved, self.factored
        free, scale = len(solved), scaling[:, None]
        right = np.empty((len(scale), loads.shape[1]))
        right[:free], right[free:] = borne[solved], gaps
        right *= scale
        found = factor.solve(right)
        found *= scale
        moved = np.zeros_like(loads)
        moved[solved] = found[:free]
        for (_, inner, ends), inverse, spread, _ in self.chains:
            moved[inner] = inverse @ loads[inner] + spread @ moved[ends]
        return moved, found[free:]

    def balance(self, applied: Array, loads: Array | None = None) -> tuple[Array, Array]:
        """
        Return the changes due to additional loads, and the step to equilibrium as last column.

        :param applied: (3 n,) loads in the equilibrium [N, N m].
        :param loads: (3 n, p) additional loads, one column each; None: no additional loads.
        :return: changes (n, 3, p + 1) of displacements, and (c, p + 1) of multipliers.
        """
        left, gaps = applied - self.carried, self._constraints[1]
        columns = left[:, None] if loads is None else np.column_stack([loads, left])
        opened = np.zeros((len(gaps), columns.shape[1]))
        opened[:, -1] = -gaps
        moved, multipliers = self.respond(columns, opened)
        return moved.reshape(-1, 3, columns.shape[1]), multipliers

    def borrow(self, other: Tangent) -> None:
        """
        Use the factorised matrix of a similar state for the responses of this state.

        Call this method before any matrix of this frame is computed.

        :param other: frame linearised about the similar state; it may have other cuts.
        """
        frame, known, lender = self._frame, other._frame, other._linear
        kept = {'factored': other.factored, '_lent': lender}
        if np.array_equal(frame.whole, known.whole):
            kept['_condensed'] = other._condensed
        else:
            alike = np.flatnonzero(frame.uncut & known.uncut)
            own = self.motions, self.length, self.forces.stiffness
            motions, length, stiffness = mixed = [each.copy() for each in own]
            others = lender.motions, lender.length, lender.forces.stiffness
            for each, another in zip(mixed, others, strict=True):
                each[alike] = another[alike]
            forces = self.forces._replace(stiffness=stiffness)
            kept['_lent'] = replace(self, motions=motions, length=length, forces=forces)
        self.__dict__.update(kept)

    def response_error(self, state: Tangent) -> float:
        """
        Return the relative error of another state's responses if it uses this factorisation [-].

        :param state: frame linearised about the other state.
        """
        frame, known = state._frame, self._linear._frame
        moved = float(np.abs(state.points - self.factored.points).max())
        longer = 0.0
        if np.array_equal(frame.whole, known.whole):
            longer = float(np.abs(known.length / frame.length - 1.0).max())
        return TUBE_CURVATURE * moved + longer

    @property
    def _linear(self) -> Tangent:
        """Return the linearised frame whose factorised matrix `respond` uses, see `borrow`."""
        return self.__dict__.get('_lent', self)

    @cached_property
    def carried(self) -> Array:
        """Return the loads and reactions (3 n,) that hold the frame in this state [N, N m]."""
        # The force that closes the gap of a stiff member's elongation has the direction and the
        # stiffness of the factorised matrix; otherwise it would move soft members.
        every, lender, gap = slice(None), self._linear, self.forces.gap[:, None, None]
        pushed = self.nodal_forces(every, self.forces.stressed[:, :, None])
        pushed = pushed + lender.nodal_forces(every, gap * lender.forces.stiffness[:, :, :1])
        frame, size, values = self._frame, self.displacements.size, self._constraints[0]
        held = values * self.multipliers[frame.rows.row]
        return np.bincount(frame.places.ravel(), pushed.ravel(), size) + np.bincount(
            frame.rows.column, held, size
        )

    @cached_property
    def points(self) -> Points:
        """Return the displaced nodes (n,) of the uncut frame, x + iy [m]."""
        count = len(self._frame.points) - len(self._frame.nodes)
        return self._frame.points[:count] + self.displacements[:count] @ (1.0, 1j, 0.0)

    @property
    def end_forces(self) -> Array:
        """Return the forces (k, 6) of the nodes on the members, see `FrameState.end_forces`."""
        return end_forces(self.forces.values, self.length)

    def changed_forces(self, moved: Array) -> tuple[Array, Array]:
        """
        Return the forces (k, 3) and chord lengths (k,) after small displacements.

        For the forces see `EndForces`.

        :param moved: (n, 3) small displacements ux, uy [m], theta [rad] of all nodes.
        """
        # Forces of stiff members balance only with the stiffness that `respond` uses.
        changes, longer = self._linear.force_changes(moved[..., None])
        return self.forces.values + changes[..., 0], self.length + longer[:, 0]

    def force_rates(self, parts: Indices, changes: Array) -> Array:
        """
        Return the changes (p, 3, c) of the forces of p members due to changes of their sections.

        For the forces see `EndForces`. The nodes are fixed. Each of the c columns is one change.

        :param parts: (p,) indices of the members.
        :param changes: (4, p, c) changes of rest lengths [m], EA [N], EI [N m^2] and GA [N].
        """
        own, count = self._frame.members, changes.shape[2]
        each = parts.repeat(count)
        # Derivatives by complex steps have no rounding error of differences.
        steps = 1j * EPSILON * changes.reshape(4, -1)
        sections = np.stack([self._frame.length, own.axial, own.flexural, own.shear])
        pins = own.pinned_start[each], own.pinned_end[each]
        length, axial, flexural, shear = sections[:, each] + steps
        columns = BeamColumns(length, axial, flexural, shear, *pins)
        longer, turns = self.stretched
        known = self.forces.stressed[each, 0]
        found = columns.evaluate(longer[each] - steps[0], turns[each], known)
        rates = found.values.imag / EPSILON
        return rates.reshape(len(parts), count, 3).swapaxes(1, 2)

    def nodal_forces(self, parts: Indices | slice, rates: Array) -> Array:
        """
        Convert changes of `EndForces.values` to changes (p, 6, c) of end forces (fx, fy, m).

        :param parts: (p,) indices of the members.
        :param rates: (p, 3, c) changes of the members' forces.
        """
        return self.motions[parts, :3].swapaxes(1, 2) @ rates

    def slopes(self, parts: Indices, end: Indices) -> Slopes:
        """
        Return the inclinations of the bent centre lines at ends of members.

        The inclination is the rotation of the section minus the shear angle. Relative to the chord
        it is (t - Q/GA) / (1 + N/GA) with the section's rotation t relative to the chord and the
        transverse force Q.

        :param parts: (p,) indices of the members.
        :param end: (p,) 1 for a member's start, 2 for its end.
        """
        frame, length = self._frame, self.length[parts]
        shear, (pull, both, _) = frame.members.shear[parts], self.forces.values[parts].T
        across, sign = both / length, 3.0 - 2.0 * end
        softness = 1.0 + pull / shear
        sway, bow = self.stretched[1][parts].T
        inclined = (sway + sign * bow - across / shear) / softness
        aside, turned = -1.0 / (shear * softness), np.angle(self.axis[parts] / frame.axis[parts])
        by_forces = np.array([aside * inclined, aside / length, 0.0 * aside]).T
        by_chord = np.zeros((len(parts), 1, 4))
        by_chord[:, :, :3] = by_forces[:, None] @ self.forces.stiffness[parts]
        by_chord[:, 0, 0] -= aside * across / length
        by_chord[:, 0, 1] += 1.0 / softness
        by_chord[:, 0, 2] += sign / softness
        by_chord[:, 0, 3] = 1.0
        by_ends = by_chord @ self.motions[parts]
        return Slopes(turned + inclined, by_ends, by_forces, -aside * (across + pull * inclined))

    def force_changes(self, moved: Array) -> tuple[Array, Array]:
        """
        Return the changes of forces (k, 3, c) and chord lengths (k, c) due to node motion.

        For the forces see `EndForces`.

        :param moved: (n, 3, c) displacements of all nodes.
        """
        ends = moved.reshape(-1, moved.shape[2])[self._frame.places]
        chords = self.motions @ ends
        return self.forces.stiffness @ chords[:, :3], chords[:, 0]

    @property
    def is_stable(self) -> bool:
        """Return whether the frame's equilibrium is stable under the constraints."""
        chains = itertools.chain.from_iterable(each.stiffness for each in self.chains)
        softened = sum(count_negative_pivots(each, 0) for each in chains)
        negative = count_negative_pivots(self.system[0], self._frame.rows.count)
        return negative + softened == self._frame.rows.count


def end_forces(forces: Array, length: Array) -> Array:
    """
    Return the end forces (k, 6) of members, see `FrameState.end_forces`.

    :param forces: (k, 3) forces, see `EndForces`.
    :param length: (k,) lengths of the chords [m].
    """
    pull, both, apart = forces.T
    across, first, second = both / length, 0.5 * (both + apart), 0.5 * (both - apart)
    return np.stack([-pull, across, first, pull, -across, second], axis=1)


def _condense(matrices: Array, chains: Chains) -> CondensedChains:
    """
    Condense the stiffness of cut members to the displacements of their end nodes.

    :param matrices: (k, 6, 6) stiffness of all parts against (ux, uy, theta) at both ends. At the
        index of a member's first part, the condensed stiffness of the member is stored.
    :param chains: the cut members.
    """
    several, count = chains.parts.shape
    own, each = matrices[chains.parts], np.arange(count)
    whole = np.zeros((several, count + 1, 3, count + 1, 3))
    first, second = own[:, :, :3].swapaxes(0, 1), own[:, :, 3:].swapaxes(0, 1)
    whole[:, each, :, each], whole[:, each, :, each + 1] = first[..., :3], first[..., 3:]
    whole[:, each + 1, :, each] = second[..., :3]
    whole[:, each + 1, :, each + 1] += second[..., 3:]
    whole = whole.reshape(several, 3 * count + 3, -1)
    inner, ends = slice(3, -3), np.array([0, 1, 2, -3, -2, -1])
    stiffness, coupling = whole[:, inner, inner], whole[:, inner][:, :, ends]
    inverse = np.linalg.inv(stiffness)
    spread = -inverse @ coupling
    matrices[chains.parts[:, 0]] = whole[:, ends][:, :, ends] + coupling.swapaxes(1, 2) @ spread
    return CondensedChains(chains, inverse, spread, stiffness)
