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
    """Kinds of the unknowns of a matrix, as masks (u,)."""

    free: Flags  #: unknowns; displacements that supports fix are not
    real: Flags  #: displacements and multipliers; rotations of hinges are not
    multiplier: Flags  #: multipliers of constraints


class Blocks(NamedTuple):
    """Group of b blocks of equal size, each with s unknowns that are coupled to t joints."""

    inner: Indices  #: (b, s) indices of the blocks' unknowns
    outer: Indices  #: (b, t) indices among the joints; their number for fixed displacements
    part: slice  #: entries (b, s, s + t) among the packed entries of all blocks


class BlockMatrix:
    """
    Numbering of the blocks and joints of a matrix.

    :ivar joints: (j,) indices of the joints' unknowns.
    :ivar constraints: number of multipliers among them, which are the last ones.
    :ivar blocks: groups of blocks.
    :ivar slots: (e,) places of the entries among the packed entries of all blocks.
    :ivar size: number of packed entries; the last one is for entries of no block.
    :ivar units: places of diagonal entries that are 1, of fixed displacements.
    :ivar direct: indices of the entries that are in the matrix of the joints.
    :ivar joint_slots: places of these, then of the Schur complements, in the joints' matrix.
    :ivar joint_size: number of entries of the joints' matrix.
    :ivar sparse: row indices and column pointers of the joints' matrix; None if it is dense.
    :ivar sources: matrix (j, .) that sums the coupled unknowns of all blocks at the joints.

    :param entries: row and column (e,) of each entry.
    :param owner: block (u,) of each unknown, -1 for joints.
    """

    def __init__(
        self, entries: tuple[Indices, Indices], owner: Indices, unknowns: Unknowns
    ) -> None:
        first, second = entries
        inner, self.count = owner >= 0, len(owner)
        self.joints = np.flatnonzero(~inner & unknowns.free)
        self.constraints = int(np.count_nonzero(unknowns.multiplier[self.joints]))
        count = len(self.joints)
        joint = np.full(len(owner), count)
        joint[self.joints] = np.arange(count)
        across = inner[first] & ~inner[second] & unknowns.real[second]
        diagonal = self._number_blocks(owner, across, entries, joint)
        self.units = diagonal[np.flatnonzero(inner & ~unknowns.free)]
        rows, columns = joint[first], joint[second]
        self.direct = np.flatnonzero((rows < count) & (columns < count))
        outer = [each.outer for each in self.blocks]
        filled = [np.broadcast_arrays(each[:, :, None], each[:, None]) for each in outer]
        rows = np.concatenate([rows[self.direct], *(pair[0].ravel() for pair in filled)])
        columns = np.concatenate([columns[self.direct], *(pair[1].ravel() for pair in filled)])
        self._number_joints(rows, columns)
        ahead = np.concatenate([rows[:0], *(each.ravel() for each in outer)])
        coupled = np.flatnonzero(ahead < count)
        places = ahead[coupled], coupled
        sources = csr_matrix((np.ones(len(coupled)), places), shape=(count, len(ahead)))
        self.sources = sources.toarray() if self.sparse is None else sources

    def _number_blocks(
        self, owner: Indices, across: Flags, entries: tuple[Indices, Indices], joint: Indices
    ) -> Indices:
        """Number the entries of the blocks; return the index of each diagonal entry (u,)."""
        (first, second), count, inner = entries, len(owner), owner >= 0
        order = np.argsort(owner, kind='stable')
        order, sizes = order[inner[order]], np.bincount(owner[inner], minlength=1)
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
            alike, area = np.flatnonzero((sizes == size) & (widths == width)), size + width
            offsets[alike] = begin + size * area * np.arange(len(alike))
            part = slice(begin, begin + size * area * len(alike))
            outside = joint[unknown[np.isin(coupled, alike)]].reshape(len(alike), width)
            inside = order[np.isin(owner[order], alike)].reshape(len(alike), size)
            self.blocks += [Blocks(inside, outside, part)] if size else []
            begin = part.stop
        row, inside = sizes + widths, inner[first] & (inner[second] | across)
        self.slots, self.size, block = np.full(len(first), begin), begin + 1, owner[first[inside]]
        self.slots[inside] = offsets[block] + local[first[inside]] * row[block] + slot[inside]
        return offsets[owner] + local * (row[owner] + 1)

    def _number_joints(self, rows: Indices, columns: Indices) -> None:
        """Number the entries of the joints' matrix, dense or sparse."""
        count, self.sparse = len(self.joints), None
        there = np.flatnonzero((rows < count) & (columns < count))
        keys, self.joint_size = columns[there] * count + rows[there], count**2
        if count > MAX_DENSE_COORDINATES:
            unique, keys = np.unique(keys, return_inverse=True)
            pointers = np.searchsorted(unique, count * np.arange(count + 1))
            self.sparse, self.joint_size = (unique % count, pointers), len(unique)
        self.joint_slots = np.full(len(rows), self.joint_size)
        self.joint_slots[there] = keys

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
        entries = np.bincount(self.joint_slots, np.concatenate(fill), self.joint_size + 1)[:-1]
        count = len(self.joints)
        if self.sparse is None:
            matrix = entries.reshape(count, count)
        else:
            matrix = csc_matrix((entries, *self.sparse), shape=(count, count))
        factored = FactoredBlocks(self, parts, matrix, factorize(matrix.copy()))
        return factored, factored.complete(right, insides, pushed)


class FactoredBlocks(NamedTuple):
    """Matrix with eliminated blocks."""

    numbers: BlockMatrix
    parts: list[tuple[Array, Array]]  #: blocks (b, s, s); their inverses times coupling (b, s, t)
    matrix: Array | csc_matrix  #: (j, j) matrix of the joints
    joints: Factor  #: its factorisation

    def solve(self, right: Array) -> Array:
        """Return the unknowns (u, p) for right-hand sides (u, p); those not free are zero."""
        insides, pushed = [], []
        groups = zip(self.numbers.blocks, self.parts, strict=True)
        for (inner, outer, _), (stiff, spread) in groups:
            push = right[inner]
            insides.append(np.linalg.solve(stiff, push))
            pushed.append(-(spread.swapaxes(1, 2) @ push).reshape(outer.size, -1))
        return self.complete(right, insides, pushed)

    def complete(self, right: Array, insides: list[Array], pushed: list[Array]) -> Array:
        """
        Return the unknowns (u, p) from those of the blocks with fixed joints, `insides` (b, s, p).

        The blocks exert the forces `pushed` (b t, p) on the fixed joints.
        """
        numbers, loads = self.numbers, right[self.numbers.joints]
        if pushed:
            loads += numbers.sources @ (pushed[0] if len(pushed) == 1 else np.concatenate(pushed))
        moved, found = np.zeros((len(loads) + 1, loads.shape[1])), np.zeros(right.shape)
        found[numbers.joints] = moved[:-1] = self.joints.solve(loads)
        groups = zip(numbers.blocks, self.parts, insides, strict=True)
        for (inner, outer, _), (_, spread), inside in groups:
            found[inner] = inside - spread @ moved[outer]
        return found

    @property
    def condition(self) -> float:
        """Return the largest condition number of the blocks and of the joints' matrix [-]."""
        blocks = (_norms(stiff) * _norms(np.linalg.inv(stiff)) for stiff, _ in self.parts)
        return max(factorize_with_condition(self.matrix)[1], *(each.max() for each in blocks), 0.0)

    @property
    def negative_pivots(self) -> int:
        """Return the number of negative eigenvalues: the sum over all blocks (Haynsworth)."""
        return count_negative_pivots(self.matrix, self.numbers.constraints) + sum(
            count_negative_pivots(each, 0) for stiff, _ in self.parts for each in stiff
        )


def _norms(matrices: Array) -> Array:
    """Return the 1-norms (b,) of matrices (b, s, s)."""
    return np.abs(matrices).sum(axis=1).max(axis=1)
