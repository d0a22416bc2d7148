# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Blocks of a frame, which are eliminated one by one, and its bisection constraints."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
import functools
from typing import NamedTuple

from isotruss_ros.core.kinematics.constraints import MAX_DENSE_COORDINATES
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.numerics.factorization import count_negative_pivots, factorize, solve_each
from isotruss_ros.core.numerics.samples import sum_at
import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components

# Bisection constraints (3) of a frame: the rod of a module bisects the angle of its guide arms.
#
# With the joint A, the pinch points B and C and the guide rings D and E of a module, the rod is
# the vector from A to the midpoint of BC, and the arms are BD and CE. The rod turns by the mean of
# the rotations of both arms. Each constraint has a Lagrange multiplier.

#: Rod and arms of a module as combinations of its nodes A, B, C, D, E.
VECTORS = np.array([[-1.0, 0.5, 0.5, 0, 0], [0, -1.0, 0, 1.0, 0], [0, 0, -1.0, 0, 1.0]])
#: Factors of the rotations of rod and arms in a constraint.
WEIGHTS = np.array([2.0, -1.0, -1.0])
#: The combinations by nodes, and the products of their factors for pairs of nodes. They are
#: complex, because products of real and complex matrices take longer.
BY_NODES = VECTORS.T.astype(np.complex128)
BY_PAIRS = (VECTORS[:, :, None] * VECTORS[:, None]).reshape(3, -1).astype(np.complex128)


class Bisections(NamedTuple):
    """Bisection constraints of c modules."""

    nodes: Indices  #: (c, 5) indices of the nodes A, B, C, D, E

    @property
    def places(self) -> Indices:
        """Return the indices (c, 10) of the displacements ux, uy of the nodes among all (3 n,)."""
        return (3 * self.nodes[:, :, None] + [0, 1]).reshape(-1, 10)

    def slopes(self, points: Points, chosen: Indices) -> Array:
        """Return the derivatives (..., q, 10) of q chosen constraints, see `linearize`."""
        return _gradients(points.take(self.nodes[chosen], axis=-1) @ VECTORS.T)

    def linearize(
        self, points: Points, displacements: Array, multipliers: Array, chosen: Indices
    ) -> tuple[Array, Array, Array]:
        """
        Linearise q chosen constraints about displacements (..., n, 3) of nodes at points (..., n).

        The result is the derivatives (..., q, 10) by the displacements at `places`, the gaps (...,
        q) [rad], and the geometric stiffness (..., q, 10, 10) due to the multipliers (..., c).
        """
        nodes = self.nodes[chosen]
        vectors = points.take(nodes, axis=-1) @ BY_NODES
        shifts = displacements[..., 0] + 1j * displacements[..., 1]
        displaced = vectors + shifts.take(nodes, axis=-1) @ BY_NODES
        rotations = displaced * vectors.conj()
        gaps = np.arctan2(rotations.imag, rotations.real) @ WEIGHTS
        # With z = x + iy, the second derivatives xx, yy and xy of arg z are Im(-1/z^2), Im(1/z^2)
        # and Re(-1/z^2).
        curvatures = -WEIGHTS * multipliers[..., chosen, None] / displaced**2
        of_nodes = (curvatures @ BY_PAIRS).reshape(*gaps.shape, 5, 5)
        # Axes: sample, constraint, node, x or y, node, x or y.
        stiffness = np.empty((*gaps.shape, 5, 2, 5, 2))
        stiffness[..., 0, :, 0], stiffness[..., 1, :, 1] = of_nodes.imag, -of_nodes.imag
        stiffness[..., 0, :, 1] = stiffness[..., 1, :, 0] = of_nodes.real
        return _gradients(displaced), gaps, stiffness.reshape(*gaps.shape, 10, 10)


def _gradients(vectors: Points) -> Array:
    """Return derivatives (..., q, 10) of constraints by the nodes, for rods and arms (q, 3)."""
    # A gradient (d/dx, d/dy) of arg z is the complex number d/dx + i d/dy = i / conj(z).
    return np.ascontiguousarray((1j * WEIGHTS / vectors.conj()) @ VECTORS).view(np.float64)


# Numbering of the unknowns of a frame, and elimination of its blocks.
#
# The unknowns are the multipliers of the constraints, then the displacements of all nodes. A hinge
# is a node at which all members begin and are pinned. Members and constraints join the other nodes
# to blocks; the tubes of a robot are blocks. A block is condensed to the hinges to which it is
# connected; the matrix of the hinges is dense, or sparse. A member or constraint between hinges is
# a block without unknowns of its own.


class Group(NamedTuple):
    """Group of b blocks with equal numbers of members, constraints and unknowns."""

    ids: Indices  #: (b,) indices of the blocks
    members: Indices  #: (b, e) indices of their members among the parts of a frame
    rows: Indices  #: (b, r) indices of their constraints among the constraints of a frame's parts
    inner: Indices  #: (b, s) unknowns of the blocks
    outer: Indices  #: (b, t) unknowns of the hinges
    #: (b, q) places of the entries of members and constraints in b matrices (t + s + 1, t + s +
    #: 1), whose last rows and columns are for other unknowns
    slots: Indices
    hinges: Indices  #: (b, t) `Numbering.hinge_index` of the unknowns of the hinges

    def assemble(self, members: Array, rows: Array) -> Array:
        """Return the blocks' matrices (b, t + s, t + s) from those of members and constraints."""
        count, width = len(self.ids), self.outer.shape[1] + self.inner.shape[1] + 1
        lead = members.shape[:-3]
        of_members = members.take(self.members, axis=-3).reshape(*lead, count, -1)
        of_rows = rows.take(self.rows, axis=-3).reshape(*lead, count, -1)
        entries = np.concatenate([of_members, of_rows], axis=-1).reshape(*lead, -1)
        sums = sum_at(self.slots.ravel(), entries, count * width**2)
        return sums.reshape(*lead, count, width, width)[..., :-1, :-1]


class Numbering:
    """
    Members, supports and constraints of frames, and the numbering of their unknowns.

    Members `start` (k,) to `end` (k,) between nodes are `pinned` (k,) if their starts transmit no
    moment. Supports fix displacements `held` (n, 3). `names` of the nodes are for error messages.
    `hinges` (j,) are the unknowns of the hinges; `hinge_index` (u,) is the index of each unknown
    among these, and j for all other unknowns.
    """

    def __init__(
        self,
        names: Sequence[str],
        start: Indices,
        end: Indices,
        pinned: Flags,
        held: Flags,
        constraints: Bisections,
    ) -> None:
        self.names, self.held, self.constraints = names, held, constraints
        self.start, self.end, self.pinned = start, end, pinned
        #: number of multipliers, which are the first unknowns
        self.rows = len(constraints.places)
        # A node with fixed members is solid; the other nodes are hinges, without a rotation.
        is_solid = np.zeros(len(held), dtype=bool)
        is_solid[start[~pinned]] = is_solid[end] = True
        exists = np.ones((len(held), 3), dtype=bool)
        exists[:, 2] = is_solid
        is_multiplier = np.ones(self.rows, dtype=bool)
        #: (u,) whether an unknown exists and is not fixed
        self.free = np.append(is_multiplier, exists & ~held)
        #: (k, 6) and (c, 1 + w) unknowns of members and constraints
        self.places = self.rows + member_places(start, end)
        self.row_places = np.column_stack([np.arange(self.rows), self.rows + constraints.places])
        # Block of each unknown; -1 for those of hinges between the blocks.
        block_of = _find_blocks(self, is_solid)
        if not (self.free & (block_of < 0)).any():  # a frame without hinges has one matrix
            block_of[:] = -1
        self.hinges = np.flatnonzero(self.free & (block_of < 0))
        self.hinge_index = np.full(len(block_of), len(self.hinges))
        self.hinge_index[self.hinges] = np.arange(len(self.hinges))
        self.is_sparse = len(self.hinges) > MAX_DENSE_COORDINATES
        # Members and constraints are in the block of their unknowns. Each of those between hinges
        # is a block of its own.
        elements = [*self.places, *self.row_places]
        owners = np.array([block_of[unknowns].max() for unknowns in elements])
        between_hinges = np.flatnonzero(owners < 0)
        owners[between_hinges] = block_of.max() + 1 + np.arange(len(between_hinges))
        #: (k,) and (c,) blocks of members and constraints
        self.owner, self.row_owner = np.split(owners, [len(self.places)])
        is_at_hinge = (block_of < 0) & np.append(is_multiplier, exists)
        #: unknowns of each block, and those of its hinges, fixed ones included
        self.blocks: list[tuple[Indices, Indices]] = []
        for i in range(int(owners.max()) + 1):
            unknowns = np.concatenate([elements[k] for k in np.flatnonzero(owners == i)])
            outer = np.unique(unknowns[is_at_hinge[unknowns]])
            self.blocks.append((np.flatnonzero(self.free & (block_of == i)), outer))
        #: blocks without unknowns of their own
        self.hinged = np.flatnonzero([not len(inner) for inner, _ in self.blocks])

    @functools.cached_property
    def whole(self) -> Layout:
        """Return the layout of the frames without cuts."""
        none = np.zeros(0, dtype=np.intp)
        return Layout(self, none, none, np.arange(len(self.blocks)))


class Layout:
    """
    Parts of a frame, which are the members of the blocks `active`, some divided at c cuts.

    Cut i divides the member `piece[i]`; `order` sorts the cuts by member and along each member.
    The last `nodes` (c,) are at the cuts. `whole` (p,) is the member of each part; the last parts
    begin at the cuts. `before` (c,) are the parts that end at the cuts, `behind` (c,) those that
    begin there, `beside` (2 c,) both with `signs` -1 and 1, and `parts` all of them;
    `length_by_motions` (p, c) are the changes of the parts' lengths by unit motions of the cuts.
    The blocks that are not active are `kept`: index of a group of `Numbering.whole`, and indices
    in this group.
    """

    def __init__(
        self, numbering: Numbering, piece: Indices, order: Indices, active: Indices
    ) -> None:
        self.numbering, self.active = numbering, active
        #: layouts of a numbering with equal keys are equal, whether or not one has been pickled
        self.key = piece.tobytes(), order.tobytes(), active.tobytes()
        # Members of the active blocks, and then the parts behind the cuts.
        cuts = np.arange(len(piece))
        members = np.flatnonzero(np.isin(numbering.owner, active))
        self.rows = np.flatnonzero(np.isin(numbering.row_owner, active))
        self.whole = np.append(members, piece)
        self.behind = len(members) + cuts
        self.nodes = len(numbering.held) + cuts
        self.start, self.end = numbering.start[self.whole], numbering.end[self.whole]
        self.pinned = numbering.pinned[self.whole]
        self.pinned[self.behind] = False
        # The part before a cut begins at the member's start, or at the previous cut.
        divided, behind = piece[order], self.behind[order]
        is_first = np.diff(divided, prepend=-1) > 0
        before = np.where(is_first, np.searchsorted(members, divided), np.roll(behind, 1))
        self.before = np.zeros_like(cuts)
        self.before[order] = before
        self.start[behind] = self.end[before] = self.nodes[order]
        self.beside = np.append(self.before, self.behind)
        self.signs = np.repeat([-1.0, 1.0], len(piece))
        self.parts = np.unique(self.beside)
        # Weights of the inclinations at the ends of both parts beside a cut: their mean.
        self.mean_weights = 0.5 * np.tile(np.eye(len(piece)), 2)
        self.no_weights = np.zeros_like(self.mean_weights)
        #: (c, 3, 1) rows and (c, 1, 3) columns of unit loads on the nodes at the cuts, see
        #: `LoadResponses`
        columns = np.arange(3 * len(piece)).reshape(-1, 1, 3)
        self.unit_loads = columns.swapaxes(1, 2) - 3 * len(piece), columns
        part = np.arange(len(self.whole))[:, None]
        self.length_by_motions = np.subtract(part == self.before, part == self.behind, dtype=float)
        #: (u,) unknowns with the same scale in a frame without cuts: at cuts those of the start
        at_starts = 3 * numbering.start[piece][:, None] + np.arange(3)
        uncut = np.arange(len(numbering.free))
        self.scaled_as = np.append(uncut, numbering.rows + at_starts)
        self.ends = member_places(self.start, self.end)
        self.places = numbering.rows + self.ends
        self.row_places = numbering.row_places[self.rows]
        # Groups of active blocks, and the blocks of `Numbering.whole` that are kept.
        self.groups = self._group()
        groups = numbering.whole.groups if len(active) < len(numbering.blocks) else []
        inactive = [np.flatnonzero(~np.isin(group.ids, active)) for group in groups]
        self.kept = [(number, blocks) for number, blocks in enumerate(inactive) if len(blocks)]
        #: (b,) indices of these blocks
        self.kept_ids = np.array(
            [i for k, blocks in self.kept for i in groups[k].ids[blocks]], int
        )
        active_hinges = [group.hinges for group in self.groups]
        kept_hinges = [groups[number].hinges[blocks] for number, blocks in self.kept]
        size = len(numbering.hinges) + 1
        #: places of the Schur complements in the matrix of the hinges, with a last row and column
        self.entries = np.concatenate(
            [_matrix_places(hinges, size).ravel() for hinges in active_hinges + kept_hinges]
        )
        #: matrix (j, q) that sums values at the hinges of the groups' blocks
        columns = np.concatenate([hinges.ravel() for hinges in active_hinges])
        sums = np.ones(len(columns)), (columns, np.arange(len(columns)))
        self.sources = csr_matrix(sums, shape=(size, len(columns)))[:-1]
        if not numbering.is_sparse:
            self.sources = self.sources.toarray()

    def _group(self) -> list[Group]:
        """Return the active blocks in groups, with the unknowns at the cuts in each block."""
        numbering = self.numbering
        owner, row_owner = numbering.owner[self.whole], numbering.row_owner[self.rows]
        by_size = defaultdict[tuple[int, ...], list[tuple[Indices, ...]]](list)
        for block in self.active.tolist():
            members, rows = np.flatnonzero(owner == block), np.flatnonzero(row_owner == block)
            uncut_inner, outer = numbering.blocks[block]
            nodes = self.nodes[owner[self.behind] == block]
            inner = np.append(uncut_inner, numbering.rows + 3 * nodes[:, None] + np.arange(3))
            # Index of each unknown in the block's matrix; the last one is for other unknowns.
            width = len(outer) + len(inner) + 1
            index = np.full(len(numbering.free) + 3 * len(self.nodes), width - 1)
            index[np.append(outer, inner)] = np.arange(width - 1)
            of_members = _matrix_places(index[self.places[members]], width)
            of_rows = _matrix_places(index[self.row_places[rows]], width)
            # In the memory of a group, the matrix of this block follows those of earlier ones.
            group = by_size[len(members), len(rows), len(inner), len(outer)]
            slots = width**2 * len(group) + np.append(of_members, of_rows)
            hinges = numbering.hinge_index[outer]
            group.append((np.array(block), members, rows, inner, outer, slots, hinges))
        return [Group(*map(np.stack, zip(*blocks, strict=True))) for blocks in by_size.values()]


@functools.lru_cache(maxsize=256)
def lay_out(numbering: Numbering, piece: bytes, order: bytes, active: bytes) -> Layout:
    """Return a layout from the bytes of its index arrays, cached."""
    arrays = (np.frombuffer(data, dtype=np.intp) for data in (piece, order, active))
    return Layout(numbering, *arrays)


class Condensed(NamedTuple):
    """Scaled matrix of a frame, from which the blocks' own unknowns are eliminated."""

    inner: list[Array]  #: for each group, matrices (b, s, s) of the blocks' own unknowns
    #: for each group, displacements (b, s, t) of these unknowns by displacements of the hinges
    spread: list[Array]
    schur: list[Array]  #: for each group, stiffness (b, t, t) of the hinges
    #: (j, j) matrix of the hinges; a list of sparse matrices of several samples
    matrix: Array | csc_matrix | list[csc_matrix]

    @property
    def negative_pivots(self) -> int:
        """Return the number of negative eigenvalues: the sum over all blocks (Haynsworth)."""
        blocks = [block for group in self.inner for block in group if block.size]
        return sum(map(count_negative_pivots, [self.matrix, *blocks]))


def eliminate(
    layout: Layout, matrices: list[Array], kept: list[Array], right: Array
) -> tuple[Condensed, Array]:
    """Return the matrix without its blocks, and solutions (..., u, p) of p right-hand sides."""
    inner, spread, schur, with_fixed_hinges, hinge_loads = [], [], [], [], []
    numbering, (*lead, _, columns) = layout.numbering, right.shape
    for group, block in zip(layout.groups, matrices, strict=True):
        # The first unknowns of a block's matrix are those of its hinges.
        width = group.outer.shape[1]
        own_block, coupling = block[..., width:, width:], block[..., width:, :width]
        # The product of an inverse and the coupling would have a larger rounding error.
        own_right = np.concatenate([coupling, right.take(group.inner, axis=-2)], axis=-1)
        solved = solve_each(own_block, own_right)
        at_hinges = coupling.swapaxes(-1, -2) @ solved
        inner.append(own_block)
        spread.append(-solved[..., :width])
        schur.append(block[..., :width, :width] - at_hinges[..., :width])
        with_fixed_hinges.append(solved[..., width:])
        hinge_loads.append(at_hinges[..., width:].reshape(*lead, group.outer.size, columns))
    # The last row and column of the matrix are for fixed displacements of hinges, which are zero.
    size = len(numbering.hinges) + 1
    entries = np.concatenate([block.reshape(*lead, -1) for block in schur + kept], axis=-1)
    at_blocks = np.concatenate(hinge_loads, axis=-2)
    hinges, solution = np.zeros((*lead, size, columns)), np.zeros(right.shape)
    hinge_right = right.take(numbering.hinges, axis=-2)
    if numbering.is_sparse:
        places, matrix = np.divmod(layout.entries, size), []
        for i in np.ndindex(*lead):
            of_sample = csc_matrix((entries[i], places), shape=(size, size))[:-1, :-1]
            factor = factorize(of_sample)
            hinges[i][:-1] = factor.solve(hinge_right[i] - layout.sources @ at_blocks[i])
            matrix.append(of_sample)
        matrix = matrix if lead else matrix[0]
    else:
        matrix = sum_at(layout.entries, entries, size**2).reshape(*lead, size, size)
        matrix = matrix[..., :-1, :-1]
        hinges[..., :-1, :] = solve_each(matrix, hinge_right - layout.sources @ at_blocks)
    solution[..., numbering.hinges, :] = hinges[..., :-1, :]
    for group, by_hinges, constant in zip(layout.groups, spread, with_fixed_hinges, strict=True):
        solution[..., group.inner, :] = constant + by_hinges @ hinges.take(group.hinges, axis=-2)
    return Condensed(inner, spread, schur, matrix), solution


def member_places(start: Indices, end: Indices) -> Indices:
    """Return the indices (k, 6) of the displacements of the start and end nodes of members."""
    return (3 * np.stack([start, end], axis=1)[:, :, None] + np.arange(3)).reshape(-1, 6)


def _matrix_places(indices: Indices, width: int) -> Indices:
    """Return flat indices (b, q, q) of pairs of rows and columns (b, q), in a matrix."""
    return width * indices[:, :, None] + indices[:, None]


def _find_blocks(numbering: Numbering, is_solid: Flags) -> Indices:
    """Return the block (u,) of each unknown; -1 for unknowns of hinges and of large blocks."""
    # Vertices of the graph are the constraints and then the nodes, as in the unknowns. Edges are
    # the members and the nodes of the constraints, but no edge leads to a hinge.
    columns, rows = numbering.constraints.places, numbering.rows
    start = np.append(rows + numbering.start, np.arange(rows).repeat(columns.shape[1]))
    end = rows + np.append(numbering.end, columns // 3)
    is_connected = np.append(np.ones(rows, dtype=bool), is_solid)
    edges = np.flatnonzero(is_connected[start] & is_connected[end])
    entries = np.ones(len(edges)), (start[edges], end[edges])
    graph = coo_matrix(entries, shape=(len(is_connected),) * 2)
    count, component = connected_components(graph, directed=False)
    of_unknowns = np.append(component[:rows], component[rows:].repeat(3))
    # A component is a block if it has solid nodes, and is small enough for a dense matrix.
    has_solid_nodes = np.zeros(count, dtype=bool)
    has_solid_nodes[component[rows:][is_solid]] = True
    is_small = np.bincount(of_unknowns, minlength=count) <= MAX_DENSE_COORDINATES
    is_block = has_solid_nodes & is_small
    blocks = np.where(is_block, np.cumsum(is_block) - 1, -1)
    return blocks[of_unknowns]
