"""Plane frames by the direct stiffness method, with linear constraints: equations (1) and (4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from isotruss_ros.core.beam import directions, local_stiffness, with_pins
from isotruss_ros.core.constraints import DENSE_UP_TO
from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.linear import condition_number, Factor, factorize
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bmat, coo_matrix, csc_matrix, csr_matrix, diags

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]
Points = NDArray[np.complex128]

#: A frame that is worse conditioned than this, in its own units, is a mechanism.
MAX_CONDITION = 1e12


@dataclass(frozen=True, eq=False)
class Members:
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


@dataclass(frozen=True, eq=False)
class FrameState:
    """
    How a frame carries its loads.

    :ivar displacements: (n, 3) ux, uy [m], theta [rad]; zero rotation where nothing turns.
    :ivar reactions: (n, 3) fx, fy [N], m [N m] of the supports on the frame; zero elsewhere.
    :ivar end_forces: (k, 6) forces of the nodes on the members, along them, across them [N] and
        moments [N m], at start and end.
    """

    displacements: Array
    reactions: Array
    end_forces: Array


class Frame:
    """
    A linear frame; its matrix is factored once, with the first solve.

    :param points: (n,) nodes x + iy [m].
    :param members: what connects them.
    :param held: (n, 3) which of ux, uy, theta are held by supports.
    :param names: (n,) names of the nodes, for messages.
    :param rows: (c, 3 n) linear constraints rows @ (ux0, uy0, theta0, ux1, ...) = 0; none if None.
    """

    def __init__(
        self,
        points: Points,
        members: Members,
        held: Flags,
        names: Sequence[str],
        rows: csr_matrix | None = None,
    ) -> None:
        self.points = points
        self.members = members
        self._names = names
        self._held = held.ravel()
        self._rows = csr_matrix((0, 3 * len(points))) if rows is None else rows
        span = points[members.end] - points[members.start]
        length = np.abs(span)
        self._turn = directions(span / length)
        self._local = with_pins(
            local_stiffness(length, members.axial, members.flexural, members.shear),
            members.pinned_start,
            members.pinned_end,
        )
        ends = np.stack([members.start, members.end], axis=1)
        self._places = (3 * ends[:, :, None] + np.arange(3)).reshape(-1, 6)

    @cached_property
    def stiffness(self) -> csc_matrix:
        """Return S of (1), (3 n, 3 n), supports and constraints aside."""
        matrices = self._turn.transpose(0, 2, 1) @ self._local @ self._turn
        rows = np.broadcast_to(self._places[:, :, None], matrices.shape)
        columns = np.broadcast_to(self._places[:, None, :], matrices.shape)
        size = len(self._held)
        return coo_matrix(
            (matrices.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size)
        ).tocsc()

    @cached_property
    def _free(self) -> Indices:
        """Return the displacements to solve for: not held, and, if rotations, of something."""
        turning = np.zeros(len(self._held), dtype=bool)
        turning[3 * self.members.start[~self.members.pinned_start] + 2] = True
        turning[3 * self.members.end[~self.members.pinned_end] + 2] = True
        rotation = np.arange(len(self._held)) % 3 == 2
        return np.flatnonzero(~self._held & (turning | ~rotation))

    @cached_property
    def _system(self) -> tuple[Factor, Array]:
        """Return the factored matrix of (4), and the scaling of its unknowns."""
        free = self._free
        stiffness, rows = self.stiffness[free][:, free], self._rows[:, free]
        matrix = bmat([[stiffness, rows.T], [rows, None]], format='csc')
        # Displacements and rotations, soft tubes and hard modules: scaled, all have stiffness 1.
        diagonal = stiffness.diagonal()
        soft = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, diagonal.max()))
        norms = np.asarray(np.sqrt(rows.power(2) @ soft**2)).ravel()
        scale = np.concatenate([soft, 1.0 / norms])
        scaled = (diags(scale) @ matrix @ diags(scale)).tocsc()
        system = scaled.toarray() if scaled.shape[0] <= DENSE_UP_TO else scaled
        if not condition_number(system) < MAX_CONDITION:
            moving = ', '.join(self._what_moves(scaled, scale))
            raise StructureError(
                f'the structure is a mechanism: {moving} can move without resistance; '
                'support it or connect it'
            )
        return factorize(system), scale

    def _what_moves(self, scaled: csc_matrix, scale: Array) -> list[str]:
        """Return the nodes that take part in motions which nothing resists."""
        values, vectors = np.linalg.eigh(scaled.toarray())
        loose = np.abs(values) < np.abs(values).max() / MAX_CONDITION**0.5
        loose[np.abs(values).argmin()] = True
        motion = np.zeros(len(self._held))
        motion[self._free] = np.abs(scale[:, None] * vectors[:, loose]).max(axis=1)[
            : len(self._free)
        ]
        by_node = motion.reshape(-1, 3).max(axis=1)
        return [self._names[i] for i in np.flatnonzero(by_node > 1e-3 * by_node.max())]

    def turned(self, members: Indices) -> Array:
        """Return (k, 6, 6): displacements of the plane to those along the given members."""
        return self._turn[members]

    def compliance(self, members: Indices) -> Array:
        """
        Return how the ends of members give under unit loads on the ends of members.

        :param members: (k,) which of the members.
        :return: (6 k, 6 k), by ux, uy, theta at start and end of each; symmetric.
        :raises StructureError: see `solve`.
        """
        factor, scale = self._system
        number = np.full(len(self._held), -1)
        number[self._free] = np.arange(len(self._free))
        unknowns = number[self._places[members].ravel()]
        there = np.flatnonzero(unknowns >= 0)
        right = np.zeros((len(scale), len(unknowns)))
        right[unknowns[there], there] = scale[unknowns[there]]
        moved = scale[:, None] * factor.solve(right)
        return np.where((unknowns >= 0)[:, None], moved[unknowns], 0.0)

    def solve(self, loads: Array) -> FrameState:
        """
        Return displacements, reactions and member forces under loads.

        :param loads: (n, 3) fx, fy [N], m [N m] on the nodes.
        :raises StructureError: the frame is a mechanism; names the nodes that move.
        """
        factor, scale = self._system
        free = self._free
        right = np.zeros(len(scale))
        right[: len(free)] = loads.ravel()[free]
        solution = scale * factor.solve(scale * right)
        displacements = np.zeros(len(self._held))
        displacements[free] = solution[: len(free)]
        pull = self.stiffness @ displacements + self._rows.T @ solution[len(free) :]
        reactions = np.where(self._held, pull - loads.ravel(), 0.0)
        ends = np.einsum('kij,kj->ki', self._turn, displacements[self._places])
        return FrameState(
            displacements.reshape(-1, 3),
            reactions.reshape(-1, 3),
            np.einsum('kij,kj->ki', self._local, ends),
        )
