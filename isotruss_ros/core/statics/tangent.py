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
from isotruss_ros.core.statics.beam_column import BeamColumns, EndForces
from isotruss_ros.core.statics.frame_assembly import FrameAssembly
from isotruss_ros.core.statics.frame_pattern import Chains
import numpy as np
from scipy.sparse import csc_matrix

#: Index of each entry of `chord_motions` in the list (0, 1, -1, x, y, -x, -y) of a direction (x,
#: y).
MOTION = np.array([[5, 6, 0, 3, 4, 0], [4, 5, 0, 6, 3, 0], [0, 0, 1, 0, 0, 0], [0, 0, 0, 0, 0, 1]])


class CondensedChains(NamedTuple):
    """
    Cut members of which the inner points are eliminated by static condensation.

    :ivar chains: the cut members.
    :ivar inverse: (b, 3 p, 3 p) displacements of the inner points due to unit loads on them, while
        the member ends are fixed.
    :ivar spread: (b, 3 p, 6) displacements of the inner points for unit displacements of the ends.
    :ivar stiffness: (b, 3 p, 3 p) stiffness of the inner points with fixed member ends.
    """

    chains: Chains
    inverse: Array
    spread: Array
    stiffness: Array


class FactoredFrame(NamedTuple):
    """
    Factorised matrix of (4), which is also used in similar states.

    :ivar factor: factor of the scaled matrix.
    :ivar scale: (f + c,) scaling of its rows and columns.
    :ivar points: (n,) displaced nodes, see `Tangent.points` [m].
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
    :ivar motions: (k, 4, 6) stretch, sway and end rotations for unit displacements of the ends.
    :ivar stretched: (k,) elongations [m], and (k, 2) end rotations relative to chords [rad].
    :ivar gaps: (c,) violations of the constraints.
    :ivar stiffness: (k, 4, 4) stiffness of the members against stretch, sway and end rotations.
    """

    displacements: Array
    multipliers: Array
    axis: Points
    length: Array
    motions: Array
    stretched: tuple[Array, Array]
    forces: EndForces
    gaps: Array
    stiffness: Array
    _pushed: Array  # the loads of `carried`, by the own members
    _frame: FrameAssembly
    _rows: tuple[Array, Array]  # entries of the constraints and their geometric stiffness

    @cached_property
    def _condensed(self) -> tuple[Array, list[CondensedChains]]:
        """Return the stiffness (k, 6, 6) of uncut members, and the condensed chains."""
        matrices = self.motions.transpose(0, 2, 1) @ self.stiffness @ self.motions
        try:
            chains = [_condense(matrices, chain) for chain in self._frame.chains]
        except np.linalg.LinAlgError as error:
            raise StructureError('a loaded member has no stiffness in its bent shape') from error
        return matrices[: self._frame.pattern.count], chains

    @cached_property
    def chains(self) -> list[CondensedChains]:
        """Return the cut members after static condensation."""
        return self._condensed[1]

    @cached_property
    def system(self) -> tuple[Array | csc_matrix, Array]:
        """
        Return the scaled matrix of (4), and the scaling (f + c,) of its rows and columns.

        In a cut frame the displacements of the cuts are eliminated.
        """
        return self._frame.assemble(self._condensed[0], *self._rows)

    @cached_property
    def factored(self) -> FactoredFrame:
        """
        Return the factorisation of the matrix of `system`.

        :raises StructureError: the structure has no stiffness in its bent shape.
        """
        matrix, scale = self.system
        try:
            return FactoredFrame(factorize(matrix.copy()), scale, self.points)
        except np.linalg.LinAlgError as error:
            raise StructureError('the structure has no stiffness in its bent shape') from error

    def respond(self, loads: Array, gaps: Array | float = 0.0) -> tuple[Array, Array]:
        """
        Return the changes of displacements (3 n, p) and multipliers (c, p) due to p loads.

        :param loads: (3 n, p) additional loads, one column each [N, N m].
        :param gaps: (c, p) changes of the values that the constraints must have.
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

    def borrow(self, other: Tangent) -> None:
        """
        Use the factorised matrix of a similar state in place of this state's own.

        It must be called before any matrix of this frame is computed.

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

    @property
    def _linear(self) -> Tangent:
        """Return the linearised frame whose matrix `respond` uses: this or the borrowed one."""
        return self.__dict__.get('_lent', self)

    @cached_property
    def carried(self) -> Array:
        """Return the loads and reactions (3 n,) that hold the frame in this state [N, N m]."""
        if self._linear is self:
            return self._pushed
        # The missing elongation of a stiff member is the gap of a constraint: its force acts along
        # the member as it is factorised, or else it would move soft ones.
        frame, gap = self._frame, self.forces.gap[:, None, None]
        pushed = sum(
            sign * each.nodal_forces(slice(None), gap * each.forces.stiffness[:, :, :1])
            for each, sign in ((self._linear, 1.0), (self, -1.0))
        )
        return self._pushed + np.bincount(frame.places.ravel(), pushed.ravel(), len(self._pushed))

    @cached_property
    def points(self) -> Points:
        """Return the displaced nodes (n,) of the uncut frame, x + iy [m]."""
        count = len(self._frame.points) - len(self._frame.nodes)
        return self._frame.points[:count] + self.displacements[:count] @ (1.0, 1j, 0.0)

    @property
    def end_forces(self) -> Array:
        """Return the forces (k, 6) of the nodes on the members, see `FrameState.end_forces`."""
        return end_forces(self.forces.pull, self.forces.moments, self.length)

    def changed_forces(self, moved: Array) -> tuple[Array, Array]:
        """
        Return end forces (k, 6) and axial forces (k,) after small displacements of nodes.

        :param moved: (n, 3) small displacements ux, uy [m], theta [rad].
        """
        # Forces of stiff members are in balance only by the stiffness of the responses.
        changes, longer = self._linear.force_changes(moved[..., None])
        pull, moments = (
            self.forces.pull + changes[:, 0, 0],
            self.forces.moments + changes[:, 1:, 0],
        )
        return end_forces(pull, moments, self.length + longer[:, 0]), pull

    def force_rates(self, parts: Indices, changes: Array) -> Array:
        """
        Return the changes (p, 3, c) of (N, M1, M2) of p members due to changes of their sections.

        The nodes are fixed. Each of the c columns is one change.

        :param parts: (p,) indices of the members.
        :param changes: (4, p, c) changes of rest lengths [m], EA [N], EI [N m^2] and GA [N].
        """
        own, count = self._frame.members, changes.shape[2]
        each = parts.repeat(count)
        # Complex steps have no rounding error of differences.
        steps = 1j * EPSILON * changes.reshape(4, -1)
        sections = np.stack([self._frame.length, own.axial, own.flexural, own.shear])
        pins = own.pinned_start[each], own.pinned_end[each]
        length, axial, flexural, shear = sections[:, each] + steps
        columns = BeamColumns(length, axial, flexural, shear, *pins)
        longer, turns = self.stretched
        known = self.forces.stressed[0][each]
        found = columns.evaluate(longer[each] - steps[0], turns[each], known)
        rates = np.column_stack([found.pull, found.moments]).imag / EPSILON
        return rates.reshape(len(parts), count, 3).swapaxes(1, 2)

    def nodal_forces(self, parts: Indices, rates: Array) -> Array:
        """
        Convert changes of (N, M1, M2) to changes (p, 6, c) of end forces (fx, fy, m).

        :param parts: (p,) indices of the members.
        :param rates: (p, 3, c) changes of the members' N, M1 and M2.
        """
        pull, first, second = rates.swapaxes(0, 1)
        borne = -(first + second) / self.length[parts, None]
        ends = np.stack([pull, borne, first, second], axis=1)
        return self.motions[parts].swapaxes(1, 2) @ ends

    def slopes(self, parts: Indices, end: Indices) -> Array:
        """
        Return the inclinations of the bent centre lines at ends of members, (p,) [rad].

        The inclination is the rotation of the section minus the shear angle. Relative to the chord
        it is (t - Q/GA) / (1 + N/GA) with the transverse force Q.

        :param parts: (p,) indices of the members.
        :param end: (p,) 1 for a member's start, 2 for its end.
        """
        turned, skew, softness, *_ = self._shear(parts, end)
        return (turned + skew / softness)[:, 0]

    def slope_rates(
        self,
        parts: Indices,
        end: Indices,
        rates: Array,
        shear_rates: Array | float,
    ) -> Array:
        """
        Return the changes (p, c) of `slopes` caused by given changes of (N, M1, M2) and GA.

        The nodes are fixed. Each of the c columns is one change.

        :param parts: (p,) indices of the members.
        :param end: (p,) 1 for a member's start, 2 for its end.
        :param rates: (p, 3, c) changes of N, M1 and M2.
        :param shear_rates: (p, c) relative changes of GA.
        """
        _, skew, softness, shear, across = self._shear(parts, end)
        change = (rates[:, 1] + rates[:, 2]) / self.length[parts, None] - across * shear_rates
        pulled = rates[:, 0] - self.forces.pull[parts, None] * shear_rates
        return -(change + skew / softness * pulled) / shear / softness

    def force_changes(self, moved: Array) -> tuple[Array, Array]:
        """
        Return the changes of (N, M1, M2) (k, 3, c) and chord lengths (k, c) due to node motion.

        :param moved: (n, 3, c) displacements of all nodes.
        """
        chords, _ = self._chord_changes(slice(None), moved)
        return self.forces.stiffness @ chords, chords[:, 0]

    def _chord_changes(self, parts: Indices | slice, moved: Array) -> tuple[Array, Array]:
        """Return the changes (p, 3, c) of (l, t1, t2), and the rotations (p, c) of the chords."""
        ends = moved.reshape(-1, moved.shape[2])[self._frame.places[parts]]
        turns = self.motions[parts] @ ends
        turned = turns[:, 1] / self.length[parts, None]
        turns[:, 2:] -= turned[:, None]
        return turns[:, [0, 2, 3]], turned

    def slope_changes(self, parts: Indices, end: Indices, moved: Array) -> Array:
        """
        Return the changes (p, c) of `slopes` due to motion of the nodes.

        :param parts: (p,) indices of the members.
        :param end: (p,) 1 for a member's start, 2 for its end.
        :param moved: (n, 3, c) displacements of all nodes.
        """
        turns, turned = self._chord_changes(parts, moved)
        _, _, softness, shear, across = self._shear(parts, end)
        turning = turns[np.arange(len(parts)), end]
        turning += across / shear / self.length[parts, None] * turns[:, 0]
        rates = self.forces.stiffness[parts] @ turns
        return turned + turning / softness + self.slope_rates(parts, end, rates, 0.0)

    def _shear(self, parts: Indices, end: int) -> tuple[Array, ...]:
        """Return the chord's rotation, t - Q/GA, 1 + N/GA, GA and Q, (p, 1) each; see `slopes`."""
        shear, forces = self._frame.members.shear[parts], self.forces
        turned = np.angle(self.axis[parts] * self._frame.axis[parts].conj())
        across = forces.moments[parts].sum(axis=1) / self.length[parts]
        skew = self.stretched[1][parts, end - 1] - across / shear
        every = turned, skew, 1.0 + forces.pull[parts] / shear, shear, across
        return tuple(each[:, None] for each in every)

    @property
    def is_stable(self) -> bool:
        """Return whether the equilibrium is stable under the constraints."""
        chains = itertools.chain.from_iterable(each.stiffness for each in self.chains)
        softened = sum(count_negative_pivots(each, 0) for each in chains)
        negative = count_negative_pivots(self.system[0], self._frame.rows.count)
        return negative + softened == self._frame.rows.count


def end_forces(pull: Array, moments: Array, length: Array) -> Array:
    """
    Return the end forces (k, 6) of members, see `FrameState.end_forces`.

    :param pull: (k,) axial forces N [N].
    :param moments: (k, 2) moments at start and end [N m].
    :param length: (k,) lengths of the chords [m].
    """
    across, (first, second) = moments.sum(axis=1) / length, moments.T
    return np.stack([-pull, across, first, pull, -across, second], axis=1)


def _condense(matrices: Array, chains: Chains) -> CondensedChains:
    """
    Eliminate inner points of cut members; `matrices` of first parts become the condensed ones.

    :param matrices: (k, 6, 6) stiffness of all parts against (ux, uy, theta) at both ends.
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


def chord_motions(direction: Points) -> Array:
    """
    Return the derivatives of stretch, sway and end rotations of chords by end displacements.

    :param direction: (k,) unit vectors of the chords, x + iy.
    :return: (k, 4, 6) derivatives with respect to (ux, uy, theta) at start and end.
    """
    x, y = direction.real, direction.imag
    values = np.zeros((7, len(direction)))
    values[1], values[2], values[3:] = 1.0, -1.0, (x, y, -x, -y)
    return values.T.take(MOTION, axis=1)
