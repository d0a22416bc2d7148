# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Plane frames of beam-columns, pinned or fixed to nodes, with constraints: (1) and (4).

`solve` is linear about the unloaded frame, as in the paper: the first step of Newton's method, by
which `bend` finds the equilibrium of the bent frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.kinematics.constraints import MAX_DENSE_COORDINATES
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.numerics.factorization import (
    count_negative_pivots,
    Factor,
    factorize,
    factorize_with_condition,
)
from isotruss_ros.core.statics.beam_column import BeamColumns, chord_stiffness, EndForces
from isotruss_ros.core.statics.frame_pattern import (
    FramePattern,
    LinearRows,
    Members,
    NO_ROWS,
    TurnRows,
)
import numpy as np
from scipy.sparse import coo_matrix, csc_matrix

#: Largest condition number of the scaled frame [-]; a frame beyond it is a mechanism.
MAX_CONDITION = 1e12
#: Largest last step of Newton's method [m]; the remaining error is rounding.
STEP_TOLERANCE = 1e-7
MAX_NEWTON_ITERATIONS = 20
#: Largest ratio of displacements to the linear response [-].
MAX_GROWTH = 3.0
#: Which of 0, 1, x, y and -y of a direction are the entries of `directions`.
TURN = np.array(
    [
        [2, 3, 0, 0, 0, 0],
        [4, 2, 0, 0, 0, 0],
        [0, 0, 1, 0, 0, 0],
        [0, 0, 0, 2, 3, 0],
        [0, 0, 0, 4, 2, 0],
        [0, 0, 0, 0, 0, 1],
    ]
)


@dataclass(frozen=True, eq=False)
class FrameState:
    """
    The response of a frame to its loads.

    :ivar displacements: (n, 3) ux, uy [m], theta [rad]; zero rotation where all is pinned.
    :ivar reactions: (n, 3) fx, fy [N], m [N m] of the supports on the frame; zero elsewhere.
    :ivar end_forces: (k, 6) forces of the nodes on the members, along their chords, across them
        [N] and moments [N m], at start and end.
    :ivar multipliers: (c,) of the constraints.
    :ivar bowing: (k,) axial forces that change the moments inside bent members [N]; zero in the
        linear frame.
    """

    displacements: Array
    reactions: Array
    end_forces: Array
    multipliers: Array
    bowing: Array


@dataclass(frozen=True, eq=False)
class Tangent:
    """
    A frame linearised about displacements of its nodes, with the forces there.

    :ivar displacements: (n, 3) ux, uy [m], theta [rad].
    :ivar multipliers: (c,) of the constraints.
    :ivar axis: (k,) directions of the chords.
    :ivar length: (k,) of the chords [m].
    :ivar forces: of the members.
    :ivar carried: (3 n,) loads and reactions that these displacements take [N], [N m].
    :ivar gaps: (c,) of the constraints.
    :ivar stiffness: (k, 6, 6) of the members along and across their chords.
    :ivar matrix: that of (4), scaled.
    :ivar factor: of the matrix.
    :ivar scale: (f + c,) of its rows and columns.
    :ivar solved: (f,) the displacements that are unknowns.
    """

    displacements: Array
    multipliers: Array
    axis: Points
    length: Array
    forces: EndForces
    carried: Array
    gaps: Array
    stiffness: Array
    matrix: Array | csc_matrix
    factor: Factor
    scale: Array
    solved: Indices

    def respond(self, loads: Array, gaps: Array | float = 0.0) -> tuple[Array, Array]:
        """
        Return displacements (3 n, p) and multipliers (c, p) of further loads.

        :param loads: (3 n, p) [N], [N m].
        :param gaps: (c, p) that the constraints are to open by.
        """
        free = len(self.solved)
        right = np.zeros((len(self.scale), loads.shape[1]))
        right[:free], right[free:] = loads[self.solved], gaps
        found = self.scale[:, None] * self.factor.solve(self.scale[:, None] * right)
        moved = np.zeros_like(loads)
        moved[self.solved] = found[:free]
        return moved, found[free:]

    @property
    def end_forces(self) -> Array:
        """Return the forces of the nodes on the members, see `FrameState`."""
        moments, pull = self.forces.moments, self.forces.pull
        across = moments.sum(axis=1) / self.length
        ends = -pull, across, moments[:, 0], pull, -across, moments[:, 1]
        return np.stack(ends, axis=1)


class Frame:
    """
    A frame; its matrix without loads is factored once.

    :ivar points: (n,) nodes x + iy [m].
    :ivar members: what connects them.
    :ivar length: (k,) of the members [m].
    :ivar axis: (k,) their directions from start to end, unit vectors x + iy.
    :ivar rows: constraints on the displacements.
    :ivar whole: (k,) of which members of the frame that was cut these are parts.
    :ivar beams: of the members between their ends, what `Beams` takes.
    :ivar turn: (k, 6, 6) turn displacements of the plane into those along them.
    :param points: (n,) nodes x + iy [m].
    :param members: what connects them.
    :param held: (n, 3) which of ux, uy, theta are held by supports.
    :param names: (n,) names of the nodes, for messages.
    :param rows: constraints on the displacements: linear ones, or on turns of spans.
    :param pattern: of a frame with the same connections and supports; made if None.
    """

    def __init__(
        self,
        points: Points,
        members: Members,
        held: Flags,
        names: Sequence[str],
        rows: LinearRows | TurnRows = NO_ROWS,
        pattern: FramePattern | None = None,
    ) -> None:
        self.points = points
        self.members = members
        self._names = names
        self._held = held.ravel()
        self.rows = rows
        span = points[members.end] - points[members.start]
        self.length = length = np.abs(span)
        self.axis = span / length
        self.turn = directions(self.axis)
        self.beams = length, *members[2:6]
        self._columns = BeamColumns(length, *members[2:])
        self._loaded: dict[bytes, tuple[Array, Array]] = {}
        self._pattern = pattern or FramePattern(members, held, rows)
        self.whole = np.arange(len(length))

    @cached_property
    def rest(self) -> Tangent:
        """
        Return the frame linearised without loads, (4).

        :raises StructureError: the frame is a mechanism; names the nodes that move.
        """
        return self.tangent(
            np.zeros((len(self.points), 3)), np.zeros(self.rows.count), checked=True
        )

    def tangent(
        self,
        displacements: Array,
        multipliers: Array,
        pull: Array | None = None,
        checked: bool = False,
    ) -> Tangent:
        """
        Linearise the frame about displacements.

        :param displacements: (n, 3) ux, uy [m], theta [rad].
        :param multipliers: (c,) of the constraints.
        :param pull: (k,) axial forces N, see `BeamColumns.evaluate`; those there if None [N].
        :param checked: whether to look for a mechanism.
        :raises StructureError: the frame is a mechanism there.
        """
        pattern, rows = self._pattern, self.rows
        ends = displacements.ravel()[pattern.places]
        apart = (ends[:, 3] - ends[:, 0] + 1j * (ends[:, 4] - ends[:, 1])) * self.axis.conj()
        span = self.length + apart
        length = np.abs(span)
        axis = self.axis * span / length
        # Of the two lengths, without the rounding of their difference.
        longer = (2.0 * self.length * apart.real + np.abs(apart) ** 2) / (length + self.length)
        forces = self._columns.evaluate(longer, ends[:, 2::3] - np.angle(span)[:, None], pull)
        local = chord_stiffness(length, forces)
        turn = directions(axis)
        matrices = turn.transpose(0, 2, 1) @ local @ turn
        values, gaps, pairs = rows.linearize(self.points, displacements, multipliers)
        matrix, scale = self._assemble(matrices, values, pairs)
        across = forces.moments.sum(axis=1) / length
        pushed = np.zeros((len(length), 6))
        pushed[:, 3], pushed[:, 4], pushed[:, 2::3] = forces.pull, -across, forces.moments
        pushed[:, :2] = -pushed[:, 3:5]
        pushed = (pushed[:, None] @ turn)[:, 0]
        carried = np.bincount(
            pattern.places.ravel(), pushed.ravel(), minlength=len(self._held)
        ) + np.bincount(rows.column, values * multipliers[rows.row], minlength=len(self._held))
        factor = self._factorize(matrix, scale, checked)
        return Tangent(
            displacements,
            multipliers,
            axis,
            length,
            forces,
            carried,
            gaps,
            local,
            matrix,
            factor,
            scale,
            pattern.solved,
        )

    def _assemble(
        self, matrices: Array, values: Array, pairs: Array
    ) -> tuple[Array | csc_matrix, Array]:
        """Return the matrix of (4), [[S, A^T], [A, 0]], scaled, and its scaling."""
        pattern = self._pattern
        free, size = len(pattern.solved), len(pattern.solved) + self.rows.count
        diagonal = np.bincount(
            pattern.places.ravel(),
            matrices.diagonal(axis1=1, axis2=2).ravel(),
            minlength=len(self._held),
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

    def _factorize(self, matrix: Array | csc_matrix, scale: Array, checked: bool) -> Factor:
        """Return the factor of the matrix of (4)."""
        if not checked:
            try:
                return factorize(matrix.copy())
            except np.linalg.LinAlgError as error:
                raise StructureError('the structure has no stiffness in its bent shape') from error
        factor, condition = factorize_with_condition(matrix)
        if factor is None or not condition < MAX_CONDITION:
            moving = ', '.join(self._what_moves(matrix, scale))
            raise StructureError(
                f'the structure is a mechanism: {moving} can move without resistance; '
                'support it or connect it'
            )
        return factor

    def _what_moves(self, matrix: Array | csc_matrix, scale: Array) -> list[str]:
        """Return the nodes that move in mechanisms."""
        dense = matrix if isinstance(matrix, np.ndarray) else matrix.toarray()
        values, vectors = np.linalg.eigh(dense)
        loose = np.abs(values) < np.abs(values).max() / MAX_CONDITION**0.5
        loose[np.abs(values).argmin()] = True
        unknown = self._pattern.unknowns
        motion = np.abs(scale[:, None] * vectors[:, loose]).max(axis=1)
        by_node = np.where(unknown >= 0, motion[unknown], 0.0).reshape(-1, 3).max(axis=1)
        return [self._names[i] for i in np.flatnonzero(by_node > 1e-3 * by_node.max())]

    def solve(self, loads: Array) -> FrameState:
        """
        Return displacements, reactions and member forces under loads, by the linear (4).

        :param loads: (n, 3) fx, fy [N], m [N m] on the nodes.
        :raises StructureError: the frame is a mechanism; names the nodes that move; or the loads
            are beyond what numbers can carry.
        """
        pattern, flat = self._pattern, loads.ravel()
        moved, multipliers = (each[:, 0] for each in self.rest.respond(flat[:, None]))
        with np.errstate(over='ignore', invalid='ignore'):
            end_forces = self._end_forces(moved[pattern.places])
        if not np.isfinite(end_forces).all():
            raise StructureError(
                f'loads up to {np.abs(loads).max():.3g} N: what they do is beyond all numbers; '
                'must be smaller'
            )
        pull = np.einsum('kji,kj->ki', self.turn, end_forces)
        carried = np.bincount(pattern.places.ravel(), pull.ravel(), minlength=len(flat))
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
        Return the equilibrium of the bent frame under loads (Newton's method).

        :param loads: (n, 3) fx, fy [N], m [N m] on the nodes.
        :param start: about a state to begin with; that without loads if None.
        :param growth: displacements are at most this many times the linear response [-].
        :return: None where no equilibrium is found near the linear response to the loads.
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
            pull = self._pull_after(tangent, step[:, 0])
            with np.errstate(over='ignore', invalid='ignore', divide='ignore'):
                tangent = self.tangent(
                    displacements, tangent.multipliers + multipliers[:, 0], pull
                )
            if size <= STEP_TOLERANCE:
                return tangent
        return None

    def _pull_after(self, tangent: Tangent, step: Array) -> Array:
        """Return the axial forces (k,) of the members after a step (3 n,) of the nodes [N]."""
        turn, length = directions(tangent.axis), tangent.length
        ends = (turn @ step[self._pattern.places][:, :, None])[..., 0]
        turned = (ends[:, 4] - ends[:, 1]) / length
        moved = np.stack([ends[:, 3] - ends[:, 0], ends[:, 2] - turned, ends[:, 5] - turned], 1)
        return tangent.forces.pull + (tangent.forces.stiffness[:, 0] * moved).sum(axis=1)

    def is_stable(self, tangent: Tangent) -> bool:
        """
        Return whether the equilibrium is stable under the constraints.

        :param tangent: there.
        """
        return count_negative_pivots(tangent.matrix, self.rows.count) == self.rows.count

    def state(self, tangent: Tangent, loads: Array) -> FrameState:
        """
        Return the response of the bent frame.

        :param tangent: in equilibrium with the loads.
        :param loads: (n, 3) fx, fy [N], m [N m] on the nodes.
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
        return np.where(self._held, missing, 0.0).reshape(-1, 3)

    def compliance(self, members: Indices) -> Array:
        """
        Return the displacements of the ends of members under unit loads on these ends; kept.

        :param members: (k,) which of the members.
        :return: (6 k, 6 k), along and across the member and by rotation at start and end of each;
            symmetric.
        :raises StructureError: see `solve`.
        """
        return self._under_end_loads(members)[1]

    def _under_end_loads(self, members: Indices) -> tuple[Array, Array]:
        """Return all displacements (3 n, 6 k), and what `compliance` returns; both kept."""
        key = members.tobytes()
        if key in self._loaded:
            return self._loaded[key]
        size, turn = 6 * len(members), self.turn[members]
        places = self._pattern.places[members].ravel()
        loads = np.zeros((len(self._held), size))
        columns = np.arange(size).reshape(-1, 1, 6).repeat(6, axis=1).reshape(size, 6)
        loads[places[:, None], columns] = turn.transpose(0, 2, 1).reshape(size, 6)
        found = self.rest.respond(loads)[0] if size else loads
        ends = (turn @ found[places].reshape(len(members), 6, size)).reshape(size, size)
        self._loaded[key] = found, ends
        return found, ends

    def displacements(self, members: Indices, loads: Array) -> Array:
        """
        Return the displacements of all nodes where members carry loads inside, (n, 3, c).

        :param members: (p,) which of them do.
        :param loads: (6 p, c) on their ends, in their frames, that move these as the loads do, for
            each of c cases [N], [N m].
        :raises StructureError: see `solve`.
        """
        return (self._under_end_loads(members)[0] @ loads).reshape(-1, 3, loads.shape[1])

    def end_forces(self, members: Indices, loads: Array) -> Array:
        """
        Return the forces of the nodes on all members, some of which carry loads inside.

        :param members: (p,) which of them do.
        :param loads: (p, 6) on their ends, in their frames, that move these as the loads do [N],
            [N m].
        :return: (k, 6), see `FrameState`.
        :raises StructureError: see `solve`.
        """
        moved = self._under_end_loads(members)[0] @ loads.ravel()
        forces = self._end_forces(moved[self._pattern.places])
        np.subtract.at(forces, members, loads)
        return forces

    @property
    def _local(self) -> Array:
        return self.rest.stiffness

    def _end_forces(self, ends: Array) -> Array:
        """Return the forces (k, 6) on the members for displacements (k, 6) in the plane."""
        return (self._local @ (self.turn @ ends[:, :, None]))[:, :, 0]


def directions(direction: Points) -> Array:
    """
    Return the rotation matrices from the plane to the members' frames.

    :param direction: (k,) unit vectors from start to end.
    :return: (k, 6, 6), orthogonal.
    """
    values = np.zeros((len(direction), 5))
    values[:, 1], values[:, 2], values[:, 3] = 1.0, direction.real, direction.imag
    values[:, 4] = -direction.imag
    return values.take(TURN, axis=1)
