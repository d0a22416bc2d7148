# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes, members and constraints of a frame, and the assembly of their matrix (4)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

from isotruss_ros.core.kinematics.constraints import MAX_DENSE_COORDINATES
from isotruss_ros.core.numerics.arrays import Array, Flags, Points
from isotruss_ros.core.statics.frame_pattern import Chains, FramePattern, Members, TurnRows
import numpy as np
from scipy.sparse import coo_matrix, csc_matrix


class FrameAssembly:
    """
    Nodes, members and constraints of a frame, which are assembled to the matrix of (4).

    :ivar points: (n,) nodes x + iy [m].
    :ivar members: members between the nodes.
    :ivar length: (k,) lengths of the members [m].
    :ivar axis: (k,) unit vectors of the members from start to end, x + iy.
    :ivar rows: constraints on rotations, see `TurnRows`.
    :ivar whole: (k,) index of the uncut member of which each member is a part.
    :ivar held: (n, 3) mask of the displacements ux, uy, theta that supports fix.
    :ivar pattern: sparsity pattern of the frame; in a cut frame, the pattern of the uncut frame.
    :ivar places: (k, 6) indices of the displacements of the members' ends among all displacements.
    :ivar chains: the members with cuts, in groups with equal numbers of cuts.
    :ivar begins: (k,) distance of each member's start from the start of the uncut member [m].
    :ivar nodes: (c,) indices of the nodes at the cuts.
    :ivar before: (c,) indices of the members that end at the cuts.
    :ivar behind: (c,) indices of the members that begin at the cuts.
    :param points: (n,) nodes x + iy [m].
    :param members: members between the nodes.
    :param held: (n, 3) mask of the displacements ux, uy, theta that supports fix.
    :param names: (n,) names of the nodes for error messages.
    :param rows: constraints on rotations, see `TurnRows`.
    :param pattern: pattern of a frame with the same connections and supports; None: it is
        computed.
    """

    def __init__(
        self,
        points: Points,
        members: Members,
        held: Flags,
        names: Sequence[str],
        rows: TurnRows,
        pattern: FramePattern | None = None,
    ) -> None:
        self.points = points
        self.members = members
        self.names = names
        self.held = held
        self.rows = rows
        span = points[members.end] - points[members.start]
        self.length = length = np.abs(span)
        self.axis = span / length
        self.pattern = pattern or FramePattern(members, held, rows)
        self.places = self.pattern.places
        self.chains: tuple[Chains, ...] = ()
        self.whole, self.begins = np.arange(len(length)), np.zeros(len(length))
        self.nodes = self.before = self.behind = np.zeros(0, dtype=np.intp)

    @cached_property
    def uncut(self) -> Flags:
        """Return a mask of the uncut frame's members that is true for members without a cut."""
        return np.bincount(self.whole) == 1

    def assemble(
        self, matrices: Array, values: Array, pairs: Array
    ) -> tuple[Array | csc_matrix, Array]:
        """
        Return the matrix [[S, A^T], [A, 0]] of (4), scaled, and the scaling (f + c,).

        There are f unknown displacements and c constraints.

        :param matrices: (k, 6, 6) stiffness of the uncut members against (ux, uy, theta) at both
            ends.
        :param values: entries of the constraints, see `TurnRows.linearize`.
        :param pairs: geometric stiffness of the constraints, see `TurnRows.curvature`.
        """
        pattern = self.pattern
        free, size = len(pattern.solved), len(pattern.solved) + self.rows.count
        diagonal = np.bincount(
            pattern.places.ravel(),
            matrices.diagonal(axis1=1, axis2=2).ravel(),
            minlength=len(pattern.unknowns),
        )
        # Equal scales for both directions of a node: across a bar the stiffness is a rounding
        # error.
        diagonal[0::3] = diagonal[1::3] = np.maximum(diagonal[0::3], diagonal[1::3])
        diagonal = diagonal[pattern.solved]
        # Scaled, displacements and rotations, soft tubes and stiff modules have stiffness 1.
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
