# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Numbering of a frame's unknowns: parts that meet in hinges, and the hinges between them.

The unknowns are the displacements of all nodes and the multipliers of the constraints. A hinge is
a node at which all members are pinned. Members and constraints join the other nodes to blocks; the
tubes of a robot are blocks. Blocks are eliminated, so only the unknowns of the joints remain.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.kinematics.constraints import MAX_DENSE_COORDINATES
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
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
        """Return the constraints on weighted rotations of spans; see `TurnRows` (row: owner)."""
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
        """
        Return the geometric stiffness (4 h,) of the constraints, in the order of `TurnRows.pairs`.
        """
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


class Blocks(NamedTuple):
    """
    Group of b blocks of equal size, each with s unknowns that are coupled to t of the joints.
    """

    inner: Indices  #: (b, s) indices of the blocks' unknowns
    #: (b, t) indices of the coupled unknowns among those of the joints; their number for
    #: displacements that supports fix
    outer: Indices
    part: slice  #: entries (b, s, s + t) of the blocks among the entries of a `FramePattern`


class FramePattern:
    """
    Numbering of the unknowns of all frames with equal connections and supports.

    :ivar places: (k, 6) indices of the displacements of each member's ends.
    :ivar free: (u,) mask of the unknowns: displacements (3 n,) that are not fixed, and
        multipliers.
    :ivar rows: number of constraints.
    :ivar entries: row and column of all entries of the matrix (4): members' stiffness (36 k,),
        constraints, constraints transposed, and the constraints' geometric stiffness.
    :ivar blocks: groups of blocks.
    :ivar joints: (j,) indices of the unknowns of the joints.
    :ivar slots: position of each entry in an array that has the blocks, then the matrix of the
        joints, then one number for entries without place.
    :ivar size: length of this array.
    :ivar units: positions of diagonal entries that are 1, of fixed displacements within blocks.
    :ivar fill: position of the Schur complements of all blocks in the matrix of the joints.
    :ivar sparse: row indices and column pointers of the sparse matrix of the joints; None: dense.
    :ivar sources: matrix (j, .) that sums the coupled unknowns of all blocks at the joints.
    :param members: members between the nodes; only their connections are used.
    :param held: (n, 3) mask of the displacements ux, uy, theta that supports fix.
    :param rows: constraints on rotations; only their connections are used.
    :param condensed: False for a matrix without blocks.
    """

    def __init__(
        self, members: Members, held: Flags, rows: TurnRows, condensed: bool = True
    ) -> None:
        self.places, count = member_places(members.start, members.end), held.size + rows.count
        self.rows = rows.count
        turning = np.zeros(len(held), dtype=bool)
        turning[members.start[~members.pinned_start]] = True
        turning[members.end[~members.pinned_end]] = True
        # A hinge has no rotation.
        real = np.ones(count, dtype=bool)
        np.put(real, 3 * np.arange(len(held)) + 2, turning)
        self.free = real & np.append(~held.ravel(), np.ones(rows.count, dtype=bool))
        row, column, (one, other) = held.size + rows.row, rows.column, rows.pairs
        first = np.concatenate([self.places.repeat(6), row, column, one])
        second = np.concatenate([np.repeat(self.places, 6, axis=0).ravel(), column, row, other])
        self.entries = first, second
        owner = np.full(count, -1)
        if condensed:
            owner = _find_blocks(members, turning, rows, self.free)
        inner = owner >= 0
        self.joints = np.flatnonzero(~inner & self.free)
        self._number_blocks(owner, real)
        self._number_joints(inner)

    def _number_blocks(self, owner: Indices, real: Flags) -> None:
        """Set `blocks`, `units`, and `slots` of blocks; `owner` is each unknown's block or -1."""
        (first, second), count = self.entries, len(owner)
        total, inner = int(owner.max(initial=-1)) + 1, owner >= 0
        order = np.argsort(owner, kind='stable')
        order = order[inner[order]]
        sizes = np.bincount(owner[inner], minlength=total)
        local = np.zeros(count, dtype=np.intp)
        local[order] = np.arange(len(order)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        across = inner[first] & ~inner[second] & real[second]
        pairs, pair = np.unique(owner[first[across]] * count + second[across], return_inverse=True)
        coupled, unknown = np.divmod(pairs, count)
        widths = np.bincount(coupled, minlength=total)
        rank = np.arange(len(pairs)) - np.repeat(np.cumsum(widths) - widths, widths)
        slot = local[second]
        slot[across] = (sizes[coupled] + rank)[pair]
        joint = np.full(count, len(self.joints))
        joint[self.joints] = np.arange(len(self.joints))
        self._joint, offsets, begin = joint, np.zeros(total, dtype=np.intp), 0
        self.blocks: list[Blocks] = []
        for size, width in np.unique(np.stack([sizes, widths], axis=1), axis=0).tolist():
            alike = np.flatnonzero((sizes == size) & (widths == width))
            area = size * (size + width)
            offsets[alike] = begin + area * np.arange(len(alike))
            part = slice(begin, begin + area * len(alike))
            begin = part.stop
            chosen = joint[unknown[np.isin(coupled, alike)]].reshape(len(alike), width)
            inside = order[np.isin(owner[order], alike)].reshape(len(alike), size)
            self.blocks.append(Blocks(inside, chosen, part))
        row, inside = sizes + widths, inner[first] & (inner[second] | across)
        self.slots, self._begin = np.full(len(first), -1), begin
        block = owner[first[inside]]
        self.slots[inside] = offsets[block] + local[first[inside]] * row[block] + slot[inside]
        fixed = np.flatnonzero(inner & ~self.free)
        self.units = offsets[owner[fixed]] + local[fixed] * (row[owner[fixed]] + 1)

    def _number_joints(self, inner: Flags) -> None:
        """Set `slots` of the joints' matrix, `size`, `fill`, `sparse` and `sources`."""
        count, outer = len(self.joints), [each.outer for each in self.blocks]
        rows, columns = (self._joint[each] for each in self.entries)
        filled = [np.broadcast_arrays(each[:, :, None], each[:, None]) for each in outer]
        rows, columns = (
            np.concatenate([own, *(pair[i].ravel() for pair in filled)])
            for i, own in enumerate((rows, columns))
        )
        there = np.flatnonzero((rows < count) & (columns < count))
        keys, self.sparse = columns[there] * count + rows[there], None
        entries = count**2
        if count > MAX_DENSE_COORDINATES:
            unique, keys = np.unique(keys, return_inverse=True)
            entries = len(unique)
            pointers = np.searchsorted(unique, count * np.arange(count + 1))
            self.sparse = unique % count, pointers
        found = np.full(len(rows), entries)
        found[there] = keys
        direct = len(self.slots)
        self.size, self.fill = self._begin + entries + 1, found[direct:]
        self.slots = np.where(self.slots < 0, self._begin + found[:direct], self.slots)
        ahead = np.concatenate([*(each.ravel() for each in outer), rows[:0]])
        coupled = np.flatnonzero(ahead < count)
        places = ahead[coupled], coupled
        sources = csr_matrix((np.ones(len(coupled)), places), shape=(count, len(ahead)))
        self.sources = sources if self.sparse else sources.toarray()


def _find_blocks(members: Members, turning: Flags, rows: TurnRows, free: Flags) -> Indices:
    """Return the block (u,) of each unknown, -1 for unknowns of the joints."""
    count, size = len(turning), len(turning) + rows.count
    one = np.append(members.start, count + rows.row)
    other = np.append(members.end, rows.column // 3)
    solid = np.append(turning, np.ones(rows.count, dtype=bool))
    joined = solid[one] & solid[other]
    graph = coo_matrix((joined[joined], (one[joined], other[joined])), shape=(size, size))
    number, label = connected_components(graph, directed=False)
    label = label[np.append(np.arange(count).repeat(3), np.arange(count, size))]
    unknowns = np.bincount(label, minlength=number)
    chosen = np.zeros(number, dtype=bool)
    chosen[label[3 * np.flatnonzero(turning)]] = True
    chosen &= unknowns <= MAX_DENSE_COORDINATES
    block = np.where(chosen, np.cumsum(chosen) - 1, -1)[label]
    # A single block is the whole frame.
    several = block.max() > 0 and (free & (block < 0)).any()
    return block if several else np.full(len(free), -1)
