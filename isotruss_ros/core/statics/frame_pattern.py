# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Numbering of a frame's unknowns, and its blocks.

The unknowns are the displacements of all nodes and the multipliers of the constraints. A hinge is
a node at which all members are pinned. Members and constraints join the other nodes to blocks; the
tubes of a robot are blocks.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.kinematics.constraints import MAX_DENSE_COORDINATES
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.statics.block_matrix import BlockMatrix, Unknowns
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components


class TurnRows(NamedTuple):
    """
    Constraints on rotations of vectors: in each row the weighted sum of rotations is zero.

    A vector, called a span, is a linear combination of node positions. Its coefficients, called
    shares, sum to zero.
    """

    #: number of rows
    count: int  # type: ignore[assignment]
    owner: Indices  #: (s,) row of each span
    weight: Array  #: (s,) weight of each span's rotation in its row
    first: Indices  #: (s,) index of the first share of each span
    span: Indices  #: (e,) index of the span to which each share belongs, ascending
    share: Array  #: (e,) coefficient of a node's position in the span
    node: Indices  #: (e,) index of the node of each share
    #: (2 e,) row of each entry of the constraint matrix: first the derivatives by x of the nodes,
    #: then the derivatives by y
    row: Indices
    column: Indices  #: (2 e,) column of each entry, which is the index of a displacement
    #: two arrays (4 h,) of displacements that the geometric stiffness couples: (x, x), (x, y), (y,
    #: x) and (y, y) of the two nodes of each pair of shares
    pairs: tuple[Indices, Indices]
    paired: Indices  #: (h,) span of each pair of shares in `pairs`
    product: Array  #: (h,) product of both shares of each pair

    @classmethod
    def of(
        cls, row: Indices, weight: Array, span: Indices, share: Array, node: Indices
    ) -> TurnRows:
        """Return the constraints on weighted rotations of spans."""
        one, other = np.nonzero(span[:, None] == span)
        x, count = 3 * node, int(row.max()) + 1
        first = np.concatenate([x[one], x[one], x[one] + 1, x[one] + 1])
        second = np.concatenate([x[other], x[other] + 1, x[other], x[other] + 1])
        rows, columns = np.tile(row[span], 2), np.concatenate([x, x + 1])
        begins, product = np.searchsorted(span, np.arange(len(row))), share[one] * share[other]
        pairs = first, second
        return cls(
            count, row, weight, begins, span, share, node, rows, columns, pairs, span[one], product
        )

    def spans(self, points: Points) -> Points:
        """Return the vector of each span, (s,) x + iy [m], from node positions (n,)."""
        return np.add.reduceat(self.share * points[self.node], self.first)

    def linearize(self, spans: Points, displacements: Array) -> tuple[Array, Array, Points]:
        """Return the constraints on rotations, linearised about displacements of the nodes."""
        moved = spans + self.spans(displacements[:, 0] + 1j * displacements[:, 1])
        turned = moved * spans.conj()
        gaps = np.bincount(self.owner, self.weight * np.arctan2(turned.imag, turned.real))
        slopes = (1j * self.weight / moved.conj())[self.span] * self.share
        return np.concatenate([slopes.real, slopes.imag]), gaps, moved

    def curvature(self, spans: Points, multipliers: Array) -> Array:
        """Return the geometric stiffness (4 h,) of the constraints, see `TurnRows.pairs`."""
        curved = (-self.weight * multipliers[self.owner] / spans**2)[self.paired] * self.product
        return np.concatenate([curved.imag, curved.real, curved.real, -curved.imag])


class Members(NamedTuple):
    """Straight members between nodes, as arrays with one entry for each of k members."""

    start: Indices  #: (k,) indices of the start nodes
    end: Indices  #: (k,) indices of the end nodes
    axial: Array  #: (k,) EA [N]
    flexural: Array  #: (k,) EI [N m^2]
    shear: Array  #: (k,) GA [N]; infinite for members without shear deformation
    pinned_start: Flags  #: (k,) whether the start transmits no moment
    pinned_end: Flags  #: (k,) whether the end transmits no moment


def member_places(start: Indices, end: Indices) -> Indices:
    """Return the indices (k, 6) of the displacements of the start and end nodes of members."""
    return (3 * np.stack([start, end], axis=1)[:, :, None] + np.arange(3)).reshape(-1, 6)


class FramePattern:
    """
    Numbering of the unknowns of all frames with equal connections and supports.

    :ivar places: (k, 6) indices of the displacements of each member's ends.
    :ivar unknowns: masks (u,) of the displacements (3 n,) and the multipliers.
    :ivar entries: row and column of all entries of the matrix (4): members' stiffness (36 k,),
        constraints, constraints transposed, and the constraints' geometric stiffness.
    :ivar condensed: whether the matrix has blocks.
    :ivar matrix: numbering of the matrix.
    :param members: members between the nodes; only their connections are used.
    :param held: (n, 3) mask of the displacements ux, uy, theta that supports fix.
    :param rows: constraints on rotations; only their connections are used.
    :param condensed: False for a matrix without blocks.
    """

    def __init__(
        self,
        members: Members,
        held: Flags,
        rows: TurnRows,
        condensed: bool = True,
    ) -> None:
        self.places, count = member_places(members.start, members.end), held.size + rows.count
        turning = np.zeros(len(held), dtype=bool)
        turning[members.start[~members.pinned_start]] = True
        turning[members.end[~members.pinned_end]] = True
        # A hinge has no rotation.
        real, multiplier = np.ones(count, dtype=bool), np.arange(count) >= held.size
        np.put(real, 3 * np.arange(len(held)) + 2, turning)
        free = real & ~np.append(held.ravel(), np.zeros(rows.count, dtype=bool))
        self.unknowns = Unknowns(free, real, multiplier)
        row, column, (one, other) = held.size + rows.row, rows.column, rows.pairs
        first = np.concatenate([self.places.repeat(6), row, column, one])
        second = np.concatenate([np.repeat(self.places, 6, axis=0).ravel(), column, row, other])
        self.entries, blocks = (first, second), _find_blocks(members, turning, rows)
        # A single block is the whole frame.
        self.condensed = condensed and blocks.max() > 0 and bool((free & (blocks < 0)).any())
        blocks = blocks if self.condensed else np.full(count, -1)
        self.matrix = BlockMatrix(self.entries, blocks, self.unknowns)


def _find_blocks(members: Members, solid: Flags, rows: TurnRows) -> Indices:
    """Return the block (u,) of each unknown of solid nodes (n,), -1 for unknowns of others."""
    count, size = len(solid), len(solid) + rows.count
    one = np.append(members.start, count + rows.row)
    other = np.append(members.end, rows.column // 3)
    within = np.append(solid, np.ones(rows.count, dtype=bool))
    joined = within[one] & within[other]
    graph = coo_matrix((joined[joined], (one[joined], other[joined])), shape=(size, size))
    number, label = connected_components(graph, directed=False)
    label = label[np.append(np.arange(count).repeat(3), np.arange(count, size))]
    chosen = np.zeros(number, dtype=bool)
    chosen[label[3 * np.flatnonzero(solid)]] = True
    chosen &= np.bincount(label, minlength=number) <= MAX_DENSE_COORDINATES
    return np.where(chosen, np.cumsum(chosen) - 1, -1)[label]
