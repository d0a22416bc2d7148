# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Numbering of the unknowns of a frame, and elimination of its blocks.

The unknowns are the multipliers of the constraints, then the displacements of all nodes. A hinge
is a node at which all members are pinned. Members and constraints join the other nodes to blocks;
the tubes of a robot are blocks. A block is condensed to the hinges to which it is connected; the
matrix of the hinges is dense, or sparse. A member or constraint between hinges is a block without
unknowns of its own.
"""

from __future__ import annotations

from collections import defaultdict
import functools
from typing import NamedTuple

from isotruss_ros.core.kinematics.constraints import MAX_DENSE_COORDINATES
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices
from isotruss_ros.core.numerics.factorization import count_negative_pivots, factorize
import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components


class Members(NamedTuple):
    """Straight members between nodes, as arrays with one entry for each of k members."""

    start: Indices  #: (k,) indices of the start nodes
    end: Indices  #: (k,) indices of the end nodes
    #: (3, k) EA [N], EI [N m^2] and GA [N], which is infinite without shear deformation
    section: Array
    pinned_start: Flags  #: (k,) whether the start transmits no moment
    pinned_end: Flags  #: (k,) whether the end transmits no moment


class Block(NamedTuple):
    """Members and constraints of a block, its unknowns, and the hinges' unknowns."""

    members: Indices
    rows: Indices  #: constraints
    inner: Indices  #: unknowns of the block
    outer: Indices  #: unknowns of the hinges to which it is connected, fixed ones included


class Group(NamedTuple):
    """Group of b blocks with equal numbers of members, constraints and unknowns."""

    ids: Indices  #: (b,) indices of the blocks
    members: Indices  #: (b, e) indices of their members among the parts of a frame
    rows: Indices  #: (b, r) indices of their constraints among the constraints of a frame's parts
    inner: Indices  #: (b, s) unknowns of the blocks
    outer: Indices  #: (b, t) unknowns of the hinges
    joints: Indices  #: (b, t) indices among `Numbering.joints`; their number for fixed unknowns
    #: places of the stiffness of members and constraints in the matrices (b, t + s, t + s)
    slots: Indices

    def assemble(self, members: Array, rows: Array) -> Array:
        """Return the blocks' matrices (b, t + s, t + s) from those of members and constraints."""
        count, width = len(self.ids), self.outer.shape[1] + self.inner.shape[1]
        entries = np.concatenate([members[self.members].ravel(), rows[self.rows].ravel()])
        size = count * width**2
        return np.bincount(self.slots, entries, size + 1)[:size].reshape(count, width, width)


class Numbering:
    """
    Numbering of the unknowns of all frames with equal connections and supports.

    The matrix of the hinges' unknowns `joints` is dense, or has the sparsity pattern `sparse` (row
    indices and column pointers).
    `joint_slots` are the places of the Schur complement of each block among its `joint_size`
    entries. `columns` (c, w) are the displacements in each constraint.
    """

    def __init__(
        self, members: Members, held: Flags, columns: Indices, condensed: bool = True
    ) -> None:
        self.members, self.rows = members, len(columns)
        solid = np.zeros(len(held), dtype=bool)
        solid[members.start[~members.pinned_start]] = True
        solid[members.end[~members.pinned_end]] = True
        real = np.ones(self.rows + held.size, dtype=bool)
        real[self.rows + 3 * np.arange(len(held)) + 2] = solid
        self.free = real & ~np.append(np.zeros(self.rows, dtype=bool), held.ravel())
        #: (k, 6) and (c, 1 + w) unknowns of members and constraints
        self.places = self.rows + member_places(members.start, members.end)
        self.row_places = np.column_stack([np.arange(self.rows), self.rows + columns])
        owner = _find_owners(self, solid) if condensed else np.full(len(real), -1)
        # A frame without hinges is a block.
        self.condensed = owner.max() >= 0 and bool((self.free & (owner < 0)).any())
        if not self.condensed:
            owner[:] = -1
        self.joints = np.flatnonzero(self.free & (owner < 0))
        self.blocks, self.owner = self._collect(owner, real)
        self._number_joints()

    def _collect(self, owner: Indices, real: Flags) -> tuple[list[Block], Indices]:
        """Return the blocks, and the block (k,) of each member."""
        owners = [owner[unknowns].max(axis=1) for unknowns in (self.places, self.row_places)]
        block, first = np.concatenate(owners), int(owner.max()) + 1
        alone = np.flatnonzero(block < 0)
        block[alone] = first + np.arange(len(alone))
        (members, rows), count = np.split(block, [len(self.places)]), first + len(alone)
        inner = _split(np.where(self.free, owner, -1), count)
        blocks = []
        for chosen, bound, inside in zip(
            _split(members, count), _split(rows, count), inner, strict=True
        ):
            unknowns = np.append(self.places[chosen], self.row_places[bound])
            outer = np.unique(unknowns[(owner[unknowns] < 0) & real[unknowns]])
            blocks.append(Block(chosen, bound, inside, outer))
        return blocks, members

    def _number_joints(self) -> None:
        """Set the places of the blocks in the matrix of the hinges, dense or sparse."""
        count, self.sparse = len(self.joints), None
        self.joint = np.full(len(self.free), count)
        self.joint[self.joints] = np.arange(count)
        keys, sizes = [], []
        for block in self.blocks:
            outer = self.joint[block.outer]
            pairs = np.add.outer(outer * count, outer)
            keys.append(np.where(np.maximum.outer(outer, outer) < count, pairs, -1).ravel())
            sizes.append(pairs.size)
        key, self.joint_size = np.concatenate(keys), count**2
        if count > MAX_DENSE_COORDINATES:
            unique, key = np.unique(np.append(-1, key), return_inverse=True)
            unique, key = unique[1:], key[1:] - 1
            pointers = np.searchsorted(unique, count * np.arange(count + 1))
            self.sparse, self.joint_size = (unique % count, pointers), len(unique)
        key[key < 0] = self.joint_size
        self.joint_slots = np.split(key, np.cumsum(sizes)[:-1])

    def active_blocks(self, pieces: Indices) -> Indices:
        """Return the blocks that contain members, and those without unknowns of their own."""
        hinged = [i for i, block in enumerate(self.blocks) if not len(block.inner)]
        return np.union1d(self.owner[pieces], np.array(hinged, dtype=np.intp))

    @functools.cached_property
    def whole(self) -> Layout:
        """Return the layout of the frames without cuts."""
        none = np.zeros(0, dtype=np.intp)
        return Layout(self, none, none, np.arange(len(self.blocks)))


class Layout:
    """
    Connections of a frame's parts: members of the blocks `active`, some of them divided at c cuts.

    Cut i divides the member `piece[i]`; `order` sorts the cuts by member and along each member.
    The nodes at the cuts are the last nodes. `whole` (p,) is the member of each part; the last
    parts begin at the cuts. `before` (c,) are the parts that end at the cuts, `behind` (c,) those
    that begin there, `beside` (2 c,) both, and `parts` all parts of divided members; `longer` (p,
    c) are the changes of the parts' lengths by unit motions of the cuts. The blocks that are not
    active are `kept`: index of a group of `Numbering.whole`, and indices in this group.
    """

    def __init__(
        self, numbering: Numbering, piece: Indices, order: Indices, active: Indices
    ) -> None:
        self.numbering, self.active = numbering, active
        blocks, members = numbering.blocks, numbering.members
        chosen = np.sort(np.concatenate([blocks[i].members for i in active.tolist()]))
        self.rows = np.sort(np.concatenate([blocks[i].rows for i in active.tolist()]))
        self.whole = np.append(chosen, piece)
        self.start, self.end = members.start[self.whole], members.end[self.whole]
        self.pins = members.pinned_start[self.whole], members.pinned_end[self.whole]
        within = self._cut(piece, order, chosen)
        self.ends = member_places(self.start, self.end)
        self.places = numbering.rows + self.ends
        self.row_places = numbering.row_places[self.rows]
        self.groups = self._group(within, chosen)
        groups = numbering.whole.groups if len(active) < len(blocks) else []
        others = [np.flatnonzero(~np.isin(group.ids, active)) for group in groups]
        self.kept = [(number, rows) for number, rows in enumerate(others) if len(rows)]
        self.kept_ids = [groups[number].ids[rows] for number, rows in self.kept]
        ids = np.concatenate([group.ids for group in self.groups] + self.kept_ids).tolist()
        self.joint_slots = np.concatenate([numbering.joint_slots[i] for i in ids])
        joints = np.concatenate([group.joints.ravel() for group in self.groups])
        #: matrix (j, q) that sums values at the hinges of the groups' blocks
        coupled = np.flatnonzero(joints < len(numbering.joints))
        shape, entries = (len(numbering.joints), len(joints)), (joints[coupled], coupled)
        sources = csr_matrix((np.ones(len(coupled)), entries), shape=shape)
        self.sources = sources.toarray() if numbering.sparse is None else sources

    def _cut(self, piece: Indices, order: Indices, chosen: Indices) -> dict[int, list[int]]:
        """Divide members at the cuts; return the cuts of each block by its number."""
        numbering, first, cuts = self.numbering, len(chosen), np.arange(len(piece))
        self.before, self.behind = np.zeros_like(cuts), first + cuts
        self.nodes = (len(numbering.free) - numbering.rows) // 3 + cuts
        along = defaultdict[int, list[int]](list)
        for cut in order.tolist():
            along[int(piece[cut])].append(cut)
        parts: list[int] = []
        within = defaultdict[int, list[int]](list)
        for member, divided in along.items():
            chain = [int(np.searchsorted(chosen, member)), *(first + cut for cut in divided)]
            self.start[chain[1:]] = self.end[chain[:-1]] = self.nodes[divided]
            self.pins[0][chain[1:]] = self.pins[1][chain[:-1]] = False
            self.before[divided] = chain[:-1]
            parts += chain
            within[int(numbering.owner[member])] += divided
        self.parts = np.array(parts, dtype=np.intp)
        self.beside = np.append(self.before, self.behind)
        self.signs = np.repeat([-1.0, 1.0], len(cuts))
        self.longer = np.zeros((len(self.whole), len(cuts)))
        self.longer[self.before, cuts] = 1.0
        self.longer[self.behind, cuts] -= 1.0
        return within

    def _group(self, within: dict[int, list[int]], chosen: Indices) -> list[Group]:
        """Return the chosen blocks in groups, with the unknowns at the cuts in each block."""
        numbering, first = self.numbering, len(chosen)
        alike = defaultdict[tuple[int, ...], list[tuple[Indices, ...]]](list)
        for i in self.active.tolist():
            members, rows, inner, outer = numbering.blocks[i]
            cuts = np.array(within.get(i, ()), dtype=np.intp)
            at_cuts = len(numbering.free) + (3 * cuts[:, None] + np.arange(3)).ravel()
            members = np.append(np.searchsorted(chosen, members), first + cuts)
            block = members, np.searchsorted(self.rows, rows), np.append(inner, at_cuts), outer
            alike[tuple(map(len, block))].append((np.array(i), *block))
        groups = []
        for equal in alike.values():
            ids, members, rows, inner, outer = map(np.stack, zip(*equal, strict=True))
            unknowns = np.hstack([outer, inner])
            slots = [
                _find_slots(indices, unknowns)
                for indices in (self.places[members], self.row_places[rows])
            ]
            joints = numbering.joint[outer]
            groups.append(Group(ids, members, rows, inner, outer, joints, np.concatenate(slots)))
        return groups


@functools.lru_cache(maxsize=64)
def lay_out(numbering: Numbering, piece: bytes, order: bytes, active: bytes) -> Layout:
    """Return a layout from the bytes of its index arrays, cached."""
    return Layout(
        numbering, *(np.frombuffer(data, dtype=np.intp) for data in (piece, order, active))
    )


class Condensed(NamedTuple):
    """Matrix with eliminated blocks, scaled."""

    #: for each group, blocks (b, s, s), and displacements (b, s, t) of their unknowns by unit
    #: displacements of the hinges
    parts: list[tuple[Array, Array]]
    schur: list[Array]  #: for each group, stiffness (b, t, t) of the hinges
    matrix: Array | csc_matrix  #: (j, j) matrix of the hinges

    @property
    def negative_pivots(self) -> int:
        """Return the number of negative eigenvalues: the sum over all blocks (Haynsworth)."""
        blocks = [block for stiff, _ in self.parts for block in stiff if block.size]
        return sum(map(count_negative_pivots, [self.matrix, *blocks]))


def eliminate(
    layout: Layout, matrices: list[Array], kept: list[Array], right: Array
) -> tuple[Condensed, Array]:
    """
    Eliminate the blocks of a matrix, and solve for right-hand sides (u, p).

    The groups have the matrices (b, t + s, t + s), and those of kept blocks (b, t, t). Unknowns
    that are not free are zero.
    """
    parts, schur, insides, pushed = [], [], [], []
    numbering, columns = layout.numbering, right.shape[1]
    for group, whole in zip(layout.groups, matrices, strict=True):
        width = group.outer.shape[1]
        stiff, coupling = whole[:, width:, width:], whole[:, width:, :width]
        # The product of an inverse and the coupling would have a larger rounding error.
        answer = np.linalg.solve(stiff, np.concatenate([coupling, right[group.inner]], axis=2))
        carried = coupling.swapaxes(1, 2) @ answer
        schur.append(whole[:, :width, :width] - carried[..., :width])
        parts.append((stiff, -answer[..., :width]))
        insides.append(answer[..., width:])
        pushed.append(carried[..., width:].reshape(group.outer.size, columns))
    count = len(numbering.joints)
    entries = np.concatenate([block.ravel() for block in schur + kept])
    entries = np.bincount(layout.joint_slots, entries, numbering.joint_size + 1)[:-1]
    if numbering.sparse is None:
        matrix = entries.reshape(count, count)
    else:
        matrix = csc_matrix((entries, *numbering.sparse), shape=(count, count))
    moved, solution = np.zeros((count + 1, columns)), np.zeros(right.shape)
    push = right[numbering.joints] - layout.sources @ np.concatenate(pushed)
    solution[numbering.joints] = moved[:-1] = factorize(matrix.copy()).solve(push)
    for group, (_, spread), inside in zip(layout.groups, parts, insides, strict=True):
        solution[group.inner] = inside + spread @ moved[group.joints]
    return Condensed(parts, schur, matrix), solution


def member_places(start: Indices, end: Indices) -> Indices:
    """Return the indices (k, 6) of the displacements of the start and end nodes of members."""
    return (3 * np.stack([start, end], axis=1)[:, :, None] + np.arange(3)).reshape(-1, 6)


def _find_owners(numbering: Numbering, solid: Flags) -> Indices:
    """Return the block (u,) of each unknown of solid nodes (n,), -1 for unknowns of others."""
    nodes, rows = len(solid), numbering.rows
    # Vertices of the graph are the constraints, then the nodes.
    one = np.append(
        rows + numbering.members.start,
        numbering.row_places[:, :1].repeat(numbering.row_places.shape[1] - 1, axis=1),
    )
    other = np.append(numbering.members.end, (numbering.row_places[:, 1:] - rows) // 3) + rows
    within = np.append(np.ones(rows, dtype=bool), solid)
    joined = within[one] & within[other]
    graph = coo_matrix((joined[joined], (one[joined], other[joined])), shape=(rows + nodes,) * 2)
    number, label = connected_components(graph, directed=False)
    label = np.append(label[:rows], label[rows:].repeat(3))
    chosen = np.zeros(number, dtype=bool)
    chosen[label[rows::3][solid]] = True
    chosen &= np.bincount(label, minlength=number) <= MAX_DENSE_COORDINATES
    return np.where(chosen, np.cumsum(chosen) - 1, -1)[label]


def _split(values: Indices, count: int) -> list[Indices]:
    """Return, for each value 0, 1, ..., count - 1, the indices at which it occurs."""
    order = np.argsort(values, kind='stable')
    return np.split(order, np.searchsorted(values[order], np.arange(count + 1)))[1:-1]


def _find_slots(indices: Indices, unknowns: Indices) -> Indices:
    """
    Return the indices of the entries of e matrices (w, w) in the stacked matrices of b blocks.

    They have the unknowns `indices` (b, e, w) and `unknowns` (b, s); others are behind all.
    """
    count, size = unknowns.shape
    matches = indices.reshape(count, -1, 1) == unknowns[:, None]
    local = np.where(matches.any(axis=2), matches.argmax(axis=2), -1).reshape(indices.shape)
    first, second = np.broadcast_arrays(local[..., :, None], local[..., None, :])
    offset = size**2 * np.arange(count)[:, None, None, None]
    slots = offset + size * first + second
    return np.where((first < 0) | (second < 0), count * size**2, slots).ravel()
