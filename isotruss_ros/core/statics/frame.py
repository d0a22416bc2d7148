# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plane frames by the direct stiffness method, with linear constraints: equations (1) and (4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.kinematics.constraints import DENSE_UP_TO
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.numerics.factorization import Factor, factorize_with_condition
from isotruss_ros.core.statics.beam import directions, local_stiffness
from isotruss_ros.core.statics.frame_pattern import FramePattern, LinearRows, Members, NO_ROWS
import numpy as np
from scipy.sparse import coo_matrix, csc_matrix

#: A frame that is worse conditioned than this, in its own units, is a mechanism.
MAX_CONDITION = 1e12


@dataclass(frozen=True, eq=False)
class FrameState:
    """
    The response of a frame to its loads.

    :ivar displacements: (n, 3) ux, uy [m], theta [rad]; zero rotation where all is pinned.
    :ivar reactions: (n, 3) fx, fy [N], m [N m] of the supports on the frame; zero elsewhere.
    :ivar end_forces: (k, 6) forces of the nodes on the members, along them, across them [N] and
        moments [N m], at start and end.
    :ivar multipliers: (c,) of the constraints.
    """

    displacements: Array
    reactions: Array
    end_forces: Array
    multipliers: Array


class Frame:
    """
    A linear frame; its matrix is factored once, with the first solve.

    :ivar points: (n,) nodes x + iy [m].
    :ivar members: what connects them.
    :ivar length: (k,) of the members [m].
    :ivar axis: (k,) their directions from start to end, unit vectors x + iy.
    :ivar beams: of the members between their ends, what `Beams` takes.
    :ivar turn: (k, 6, 6) turn displacements of the plane into those along them.
    :param points: (n,) nodes x + iy [m].
    :param members: what connects them.
    :param held: (n, 3) which of ux, uy, theta are held by supports.
    :param names: (n,) names of the nodes, for messages.
    :param rows: linear constraints on the displacements.
    :param pattern: of a frame with the same connections and supports; made if None.
    """

    def __init__(
        self,
        points: Points,
        members: Members,
        held: Flags,
        names: Sequence[str],
        rows: LinearRows = NO_ROWS,
        pattern: FramePattern | None = None,
    ) -> None:
        self.points = points
        self.members = members
        self._names = names
        self._held = held.ravel()
        self._rows = rows
        span = points[members.end] - points[members.start]
        self.length = length = np.abs(span)
        self.axis = span / length
        self.turn = directions(self.axis)
        self._local = local_stiffness(length, *members[2:5], pins=members[5:])
        self.beams = length, *members[2:6]
        self._loaded: dict[bytes, tuple[Array, Array]] = {}
        self._pattern = pattern or FramePattern(members, held, rows)

    @cached_property
    def _matrices(self) -> Array:
        """Return the stiffness matrices (k, 6, 6) of the members in the plane."""
        return self.turn.transpose(0, 2, 1) @ self._local @ self.turn

    @cached_property
    def _system(self) -> tuple[Factor, Array]:
        """Return the factored matrix of (4), [[S, A^T], [A, 0]], and its scaling."""
        pattern, matrices = self._pattern, self._matrices
        free, size = len(pattern.solved), len(pattern.solved) + self._rows.count
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
        values = matrices.ravel()[pattern.entries]
        if self._rows.count:
            weight = self._rows.value[pattern.weights]
            scaled = weight * scale[pattern.bound]
            norms = np.bincount(pattern.multiplier, scaled**2, minlength=size)[free:]
            scale[free:] = 1.0 / np.sqrt(np.where(norms > 0.0, norms, 1.0))
            values = np.concatenate([values, weight, weight])
        matrix = _assemble(values, pattern.matrix_rows, pattern.matrix_columns, scale)
        factor, condition = factorize_with_condition(matrix)
        if not condition < MAX_CONDITION:
            moving = ', '.join(self._what_moves(matrix, scale))
            raise StructureError(
                f'the structure is a mechanism: {moving} can move without resistance; '
                'support it or connect it'
            )
        return factor, scale

    def _what_moves(self, matrix: Array | csc_matrix, scale: Array) -> list[str]:
        """Return the nodes that take part in motions which nothing resists."""
        dense = matrix if isinstance(matrix, np.ndarray) else matrix.toarray()
        values, vectors = np.linalg.eigh(dense)
        loose = np.abs(values) < np.abs(values).max() / MAX_CONDITION**0.5
        loose[np.abs(values).argmin()] = True
        unknown = self._pattern.unknowns
        motion = np.abs(scale[:, None] * vectors[:, loose]).max(axis=1)
        by_node = np.where(unknown >= 0, motion[unknown], 0.0).reshape(-1, 3).max(axis=1)
        return [self._names[i] for i in np.flatnonzero(by_node > 1e-3 * by_node.max())]

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
        """Return all unknowns, with a zero behind, and what `compliance` returns; both kept."""
        key = members.tobytes()
        if key in self._loaded:
            return self._loaded[key]
        size, (factor, scale) = 6 * len(members), self._system
        # What is held is the last row: not loaded, and it does not move.
        unknown, turn = self._pattern.ends[members].ravel(), self.turn[members]
        found, count = np.zeros((len(scale) + 1, size)), len(scale)
        columns = np.arange(size).reshape(-1, 1, 6).repeat(6, axis=1).reshape(size, 6)
        found[unknown[:, None], columns] = turn.transpose(0, 2, 1).reshape(size, 6)
        if size:
            found[:count] = scale[:, None] * factor.solve(scale[:, None] * found[:count])
        found[count] = 0.0
        ends = (turn @ found[unknown].reshape(len(members), 6, size)).reshape(size, size)
        self._loaded[key] = found, ends
        return found, ends

    def solve(self, loads: Array) -> FrameState:
        """
        Return displacements, reactions and member forces under loads, by (4).

        :param loads: (n, 3) fx, fy [N], m [N m] on the nodes.
        :raises StructureError: the frame is a mechanism; names the nodes that move; or the loads
            are beyond what numbers can carry.
        """
        pattern, flat = self._pattern, loads.ravel()
        factor, scale = self._system
        free, right = len(pattern.solved), np.zeros((len(scale), 1))
        right[:free, 0] = flat[pattern.solved]
        solution = scale * factor.solve(scale[:, None] * right)[:, 0]
        displacements, multipliers = np.zeros(len(flat)), solution[free:]
        displacements[pattern.solved] = solution[:free]
        with np.errstate(over='ignore', invalid='ignore'):
            end_forces = self._end_forces(displacements[pattern.places])
        if not np.isfinite(end_forces).all():
            raise StructureError(
                f'loads up to {np.abs(loads).max():.3g} N: what they do is beyond all numbers; '
                'must be smaller'
            )
        pull = np.einsum('kji,kj->ki', self.turn, end_forces)
        carried = np.bincount(pattern.places.ravel(), pull.ravel(), minlength=len(flat))
        if self._rows.count:
            pushed = self._rows.value * multipliers[self._rows.row]  # by the constraints
            carried += np.bincount(self._rows.column, pushed, minlength=len(flat))
        reactions = np.where(self._held, carried - flat, 0.0)
        return FrameState(
            displacements.reshape(-1, 3), reactions.reshape(-1, 3), end_forces, multipliers
        )

    def displacements(self, members: Indices, loads: Array) -> Array:
        """
        Return the displacements of all nodes where members carry loads inside, (n, 3, c).

        :param members: (p,) which of them do.
        :param loads: (6 p, c) on their ends, in their frames, that move these as the loads do, for
            each of c cases [N], [N m].
        :raises StructureError: see `solve`.
        """
        moved = self._under_end_loads(members)[0] @ loads
        return moved[self._pattern.unknowns].reshape(-1, 3, loads.shape[1])

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
        forces = self._end_forces(moved[self._pattern.ends])
        np.subtract.at(forces, members, loads)
        return forces

    def _end_forces(self, ends: Array) -> Array:
        """Return the forces (k, 6) on the members for displacements (k, 6) in the plane."""
        return (self._local @ (self.turn @ ends[:, :, None]))[:, :, 0]


def _assemble(values: Array, rows: Indices, columns: Indices, scale: Array) -> Array | csc_matrix:
    """Return the matrix with the sum of all values in each place, scaled; dense if it is small."""
    size = len(scale)
    values = values * scale[rows] * scale[columns]
    if size <= DENSE_UP_TO:
        return np.bincount(rows * size + columns, values, minlength=size * size).reshape(size, -1)
    return coo_matrix((values, (rows, columns)), shape=(size, size)).tocsc()
