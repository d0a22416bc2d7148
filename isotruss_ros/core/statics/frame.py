# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Plane frames of beam-columns, pinned or fixed to nodes, with constraints: (1) and (4).

`Frame.solve` is linear about the unloaded frame, as in the paper. `Frame.bend` finds the
equilibrium of the bent frame by Newton's method; its first step is `Frame.solve`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
import itertools
from typing import NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.kinematics.constraints import MAX_DENSE_COORDINATES
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.numerics.factorization import (
    count_negative_pivots,
    Factor,
    factorize,
    factorize_with_condition,
    invert_symmetric,
)
from isotruss_ros.core.numerics.tolerances import MAX_CONDITION, MAX_NEWTON_ITERATIONS
from isotruss_ros.core.statics.beam_column import (
    BeamColumns,
    CHORD,
    chord_stiffness,
    EndForces,
    evaluate_rates,
)
from isotruss_ros.core.statics.frame_pattern import (
    Chains,
    FramePattern,
    LinearRows,
    Members,
    NO_ROWS,
    TurnRows,
)
import numpy as np
from scipy.sparse import coo_matrix, csc_matrix

#: Largest ratio of the displacements to those of the linear frame [-].
MAX_GROWTH = 1.5
#: Largest last step of Newton's method [m]; the remaining error is rounding.
STEP_TOLERANCE = 1e-7
#: Index of each entry of `chord_motions` in the list (0, 1, -1, x, y, -x, -y) of a direction (x,
#: y).
MOTION = np.array([[5, 6, 0, 3, 4, 0], [4, 5, 0, 6, 3, 0], [0, 0, 1, 0, 0, 0], [0, 0, 0, 0, 0, 1]])


@dataclass(frozen=True, eq=False)
class FrameState:
    """
    The response of a frame to its loads.

    :ivar displacements: (n, 3) displacements ux, uy [m], theta [rad]; theta is zero at nodes with
        pinned members only.
    :ivar reactions: (n, 3) forces fx, fy [N] and moments m [N m] of the supports on the frame;
        zero at nodes without support.
    :ivar end_forces: (k, 6) forces of the nodes on the members at start and end: along the chord,
        across it [N], and moment [N m].
    :ivar multipliers: (c,) multipliers of the constraints.
    :ivar bowing: (k,) axial forces that amplify moments inside members [N]; zero if linear.
    """

    displacements: Array
    reactions: Array
    end_forces: Array
    multipliers: Array
    bowing: Array


class CondensedChains(NamedTuple):
    """
    Cut members whose inner points are eliminated by static condensation.

    :ivar chains: the cut members.
    :ivar inverse: (b, 3 p, 3 p) displacements of the inner points by their loads, ends fixed.
    :ivar spread: (b, 3 p, 6) displacements of the inner points by those of the ends.
    :ivar stiffness: (b, 3 p, 3 p) stiffness of the inner points with fixed member ends.
    """

    chains: Chains
    inverse: Array
    spread: Array
    stiffness: Array


class FactoredFrame(NamedTuple):
    """
    The factored matrix of (4), for responses in near states as well.

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
    Frame linearised about displacements of its nodes; members turn with their chords.

    :ivar displacements: (n, 3) displacements ux, uy [m], theta [rad].
    :ivar multipliers: (c,) multipliers of the constraints.
    :ivar axis: (k,) unit vectors of the chords, x + iy.
    :ivar length: (k,) lengths of the chords [m].
    :ivar forces: forces of the members.
    :ivar motions: (k, 4, 6) stretch, sway and end rotations by displacements of the ends.
    :ivar stretched: (k,) elongations [m], and (k, 2) end rotations relative to chords [rad].
    :ivar gaps: (c,) violations of the constraints.
    :ivar stiffness: (k, 4, 4) stiffness of the members by stretch, sway and end rotations.
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
    _frame: Frame
    _rows: tuple[Array, Array]  # entries of the constraints and their geometric stiffness

    @cached_property
    def _condensed(self) -> tuple[Array, list[CondensedChains]]:
        """Return the stiffness (k, 6, 6) of members by their ends, and the condensed chains."""
        matrices = self.motions.transpose(0, 2, 1) @ self.stiffness @ self.motions
        try:
            chains = [_condense(matrices, chain) for chain in self._frame.chains]
        except np.linalg.LinAlgError as error:
            raise StructureError('a loaded member has no stiffness in its bent shape') from error
        return matrices[: self._frame.pattern.count], chains

    @property
    def chains(self) -> list[CondensedChains]:
        """Return the cut members with their condensation."""
        return self._condensed[1]

    @cached_property
    def system(self) -> tuple[Array | csc_matrix, Array]:
        """
        Return the scaled matrix of (4), and the scaling (f + c,) of its rows and columns.

        In a cut frame the displacements of the cuts are eliminated.
        """
        return self._frame._assemble(self._condensed[0], *self._rows)

    @cached_property
    def factored(self) -> FactoredFrame:
        """
        Return the factorised matrix of `system`.

        :raises StructureError: the structure has no stiffness in its bent shape.
        """
        matrix, scale = self.system
        try:
            return FactoredFrame(factorize(matrix.copy()), scale, self.points)
        except np.linalg.LinAlgError as error:
            raise StructureError('the structure has no stiffness in its bent shape') from error

    def respond(self, loads: Array, gaps: Array | float = 0.0) -> tuple[Array, Array]:
        """
        Return the displacements (3 n, p) and multipliers (c, p) under further loads.

        :param loads: (3 n, p) loads [N], [N m].
        :param gaps: (c, p) openings of the constraints.
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
        Use the factorised matrix of the frame in a similar state; called first.

        :param other: frame linearised about the similar state, with any cuts.
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
        """Return the frame with the members by which `respond` is."""
        return self.__dict__.get('_lent', self)

    @cached_property
    def carried(self) -> Array:
        """Return loads and reactions (3 n,) in equilibrium with these displacements [N, N m]."""
        if self._linear is self:
            return self._pushed
        # The missing elongation of a stiff member is the gap of a constraint: its force acts along
        # the member as it is factorised, or else it would move soft ones.
        frame, gap = self._frame, self.forces.gap[:, None, None]
        pushed = sum(
            sign * frame.nodal_forces(each, slice(None), gap * each.forces.stiffness[:, :, :1])
            for each, sign in ((self._linear, 1.0), (self, -1.0))
        )
        return self._pushed + np.bincount(frame.places.ravel(), pushed.ravel(), len(self._pushed))

    @property
    def points(self) -> Points:
        """Return the displaced nodes (n,) without points inside members, x + iy [m]."""
        count = len(self._frame.points) - len(self._frame.nodes)
        return self._frame.points[:count] + self.displacements[:count] @ (1.0, 1j, 0.0)

    @property
    def end_forces(self) -> Array:
        """Return the forces of the nodes on the members, see `FrameState`."""
        return end_forces(self.forces.pull, self.forces.moments, self.length)

    def changed_forces(self, moved: Array) -> tuple[Array, Array]:
        """
        Return end forces (k, 6) and axial forces (k,) after small displacements of nodes.

        :param moved: (n, 3) small displacements ux, uy [m], theta [rad].
        """
        # Forces of stiff members are in balance only by the stiffness of the responses.
        changes, longer = self._frame.force_changes(self._linear, moved[..., None])
        pull, moments = (
            self.forces.pull + changes[:, 0, 0],
            self.forces.moments + changes[:, 1:, 0],
        )
        return end_forces(pull, moments, self.length + longer[:, 0]), pull


class Frame:
    """
    Frame of beam-columns; the matrix of its unloaded state is factorised once.

    :ivar points: (n,) nodes x + iy [m].
    :ivar members: members between the nodes.
    :ivar length: (k,) lengths of the members [m].
    :ivar axis: (k,) unit vectors of the members from start to end, x + iy.
    :ivar rows: linear constraints on displacements, or constraints on rotations of spans.
    :ivar whole: (k,) index of the uncut frame's member of which each member is a part.
    :ivar held: (n, 3) mask of ux, uy, theta fixed by supports.
    :ivar pattern: sparsity pattern of the frame; for a cut frame, of the uncut frame.
    :ivar places: (k, 6) indices of the displacements of the members' ends.
    :ivar chains: members of the uncut frame that are cut here.
    :ivar begins: (k,) distance of each member's start from the start of the uncut member [m].
    :ivar nodes: (c,) indices of the nodes at the cuts.
    :ivar before: (c,) indices of the members that end at the cuts.
    :ivar behind: (c,) indices of the members that begin at the cuts.
    :param points: (n,) nodes x + iy [m].
    :param members: members between the nodes.
    :param held: (n, 3) mask of ux, uy, theta fixed by supports.
    :param names: (n,) names of the nodes for error messages.
    :param rows: linear constraints on displacements, or constraints on rotations of spans.
    :param pattern: pattern of a frame with the same connections and supports; None: computed.
    :param rated: see `BeamColumns`.
    """

    def __init__(
        self,
        points: Points,
        members: Members,
        held: Flags,
        names: Sequence[str],
        rows: LinearRows | TurnRows = NO_ROWS,
        pattern: FramePattern | None = None,
        rated: bool = False,
    ) -> None:
        self.points = points
        self.members = members
        self.names = names
        self.held = held
        self.rows = rows
        span = points[members.end] - points[members.start]
        self.length = length = np.abs(span)
        self.axis = span / length
        self._rated = rated
        self.pattern = pattern or FramePattern(members, held, rows)
        self.places = self.pattern.places
        self.chains: tuple[Chains, ...] = ()
        self.whole, self.begins = np.arange(len(length)), np.zeros(len(length))
        self.nodes = self.before = self.behind = np.zeros(0, dtype=np.intp)

    @cached_property
    def _columns(self) -> BeamColumns:
        return BeamColumns(self.length, *self.members[2:], rated=self._rated)

    @cached_property
    def uncut(self) -> Flags:
        """Return the mask of the members of the uncut frame that are in one part."""
        return np.bincount(self.whole) == 1

    @property
    def straight(self) -> Tangent:
        """Return the frame linearised without loads, not factored."""
        return self.tangent(np.zeros((len(self.points), 3)), np.zeros(self.rows.count))

    @cached_property
    def rest(self) -> Tangent:
        """
        Return the frame linearised about its unloaded state, (4).

        :raises StructureError: the frame is a mechanism; names the nodes that move.
        """
        tangent = self.straight
        matrix, scale = tangent.system
        factor, condition = factorize_with_condition(matrix)
        if factor is None or not condition < MAX_CONDITION:
            moving = ', '.join(self._what_moves(matrix, scale))
            raise StructureError(
                f'the structure is a mechanism: {moving} can move without resistance; '
                'support it or connect it'
            )
        tangent.__dict__['factored'] = FactoredFrame(factor, scale, tangent.points)
        return tangent

    def tangent(
        self, displacements: Array, multipliers: Array, pull: Array | None = None
    ) -> Tangent:
        """
        Linearise the frame about displacements.

        :param displacements: (n, 3) displacements ux, uy [m], theta [rad].
        :param multipliers: (c,) multipliers of the constraints.
        :param pull: (k,) axial forces [N], see `BeamColumns.evaluate`; None: computed.
        """
        rows, size = self.rows, displacements.size
        ends = displacements.ravel()[self.places]
        apart = (ends[:, 3] - ends[:, 0] + 1j * (ends[:, 4] - ends[:, 1])) * self.axis.conj()
        span = self.length + apart
        length = np.abs(span)
        axis = self.axis * span / length
        # Of the two lengths, without the rounding of their difference.
        longer = (2.0 * self.length * apart.real + np.abs(apart) ** 2) / (length + self.length)
        stretched = longer, ends[:, 2::3] - np.angle(span)[:, None]
        forces = self._columns.evaluate(*stretched, pull)
        motions = chord_motions(axis)
        values, gaps, pairs = rows.linearize(self.points, displacements, multipliers)
        borne = -forces.moments.sum(axis=1) / length
        pushed = (np.array([forces.pull, borne, *forces.moments.T]).T[:, None] @ motions)[:, 0]
        carried = np.bincount(self.places.ravel(), pushed.ravel(), minlength=size)
        carried += np.bincount(rows.column, values * multipliers[rows.row], minlength=size)
        return Tangent(
            displacements,
            multipliers,
            axis,
            length,
            motions,
            stretched,
            forces,
            gaps,
            chord_stiffness(length, forces),
            carried,
            self,
            (values, pairs),
        )

    def _assemble(
        self, matrices: Array, values: Array, pairs: Array
    ) -> tuple[Array | csc_matrix, Array]:
        """Return the scaled matrix of (4), [[S, A^T], [A, 0]], and its scaling."""
        pattern = self.pattern
        free, size = len(pattern.solved), len(pattern.solved) + self.rows.count
        diagonal = np.bincount(
            pattern.places.ravel(),
            matrices.diagonal(axis1=1, axis2=2).ravel(),
            minlength=len(pattern.unknowns),
        )
        # Both directions of a node alike: what rounding leaves across a bar is no stiffness.
        diagonal[0::3] = diagonal[1::3] = np.maximum(diagonal[0::3], diagonal[1::3])
        diagonal = diagonal[pattern.solved]
        # Displacements and rotations, soft tubes and hard modules: scaled, all have stiffness 1.
        scale = np.ones(size)
        scale[:free] = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, diagonal.max(initial=1.0)))
        entries = matrices.ravel()[pattern.entries]
        weight = values[pattern.weights]
        if self.rows.count:
            scaled = weight * scale[pattern.bound]
            norms = np.bincount(pattern.multiplier, scaled**2, minlength=size)[free:]
            scale[free:] = 1.0 / np.sqrt(np.where(norms > 0.0, norms, 1.0))
        entries = np.concatenate([entries, weight, weight, pairs.ravel()[pattern.curved]])
        entries *= scale[pattern.matrix_rows] * scale[pattern.matrix_columns]
        if size <= MAX_DENSE_COORDINATES:
            flat = np.bincount(pattern.flat_places, entries, minlength=size * size)
            return flat.reshape(size, size), scale
        places = pattern.matrix_rows, pattern.matrix_columns
        return coo_matrix((entries, places), shape=(size, size)).tocsc(), scale

    def _what_moves(self, matrix: Array | csc_matrix, scale: Array) -> list[str]:
        """Return the names of the nodes that move in the mechanisms of a singular frame."""
        dense = matrix if isinstance(matrix, np.ndarray) else matrix.toarray()
        values, vectors = np.linalg.eigh(dense)
        loose = np.abs(values) < np.abs(values).max() / MAX_CONDITION**0.5
        loose[np.abs(values).argmin()] = True
        unknown = self.pattern.unknowns
        motion = np.abs(scale[:, None] * vectors[:, loose]).max(axis=1)
        by_node = np.where(unknown >= 0, motion[unknown], 0.0).reshape(-1, 3).max(axis=1)
        return [self.names[i] for i in np.flatnonzero(by_node > 1e-3 * by_node.max())]

    def solve(self, loads: Array) -> FrameState:
        """
        Return displacements, reactions and member forces under loads, by the linear frame (4).

        :param loads: (n, 3) loads fx, fy [N], m [N m] on the nodes.
        :raises StructureError: the frame is a mechanism (names moving nodes), or the loads
            overflow.
        """
        rest, flat = self.rest, loads.ravel()
        moved, multipliers = (each[:, 0] for each in rest.respond(flat[:, None]))
        with np.errstate(over='ignore', invalid='ignore'):
            motions = rest.motions @ moved[self.places][:, :, None]
            forces = rest.stiffness @ motions
            end_forces = (CHORD.T @ forces)[:, :, 0]
        if not np.isfinite(end_forces).all():
            raise StructureError(
                f'loads up to {np.abs(loads).max():.3g} N: what they do is beyond all numbers; '
                'must be smaller'
            )
        pushed = rest.motions.transpose(0, 2, 1) @ forces
        carried = np.bincount(self.places.ravel(), pushed.ravel(), minlength=len(flat))
        values, *_ = self.rows.linearize(self.points, np.zeros_like(loads), multipliers)
        pushed = values * multipliers[self.rows.row]  # by the constraints
        carried += np.bincount(self.rows.column, pushed, minlength=len(flat))
        return FrameState(
            moved.reshape(-1, 3),
            self._reactions(carried - flat),
            end_forces,
            multipliers,
            np.zeros(len(self.length)),
        )

    def bend(
        self, loads: Array, start: Tangent | None = None, growth: float = MAX_GROWTH
    ) -> Tangent | None:
        """
        Return the bent frame in equilibrium under loads (Newton's method).

        :param loads: (n, 3) loads fx, fy [N], m [N m] on the nodes.
        :param start: frame linearised about the initial state; None: about the unloaded state.
        :param growth: largest ratio of the displacements to those of the linear frame [-].
        :return: the frame linearised about its equilibrium; None if there is none near.
        :raises StructureError: the frame is a mechanism.
        """
        tangent = self.rest if start is None else start
        origin, reach = tangent.displacements, np.inf
        for count in range(MAX_NEWTON_ITERATIONS):
            left = (loads.ravel() - tangent.carried)[:, None]
            step, multipliers = tangent.respond(left, -tangent.gaps[:, None])
            displacements = tangent.displacements + step.reshape(-1, 3)
            size = float(np.abs(step.reshape(-1, 3)[:, :2]).max())
            if count == 0:
                reach = size
            # What ends elsewhere than the linear response tends to is another branch.
            elif not np.abs(displacements - origin)[:, :2].max() <= growth * reach:
                return None
            changes, _ = self.force_changes(tangent, step.reshape(-1, 3, 1))
            pull = tangent.forces.pull + changes[:, 0, 0]
            with np.errstate(over='ignore', invalid='ignore', divide='ignore'):
                tangent = self.tangent(
                    displacements, tangent.multipliers + multipliers[:, 0], pull
                )
            if size <= STEP_TOLERANCE:
                return tangent
        return None

    def locate(self, piece: Indices, within: Array) -> tuple[Indices, Array]:
        """
        Return the member (c,) at each point, and the distance (c,) from its start [m].

        :param piece: (c,) index of the member of the uncut frame at each point.
        :param within: (c,) distances of the points from the starts of these members [m].
        """
        return piece, within

    def interpolate(self, displacements: Array, piece: Indices, within: Array) -> Array:
        """
        Return the displacements (c, 3) of points inside members, by cubic centre lines.

        :param displacements: (n, 3) displacements ux, uy [m], theta [rad] of the nodes.
        :param piece: (c,) index of the member of the uncut frame at each point.
        :param within: (c,) distances of the points from the starts of these members [m].
        """
        part, inside = self.locate(piece, within)
        start, end = displacements[self.members.start[part]], displacements[self.members.end[part]]
        axis, length = self.axis[part], self.length[part]
        first = (start[:, 0] + 1j * start[:, 1]) * axis.conj()
        apart = (end[:, 0] + 1j * end[:, 1]) * axis.conj() - first
        chord = length + apart
        turned, x = np.angle(chord), inside / length
        before, after = start[:, 2] - turned, end[:, 2] - turned
        own = self.members
        skew = 12.0 * own.flexural[part] / own.shear[part] / length**2
        follows = -(2.0 - skew) / (4.0 + skew)  # of a pinned end
        before = np.where(own.pinned_start[part], follows * after, before)
        after = np.where(own.pinned_end[part], follows * before, after)
        even, odd = before + after, before - after
        bow = 0.5 * x * (1.0 - x) * (odd + (1.0 - 2.0 * x) / (1.0 + skew) * even)
        slope = 0.5 * ((1.0 - 2.0 * x) * odd + (1.0 - 6.0 * x * (1.0 - x) / (1.0 + skew)) * even)
        moved = axis * (first + x * apart + 1j * bow * chord)
        return np.stack([moved.real, moved.imag, turned + slope], axis=1)

    def force_rates(self, tangent: Tangent, parts: Indices, changes: Array) -> Array:
        """
        Return the changes (p, 3, c) of (N, M1, M2) of p members while the nodes are fixed.

        :param tangent: linearised frame.
        :param parts: (p,) indices of the members.
        :param changes: (4, p, c) changes of rest lengths [m], EA [N], EI [N m^2] and GA [N].
        """
        own, count = self.members, changes.shape[2]
        each = parts.repeat(count)
        values = self.length[each], own.axial[each], own.flexural[each], own.shear[each]
        pins = own.pinned_start[each], own.pinned_end[each]
        longer, turns = tangent.stretched
        found = evaluate_rates(values, pins, changes.reshape(4, -1), turns[each], longer[each])
        return found.reshape(len(parts), count, 3).swapaxes(1, 2)

    def nodal_forces(self, tangent: Tangent, parts: Indices, rates: Array) -> Array:
        """
        Return the changes (p, 6, c) of the members' end forces, as components in the plane.

        :param tangent: linearised frame.
        :param parts: (p,) indices of the members.
        :param rates: (p, 3, c) changes of the members' N, M1 and M2.
        """
        pull, first, second = rates.swapaxes(0, 1)
        borne = -(first + second) / tangent.length[parts, None]
        ends = np.stack([pull, borne, first, second], axis=1)
        return tangent.motions[parts].swapaxes(1, 2) @ ends

    def slopes(self, tangent: Tangent, parts: Indices, end: Indices) -> Array:
        """
        Return the inclinations of the bent centre lines at ends of members, (p,) [rad].

        It is the rotation of the section less its shear angle. Relative to the chord it is (t -
        Q/GA) / (1 + N/GA) with the transverse force Q.

        :param tangent: linearised frame.
        :param parts: (p,) indices of the members.
        :param end: (p,) 1 for a member's start, 2 for its end.
        """
        turned, skew, softness, _ = self._shear(tangent, parts, end)
        return turned + skew / softness

    def slope_rates(
        self,
        tangent: Tangent,
        parts: Indices,
        end: Indices,
        rates: Array,
        shear_rates: Array | float,
    ) -> Array:
        """
        Return the changes (p, c) of `slopes` by (N, M1, M2) and GA while the nodes are fixed.

        :param tangent: linearised frame.
        :param parts: (p,) indices of the members.
        :param end: (p,) 1 for a member's start, 2 for its end.
        :param rates: (p, 3, c) changes of N, M1 and M2.
        :param shear_rates: (p, c) relative changes of GA.
        """
        _, skew, softness, shear = (x[:, None] for x in self._shear(tangent, parts, end))
        across = tangent.forces.moments[parts].sum(axis=1)[:, None] / tangent.length[parts, None]
        change = (rates[:, 1] + rates[:, 2]) / tangent.length[parts, None] - across * shear_rates
        pulled = rates[:, 0] - tangent.forces.pull[parts, None] * shear_rates
        return -(change + skew / softness * pulled) / shear / softness

    def force_changes(self, tangent: Tangent, moved: Array) -> tuple[Array, Array]:
        """
        Return the changes of (N, M1, M2) (k, 3, c) and chord lengths (k, c) by node motion.

        :param tangent: linearised frame.
        :param moved: (n, 3, c) displacements of all nodes.
        """
        chords, _ = self._chord_changes(tangent, slice(None), moved)
        return tangent.forces.stiffness @ chords, chords[:, 0]

    def _chord_changes(
        self, tangent: Tangent, parts: Indices | slice, moved: Array
    ) -> tuple[Array, Array]:
        """Return changes of (l, t1, t2) (p, 3, c), and rotations of the chords (p, c)."""
        ends = moved.reshape(-1, moved.shape[2])[self.places[parts]]
        turns = tangent.motions[parts] @ ends
        turned = turns[:, 1] / tangent.length[parts, None]
        turns[:, 2:] -= turned[:, None]
        return turns[:, [0, 2, 3]], turned

    def slope_changes(self, tangent: Tangent, parts: Indices, end: Indices, moved: Array) -> Array:
        """
        Return the changes (p, c) of `slopes` by motion of the nodes.

        :param tangent: linearised frame.
        :param parts: (p,) indices of the members.
        :param end: (p,) 1 for a member's start, 2 for its end.
        :param moved: (n, 3, c) displacements of all nodes.
        """
        turns, turned = self._chord_changes(tangent, parts, moved)
        longer, length = turns[:, 0], tangent.length[parts, None]
        forces = tangent.forces.stiffness[parts] @ turns
        _, skew, softness, shear = self._shear(tangent, parts, end)
        across = tangent.forces.moments[parts].sum(axis=1)[:, None] / length
        change = (forces[:, 1] + forces[:, 2] - across * longer) / length
        skewed = (skew / softness)[:, None]
        slope = (
            turns[np.arange(len(parts)), end] - (change + skewed * forces[:, 0]) / shear[:, None]
        )
        return turned + slope / softness[:, None]

    def _shear(
        self, tangent: Tangent, parts: Indices, end: int
    ) -> tuple[Array, Array, Array, Array]:
        """Return the chord's rotation, t - Q/GA, 1 + N/GA and GA, (p,) each; see `slopes`."""
        shear, forces = self.members.shear[parts], tangent.forces
        turned = np.angle(tangent.axis[parts] * self.axis[parts].conj())
        across = forces.moments[parts].sum(axis=1) / tangent.length[parts]
        skew = tangent.stretched[1][parts, end - 1] - across / shear
        return turned, skew, 1.0 + forces.pull[parts] / shear, shear

    def is_stable(self, tangent: Tangent) -> bool:
        """
        Return whether the equilibrium is stable under the constraints.

        :param tangent: frame linearised about the equilibrium.
        """
        chains = itertools.chain.from_iterable(each.stiffness for each in tangent.chains)
        softened = sum(count_negative_pivots(each, 0) for each in chains)
        negative = count_negative_pivots(tangent.system[0], self.rows.count)
        return negative + softened == self.rows.count

    def state(self, tangent: Tangent, loads: Array) -> FrameState:
        """
        Return the response of the bent frame.

        :param tangent: frame linearised about its equilibrium.
        :param loads: (n, 3) loads fx, fy [N], m [N m] on the nodes.
        """
        return FrameState(
            tangent.displacements,
            self._reactions(tangent.carried - loads.ravel()),
            tangent.end_forces,
            tangent.multipliers,
            tangent.forces.pull,
        )

    def _reactions(self, missing: Array) -> Array:
        """Return the support reactions (n, 3) from the residual of the balance (3 n,)."""
        return np.where(self.held.ravel(), missing, 0.0).reshape(-1, 3)


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
    Eliminate the inner points of cut members; each first part gets the condensed stiffness.

    :param matrices: (k, 6, 6) stiffness of all parts, in the plane.
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
    inverse = invert_symmetric(stiffness)
    spread = -inverse @ coupling
    matrices[chains.parts[:, 0]] = whole[:, ends][:, :, ends] + coupling.swapaxes(1, 2) @ spread
    return CondensedChains(chains, inverse, spread, stiffness)


def chord_motions(direction: Points) -> Array:
    """
    Return stretch and sway of chords and rotations of their ends, by displacements of the ends.

    :param direction: (k,) unit vectors of the chords, x + iy.
    :return: (k, 4, 6) derivatives by (ux, uy, theta) at start and end.
    """
    x, y = direction.real, direction.imag
    values = np.zeros((7, len(direction)))
    values[1], values[2], values[3:] = 1.0, -1.0, (x, y, -x, -y)
    return values.T.take(MOTION, axis=1)
