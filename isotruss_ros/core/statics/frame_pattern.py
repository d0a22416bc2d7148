# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which displacements of a frame are unknowns, and where entries go in the matrix of (4)."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Flags, Indices
import numpy as np


class LinearRows(NamedTuple):
    """
    Linear constraints on the displacements (ux0, uy0, theta0, ux1, ...): rows @ them = 0.

    :ivar count: number of rows.
    :ivar row: (e,) row of each entry.
    :ivar column: (e,) column of each entry.
    :ivar value: (e,) entries; those in one place add up.
    """

    count: int
    row: Indices
    column: Indices
    value: Array


NO_ROWS = LinearRows(0, np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp), np.zeros(0))


class Members(NamedTuple):
    """
    Straight members between nodes, arrays of one length k.

    :ivar start: (k,) node numbers.
    :ivar end: (k,) node numbers.
    :ivar axial: (k,) EA [N].
    :ivar flexural: (k,) EI [N m^2].
    :ivar shear: (k,) GA [N]; infinite for no shear deformation.
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
    What frames with the same connections and supports share: where entries of matrices go.

    :param members: what connects the nodes; their stiffness does not count.
    :param held: (n, 3) which of ux, uy, theta are held by supports.
    :param rows: linear constraints on the displacements, whose values do not count.
    :ivar places: (k, 6) numbers of the displacements of each member's ends.
    :ivar unknowns: (3 n,) number of each displacement among the unknowns, -1 if it is none.
    :ivar ends: (k, 6) numbers of the unknowns of each member's ends, -1 if it is none.
    :ivar solved: (f,) the displacements that are unknowns.
    :ivar entries: (e,) which of the entries of all members' stiffness matrices are in that of (4).
    :ivar weights: (w,) which of the entries of the constraints are.
    :ivar bound: (w,) the unknowns of these entries.
    :ivar multiplier: (w,) the multipliers of these entries, among all unknowns of (4).
    :ivar matrix_rows: (e + 2 w,) rows of all these in the matrix of (4).
    :ivar matrix_columns: (e + 2 w,).
    """

    def __init__(self, members: Members, held: Flags, rows: LinearRows) -> None:
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
        self.matrix_rows = np.concatenate([first, self.multiplier, self.bound])
        self.matrix_columns = np.concatenate([second, self.bound, self.multiplier])
