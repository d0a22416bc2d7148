# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbering of a frame's unknown displacements, and sparsity pattern of the matrix of (4)."""

from __future__ import annotations

import functools
import itertools
from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
import numpy as np


class TurnRows(NamedTuple):
    """
    Constraints on rotations of vectors: in each row the weighted sum of rotations is zero.

    A vector, called a span, is a linear combination of node positions. Its coefficients, called
    shares, sum to zero.

    :ivar count: number of rows.
    :ivar owner: (s,) row of each span.
    :ivar weight: (s,) weight of each span's rotation in its row.
    :ivar span: (e,) index of the span to which each share belongs, ascending.
    :ivar share: (e,) coefficient of a node's position in the span.
    :ivar node: (e,) index of the node of each share.
    :ivar row: (2 e,) row of each entry of the constraint matrix: first the derivatives by x of the
        nodes, then the derivatives by y.
    :ivar column: (2 e,) column of each entry, which is the index of a displacement.
    :ivar pairs: two arrays (4 h,) of displacements that the geometric stiffness couples: (x, x),
        (x, y), (y, x) and (y, y) of the two nodes of each pair of shares.
    :ivar paired: two arrays (h,): first and second share of each pair in `pairs`.
    """

    count: int  # type: ignore[assignment]
    owner: Indices
    weight: Array
    span: Indices
    share: Array
    node: Indices
    row: Indices
    column: Indices
    pairs: tuple[Indices, Indices]
    paired: tuple[Indices, Indices]

    @classmethod
    def of(
        cls, row: Indices, weight: Array, span: Indices, share: Array, node: Indices
    ) -> TurnRows:
        """
        Return the constraints on weighted rotations of spans, see `TurnRows`.

        :param row: (s,) row of each span.
        :param weight: (s,) weight of each span.
        :param span: (e,) index of the span to which each share belongs, ascending.
        :param share: (e,) coefficient of a node's position in the span.
        :param node: (e,) index of the node of each share.
        """
        one, other = np.nonzero(span[:, None] == span)
        x, count = 3 * node, int(row.max()) + 1
        first = np.concatenate([x[one], x[one], x[one] + 1, x[one] + 1])
        second = np.concatenate([x[other], x[other] + 1, x[other], x[other] + 1])
        rows, columns = np.tile(row[span], 2), np.concatenate([x, x + 1])
        return cls(
            count, row, weight, span, share, node, rows, columns, (first, second), (one, other)
        )

    def linearize(self, points: Points, displacements: Array) -> tuple[Array, Array, Points]:
        """
        Return the constraints on rotations, linearised about displacements of the nodes.

        :param points: (n,) nodes without loads, x + iy [m].
        :param displacements: (n, 3) displacements ux, uy [m], theta [rad] of the nodes.
        :return: entries of the constraint matrix (2 e,), violations (c,) [rad], and the spans (s,)
            of the displaced nodes [m].
        """
        moved = points + displacements @ (1.0, 1j, 0.0)
        before, spans = (self._spans(each) for each in (points, moved))
        gaps = np.bincount(self.owner, self.weight * np.angle(spans / before), self.count)
        slopes = (self.weight * 1j / spans.conj())[self.span] * self.share
        return np.concatenate([slopes.real, slopes.imag]), gaps, spans

    def curvature(self, spans: Points, multipliers: Array) -> Array:
        """
        Return the geometric stiffness (4 h,) of the constraints, in the order of `TurnRows.pairs`.

        :param spans: (s,) spans, see `TurnRows`, of the displaced nodes, x + iy [m].
        :param multipliers: (c,) multipliers of the constraints.
        """
        bent = -(self.weight * multipliers[self.owner] / spans**2)[self.span]
        one, other = self.paired
        curved = bent[one] * self.share[one] * self.share[other]
        return np.concatenate([curved.imag, curved.real, curved.real, -curved.imag])

    def _spans(self, points: Points) -> Points:
        """Return the spans (s,) from node positions (n,), x + iy [m]."""
        parts, count = self.share * points[self.node], len(self.weight)
        return np.bincount(self.span, parts.real, count) + 1j * np.bincount(
            self.span, parts.imag, count
        )


class Members(NamedTuple):
    """
    Straight members between nodes, as arrays with one entry for each of k members.

    :ivar start: (k,) indices of the start nodes.
    :ivar end: (k,) indices of the end nodes.
    :ivar axial: (k,) EA [N].
    :ivar flexural: (k,) EI [N m^2].
    :ivar shear: (k,) GA [N]; infinite for members without shear deformation.
    :ivar pinned_start: (k,) whether the start transmits no moment.
    :ivar pinned_end: (k,) whether the end transmits no moment.
    """

    start: Indices
    end: Indices
    axial: Array
    flexural: Array
    shear: Array
    pinned_start: Flags
    pinned_end: Flags


class FramePattern:
    """
    Sparsity pattern of all frames with equal connections and supports.

    :param members: members between the nodes; only their connections are used.
    :param held: (n, 3) mask of the displacements ux, uy, theta that supports fix.
    :param rows: constraints on rotations; only their connections are used.
    :ivar members: members between the nodes.
    :ivar held: (n, 3) mask of ux, uy, theta fixed by supports.
    :ivar count: number k of members.
    :ivar places: (k, 6) indices of the displacements of each member's ends.
    :ivar unknowns: (3 n,) index of each displacement among the unknowns, -1 if fixed.
    :ivar ends: (k, 6) indices of the unknowns of each member's ends, -1 if fixed.
    :ivar solved: (f,) indices of the unknown displacements.
    :ivar entries: (e,) indices of the members' stiffness entries that are in the matrix of (4).
    :ivar weights: (w,) indices of the constraints' entries that are in the matrix of (4).
    :ivar bound: (w,) index of the unknown displacement of each such constraint entry.
    :ivar multiplier: (w,) index among the unknowns of each such entry's multiplier.
    :ivar curved: (h,) indices of `TurnRows.pairs` with two unknown displacements.
    :ivar matrix_rows: (e + 2 w + h,) row of each of these entries in the matrix of (4).
    :ivar matrix_columns: (e + 2 w + h,) column of each of these entries.
    :ivar flat_places: (e + 2 w + h,) index of each of these entries in the flattened dense matrix.
    """

    def __init__(self, members: Members, held: Flags, rows: TurnRows) -> None:
        self._rows = rows
        self.count = len(members.start)
        ends = np.stack([members.start, members.end], axis=1)
        self.places = (3 * ends[:, :, None] + np.arange(3)).reshape(-1, 6)
        free = ~held.ravel()
        turning = np.zeros(len(held), dtype=bool)
        turning[members.start[~members.pinned_start]] = True
        turning[members.end[~members.pinned_end]] = True
        # A node at which all members are pinned has no rotation.
        free[2::3] &= turning
        self.solved = np.flatnonzero(free)
        self.unknowns = np.where(free, np.cumsum(free) - 1, -1)
        self.ends = by_member = self.unknowns[self.places]
        there = by_member >= 0
        self.entries = np.flatnonzero(there[:, :, None] & there[:, None, :])
        bound = self.unknowns[rows.column]
        self.weights = np.flatnonzero(bound >= 0)
        self.bound = bound[self.weights]
        self.multiplier = len(self.solved) + rows.row[self.weights]
        first = by_member.repeat(6)[self.entries]
        second = by_member.repeat(6, axis=0).reshape(-1)[self.entries]
        pairs = self.unknowns[np.stack(rows.pairs)]
        self.curved = np.flatnonzero((pairs >= 0).all(axis=0))
        one, other = pairs[:, self.curved]
        self.matrix_rows = np.concatenate([first, self.multiplier, self.bound, one])
        self.matrix_columns = np.concatenate([second, self.bound, self.multiplier, other])
        size = len(self.solved) + rows.count
        self.flat_places = self.matrix_rows * size + self.matrix_columns
        self.members, self.held = members, held


class Chains(NamedTuple):
    """
    Group of b members, each divided at p cuts into p + 1 parts; no two share an end node.

    :ivar parts: (b, p + 1) indices of the parts of each member, from start to end.
    :ivar inner: (b, 3 p) indices of the displacements at the cuts, in the order of the parts.
    :ivar ends: (b, 6) indices of the displacements of the members' end nodes.
    """

    parts: Indices
    inner: Indices
    ends: Indices


class CutPattern(NamedTuple):
    """
    Data common to all frames whose k members are divided at c cuts in the same order.

    The nodes at the cuts are the last nodes. The first part of a divided member has the member's
    index; the other parts have the last indices.

    :ivar whole: (k + c,) index of the uncut member to which each part belongs.
    :ivar members: the k + c parts, each with the section of its uncut member.
    :ivar held: (n + c, 3) mask of the displacements ux, uy, theta that supports fix.
    :ivar nodes: (c,) indices of the nodes at the cuts.
    :ivar before: (c,) indices of the parts that end at the cuts.
    :ivar behind: (c,) indices of the parts that begin at the cuts.
    :ivar chains: the members with cuts, in groups with equal numbers of cuts.
    :ivar places: (k + c, 6) indices of the displacements of the parts' ends.
    """

    whole: Indices
    members: Members
    held: Flags
    nodes: Indices
    before: Indices
    behind: Indices
    chains: tuple[Chains, ...]
    places: Indices

    @classmethod
    def of(cls, members: Members, held: Flags, piece: Indices, order: Indices) -> CutPattern:
        """
        Return the data common to all frames with given members and order of the cuts.

        :param members: members of the uncut frame.
        :param held: (n, 3) mask of the displacements ux, uy, theta of the uncut frame that
            supports fix.
        :param piece: (c,) index of the member that each cut divides.
        :param order: (c,) indices that sort the cuts by member and along each member.
        """
        parts, own = len(members.start), np.arange(len(piece))
        whole, nodes, behind = np.append(np.arange(parts), piece), len(held) + own, parts + own
        cut = Members(*(each[whole] for each in members))
        cut.pinned_start[parts:] = False
        before, found = np.empty_like(piece), []
        for member in np.unique(piece).tolist():
            points = order[piece[order] == member]
            chain = np.append(member, behind[points])
            before[points] = chain[:-1]
            cut.start[chain[1:]] = cut.end[chain[:-1]] = nodes[points]
            cut.end[chain[-1]], cut.pinned_end[chain[:-1]] = members.end[member], False
            inner = (3 * nodes[points, None] + np.arange(3)).ravel()
            both = np.array([members.start[member], members.end[member]])
            found.append((chain, inner, (3 * both[:, None] + np.arange(3)).ravel()))
        alike = itertools.groupby(
            sorted(found, key=lambda each: len(each[0])), lambda each: len(each[0])
        )
        chains = []
        for _, group in alike:
            several = Chains(*map(np.array, zip(*group, strict=True)))
            apart = len(np.unique(several.ends)) == several.ends.size
            single = (Chains(*(each[[i]] for each in several)) for i in range(len(several.ends)))
            chains += [several] if apart else list(single)
        ends = np.stack([cut.start, cut.end], axis=1)
        places = (3 * ends[:, :, None] + np.arange(3)).reshape(-1, 6)
        still = np.append(held, np.zeros((len(piece), 3), dtype=bool), axis=0)
        return cls(whole, cut, still, nodes, before, behind, tuple(chains), places)


@functools.lru_cache(maxsize=64)
def cut_pattern(pattern: FramePattern, piece: bytes, order: bytes) -> CutPattern:
    """
    Return the data common to all frames with given members and order of the cuts, cached.

    :param pattern: pattern of the uncut frame.
    :param piece: (c,) index of the member that each cut divides, as bytes.
    :param order: (c,) indices that sort the cuts by member and along each member, as bytes.
    """
    both = (np.frombuffer(each, dtype=np.intp) for each in (piece, order))
    return CutPattern.of(pattern.members, pattern.held, *both)
