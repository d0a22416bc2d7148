# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Block elimination of symmetric matrices.

The unknowns are those of blocks, and others, called joints, that couple the blocks. The matrix of
the joints (Schur complement) is dense, or sparse.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.kinematics.constraints import MAX_DENSE_COORDINATES
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices
from isotruss_ros.core.numerics.factorization import (
    count_negative_pivots,
    Factor,
    factorize,
    factorize_with_condition,
)
import numpy as np
from scipy.sparse import csc_matrix, csr_matrix


class Unknowns(NamedTuple):
    """Masks (u,) of the unknowns of a matrix."""

    free: Flags  #: unknowns; displacements that supports fix are not
    real: Flags  #: displacements and multipliers; rotations of hinges are not
    multiplier: Flags  #: multipliers of constraints

    def of(self, chosen: Indices) -> Unknowns:
        """Return the masks of some of the unknowns."""
        return Unknowns(*(each[chosen] for each in self))


class JointsMatrix:
    """Numbering of a dense or sparse matrix from its entries' rows and columns (e,)."""

    def __init__(self, entries: tuple[Indices, Indices], unknowns: Unknowns) -> None:
        (rows, columns), free = entries, np.flatnonzero(unknowns.free)
        self.count, self.free = len(free), free
        self.constraints = int(np.count_nonzero(unknowns.multiplier[free]))
        number = np.full(len(unknowns.free) + 1, self.count)
        number[free] = np.arange(self.count)
        rows, columns = number[rows], number[columns]
        there = np.flatnonzero((rows < self.count) & (columns < self.count))
        keys, self.sparse, self.size = columns[there] * self.count + rows[there], None, 0
        if self.count > MAX_DENSE_COORDINATES:
            unique, keys = np.unique(keys, return_inverse=True)
            pointers = np.searchsorted(unique, self.count * np.arange(self.count + 1))
            self.sparse = unique % self.count, pointers
        self.size = self.count**2 if self.sparse is None else len(unique)
        self.slots = np.full(len(rows), self.size)
        self.slots[there] = keys

    def eliminate(self, values: Array, right: Array) -> tuple[FactoredMatrix, Array]:
        """Factorise the matrix with entries (e,), and solve for right-hand sides (u, p)."""
        packed, shape = np.bincount(self.slots, values, self.size + 1)[:-1], (self.count,) * 2
        if self.sparse is None:
            matrix = packed.reshape(shape)
        else:
            matrix = csc_matrix((packed, *self.sparse), shape=shape)
        factored = FactoredMatrix(self, matrix, factorize(matrix.copy()))
        return factored, factored.solve(right)


class FactoredMatrix(NamedTuple):
    """Factorised matrix without blocks."""

    numbers: JointsMatrix
    matrix: Array | csc_matrix
    factor: Factor

    def solve(self, right: Array) -> Array:
        """Return the unknowns (u, p) for right-hand sides (u, p); those not free are zero."""
        if len(right) == self.numbers.count:
            return self.factor.solve(right)
        found = np.zeros(right.shape)
        found[self.numbers.free] = self.factor.solve(right[self.numbers.free])
        return found

    @property
    def condition(self) -> float:
        """Return the condition number [-]."""
        return factorize_with_condition(self.matrix)[1]

    @property
    def negative_pivots(self) -> int:
        """Return the number of negative eigenvalues."""
        return count_negative_pivots(self.matrix, self.numbers.constraints)


class Blocks(NamedTuple):
    """Group of b blocks of equal size, each with s unknowns that are coupled to t joints."""

    inner: Indices  #: (b, s) indices of the blocks' unknowns
    outer: Indices  #: (b, t) indices among the joints; their number for fixed displacements
    part: slice  #: entries (b, s, s + t) among the packed entries of all blocks


class BlockMatrix:
    """
    Numbering of the blocks and joints of a matrix.

    :ivar count: number u of unknowns.
    :ivar joints: (j,) indices of the joints' unknowns.
    :ivar blocks: groups of blocks.
    :ivar slots: (e,) places of the entries among the packed entries of all blocks.
    :ivar size: number of packed entries; the last one is for entries of no block.
    :ivar units: places of diagonal entries that are 1, of fixed displacements.
    :ivar direct: indices of the entries that are in the matrix of the joints.
    :ivar sources: matrix (j, .) that sums the coupled unknowns of all blocks at the joints.
    :ivar matrix: numbering of the matrix of the joints.
    :param entries: row and column (e,) of each entry; their number u for entries without place.
    :param owner: block (u,) of each unknown, -1 for joints.
    :param unknowns: masks of the unknowns.
    """

    def __init__(
        self, entries: tuple[Indices, Indices], owner: Indices, unknowns: Unknowns
    ) -> None:
        first, second = entries
        owner, self.count = np.append(owner, -1), len(owner)
        inner = owner >= 0
        self.joints = np.flatnonzero(~inner[:-1] & unknowns.free)
        joint = np.full(len(owner), len(self.joints))
        joint[self.joints] = np.arange(len(self.joints))
        across = inner[first] & ~inner[second] & np.append(unknowns.real, False)[second]
        self._number(owner, across, entries, joint)
        fixed = np.flatnonzero(inner[:-1] & ~unknowns.free)
        self.units = self._diagonal[fixed]
        rows, columns = joint[first], joint[second]
        count, outer = len(self.joints), [each.outer for each in self.blocks]
        self.direct = np.flatnonzero((rows < count) & (columns < count))
        filled = [np.broadcast_arrays(each[:, :, None], each[:, None]) for each in outer]
        rows = np.concatenate([rows[self.direct], *(pair[0].ravel() for pair in filled)])
        columns = np.concatenate([columns[self.direct], *(pair[1].ravel() for pair in filled)])
        ahead = np.concatenate([each.ravel() for each in outer])
        coupled = np.flatnonzero(ahead < count)
        places = ahead[coupled], coupled
        sources = csr_matrix((np.ones(len(coupled)), places), shape=(count, len(ahead)))
        self.sources = sources.toarray() if count <= MAX_DENSE_COORDINATES else sources
        self.matrix = JointsMatrix((rows, columns), unknowns.of(self.joints))

    def _number(
        self, owner: Indices, across: Flags, entries: tuple[Indices, Indices], joint: Indices
    ) -> None:
        """Set `blocks`, `slots` and `size`; `across` is a mask of entries of a block and joint."""
        (first, second), count, inner = entries, len(owner), owner >= 0
        order = np.argsort(owner, kind='stable')
        order, sizes = order[inner[order]], np.bincount(owner[inner])
        local = np.zeros(count, dtype=np.intp)
        local[order] = np.arange(len(order)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        pairs, pair = np.unique(owner[first[across]] * count + second[across], return_inverse=True)
        coupled, unknown = np.divmod(pairs, count)
        widths = np.bincount(coupled, minlength=len(sizes))
        rank = np.arange(len(pairs)) - np.repeat(np.cumsum(widths) - widths, widths)
        slot = local[second]
        slot[across] = (sizes[coupled] + rank)[pair]
        offsets, begin, self.blocks = np.zeros(len(sizes), dtype=np.intp), 0, list[Blocks]()
        for size, width in np.unique(np.stack([sizes, widths], axis=1), axis=0).tolist():
            alike = np.flatnonzero((sizes == size) & (widths == width))
            area = size * (size + width)
            offsets[alike] = begin + area * np.arange(len(alike))
            part = slice(begin, begin + area * len(alike))
            outside = joint[unknown[np.isin(coupled, alike)]].reshape(len(alike), width)
            inside = order[np.isin(owner[order], alike)].reshape(len(alike), size)
            self.blocks.append(Blocks(inside, outside, part))
            begin = part.stop
        row, inside = sizes + widths, inner[first] & (inner[second] | across)
        self.slots, self.size, block = np.full(len(first), begin), begin + 1, owner[first[inside]]
        self.slots[inside] = offsets[block] + local[first[inside]] * row[block] + slot[inside]
        self._diagonal = offsets[owner] + local * (row[owner] + 1)

    def eliminate(self, values: Array, right: Array) -> tuple[FactoredBlocks, Array]:
        """Eliminate the blocks of a matrix with entries (e,); solve for right sides (u, p)."""
        packed = np.bincount(self.slots, values, self.size)
        packed[self.units] = 1.0
        parts, fill, insides, pushed = [], [values[self.direct]], [], []
        for inner, outer, part in self.blocks:
            (count, size), width = inner.shape, outer.shape[1]
            whole = packed[part].reshape(count, size, size + width)
            stiff, coupling = whole[..., :size], whole[..., size:]
            # The product of an inverse and the coupling would have a larger rounding error.
            found = np.linalg.solve(stiff, np.concatenate([coupling, right[inner]], axis=2))
            carried = -coupling.swapaxes(1, 2) @ found
            parts.append((stiff, found[..., :width]))
            insides.append(found[..., width:])
            fill.append(carried[..., :width].ravel())
            pushed.append(carried[..., width:].reshape(outer.size, -1))
        factored, moved = self.matrix.eliminate(np.concatenate(fill), self._loads(right, pushed))
        found = FactoredBlocks(self, parts, factored)
        return found, found.complete(moved, insides)

    def _loads(self, right: Array, pushed: list[Array]) -> Array:
        """Return the loads (j, p) of the joints, to which the blocks add `pushed`."""
        return right[self.joints] + self.sources @ (
            pushed[0] if len(pushed) == 1 else np.concatenate(pushed)
        )


class FactoredBlocks(NamedTuple):
    """Matrix with eliminated blocks."""

    numbers: BlockMatrix
    parts: list[tuple[Array, Array]]  #: blocks (b, s, s); their inverses times coupling (b, s, t)
    joints: FactoredMatrix

    def solve(self, right: Array) -> Array:
        """Return the unknowns (u, p) for right-hand sides (u, p); those not free are zero."""
        insides, pushed = [], []
        for (inner, outer, _), (stiff, spread) in zip(
            self.numbers.blocks, self.parts, strict=True
        ):
            push = right[inner]
            insides.append(np.linalg.solve(stiff, push))
            pushed.append(-(spread.swapaxes(1, 2) @ push).reshape(outer.size, -1))
        return self.complete(self.joints.solve(self.numbers._loads(right, pushed)), insides)

    def complete(self, joints: Array, insides: list[Array]) -> Array:
        """Return the unknowns (u, p) from those of the joints, and of blocks with fixed joints."""
        numbers, columns = self.numbers, joints.shape[1]
        moved, found = np.zeros((len(joints) + 1, columns)), np.zeros((numbers.count, columns))
        found[numbers.joints] = moved[:-1] = joints
        groups = zip(numbers.blocks, self.parts, insides, strict=True)
        for (inner, outer, _), (_, spread), inside in groups:
            found[inner] = inside - spread @ moved[outer]
        return found

    @property
    def condition(self) -> float:
        """Return the largest condition number of the blocks and of the joints' matrix [-]."""
        return max(
            self.joints.condition,
            *(float(np.linalg.cond(stiff, 1).max()) for stiff, _ in self.parts),
        )

    @property
    def negative_pivots(self) -> int:
        """Return the number of negative eigenvalues: the sum over all blocks (Haynsworth)."""
        return self.joints.negative_pivots + sum(
            count_negative_pivots(each, 0) for stiff, _ in self.parts for each in stiff
        )
