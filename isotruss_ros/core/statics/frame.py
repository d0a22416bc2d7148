# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Plane frames of beam-columns that are pinned or fixed to nodes, with constraints: (1) and (4).

`Frame.solve` is linear about the unloaded frame, as in the paper. `Frame.bend` finds the
equilibrium of the bent frame by Newton's method; its first step is `Frame.solve`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.numerics.tolerances import COINCIDENCE, MAX_CONDITION, MAX_NEWTON_ITERATIONS
from isotruss_ros.core.statics.beam_column import BeamColumns, end_forces
from isotruss_ros.core.statics.cut_layout import FrameArrays
from isotruss_ros.core.statics.elimination import Elimination, Scaling
from isotruss_ros.core.statics.frame_pattern import FramePattern, Members, TurnRows
from isotruss_ros.core.statics.tangent import Tangent, TUBE_CURVATURE
import numpy as np
from scipy.sparse import coo_matrix

#: Largest admissible ratio of the displacements to those of the linear prediction [-].
MAX_GROWTH = 1.5


@dataclass(frozen=True, eq=False)
class FrameState:
    """Displacements, reactions and member forces of a frame under loads."""

    #: (n, 3) displacements ux, uy [m], theta [rad]; theta is zero at nodes at which all members
    #: are pinned
    displacements: Array
    #: (n, 3) forces fx, fy [N] and moments m [N m] of the supports on the frame; zero at nodes
    #: without support
    reactions: Array
    #: (k, 6) forces of the nodes on the members; at the start and then at the end, the force along
    #: the chord and across it [N] and the moment [N m]
    end_forces: Array
    multipliers: Array  #: (c,) Lagrange multipliers of the constraints
    #: (k,) axial forces that amplify moments inside members [N]; zero in the linear model
    bowing: Array


class Frame(FrameArrays):
    """
    Plane frame of beam-columns.

    :param pattern: pattern of a frame with the same connections and supports; None: it is
        computed.
    """

    uncut: Frame  #: frame without cuts

    def __init__(
        self,
        points: Points,
        members: Members,
        held: Flags,
        names: Sequence[str],
        rows: TurnRows,
        pattern: FramePattern | None = None,
    ) -> None:
        self.points, self.held, self.names, self.rows = points, held, names, rows
        self.start, self.end, *section, first, last = members
        self.section, self.pins = np.array(section), (first, last)
        span = points[self.end] - points[self.start]
        self.length = np.abs(span)
        self.axis, self.spans = span / self.length, rows.spans(points)
        self._pattern = pattern or FramePattern(members, held, rows)
        self.places = self._pattern.places
        self.whole, self.begins = np.arange(len(span)), np.zeros(len(span))
        self.nodes = self.before = self.behind = np.zeros(0, dtype=np.intp)
        self.layout, self.uncut = None, self
        self.columns = BeamColumns.of(self.length, self.section, self.pins)

    @property
    def members(self) -> Members:
        """Return the members between the nodes."""
        axial, flexural, shear = self.section
        return Members(self.start, self.end, axial, flexural, shear, *self.pins)

    @property
    def no_loads(self) -> tuple[Array, Array]:
        """Return displacements (n, 3) and multipliers (c,) of the unloaded frame."""
        return np.zeros((len(self.points), 3)), np.zeros(self.rows.count)

    @property
    def scaling(self) -> Scaling:
        """Return the numbering and scaling of the matrix of (4)."""
        return self.rest.factored.scaling

    @cached_property
    def rest(self) -> Tangent:
        """Return the frame linearised about its unloaded state, with its factorised matrix (4)."""
        straight = self.tangent(*self.no_loads)
        entries = straight.entries
        factor = _factorize(self._pattern, entries)
        if factor is None and self._pattern.condensed:
            whole = FramePattern(self.members, self.held, self.rows, condensed=False)
            factor = _factorize(whole, entries)
        if factor is None:
            raise StructureError(
                f'the structure is a mechanism: {", ".join(self._what_moves(entries))} can move '
                'without resistance; support it or connect it'
            )
        return replace(straight, given=factor)

    def tangent(
        self,
        displacements: Array,
        multipliers: Array,
        pull: Array | None = None,
        given: Elimination | None = None,
    ) -> Tangent:
        """Return the frame linearised about given displacements, see `Tangent.of`."""
        return Tangent.of(self, displacements, multipliers, pull, given)

    def _what_moves(self, entries: Array) -> list[str]:
        """Return the names of the nodes that can move without force in a singular frame."""
        scaling = Scaling.of(self._pattern, entries)
        count, free = len(scaling.scale), self._pattern.unknowns.free
        places = self._pattern.entries
        matrix = coo_matrix((entries * scaling.weight, places), shape=(count, count)).toarray()
        values, vectors = np.linalg.eigh(matrix[np.ix_(free, free)])
        loose = np.abs(values) < np.abs(values).max() / MAX_CONDITION**0.5
        loose[np.abs(values).argmin()] = True
        motion = np.zeros(count)
        motion[free] = np.abs(scaling.scale[free, None] * vectors[:, loose]).max(axis=1)
        by_node = motion[: self.held.size].reshape(-1, 3).max(axis=1)
        return [self.names[i] for i in np.flatnonzero(by_node > 1e-3 * by_node.max())]

    def solve(self, loads: Array) -> FrameState:
        """Return displacements, reactions and member forces under loads by linear (4)."""
        rest, flat = self.rest, loads.ravel()
        moved, multipliers = (each[:, 0] for each in rest.respond(flat[:, None]))
        forces, _ = rest.force_changes(moved.reshape(-1, 3, 1))
        ends = end_forces(forces[..., 0], rest.length)
        pushed = rest.nodal_forces(slice(None), forces)
        carried = np.bincount(self.places.ravel(), pushed.ravel(), minlength=len(flat))
        pushed = rest.constraints[0] * multipliers[self.rows.row]  # forces of the constraints
        carried += np.bincount(self.rows.column, pushed, minlength=len(flat))
        return FrameState(
            moved.reshape(-1, 3),
            self._reactions(carried - flat),
            ends,
            multipliers,
            np.zeros(len(self.length)),
        )

    def bend(
        self, loads: Array, start: Tangent | None = None, growth: float = MAX_GROWTH
    ) -> Tangent | None:
        """Return the bent frame in equilibrium under loads, found by Newton's method."""
        tangent = self.rest if start is None else start
        origin, reach = tangent.displacements, np.inf
        for count in range(MAX_NEWTON_ITERATIONS):
            step, multipliers = tangent.balance(loads.ravel())
            displacements = tangent.displacements + step[..., 0]
            size = float(np.abs(step[:, :2]).max())
            if count == 0:
                reach = size
            # An equilibrium far beyond the linear prediction is on another branch.
            elif not np.abs(displacements - origin)[:, :2].max() <= growth * reach:
                return None
            changes, _ = tangent.force_changes(step)
            pull = tangent.forces.values[:, 0] + changes[:, 0, 0]
            with np.errstate(over='ignore', invalid='ignore', divide='ignore'):
                tangent = self.tangent(
                    displacements, tangent.multipliers + multipliers[:, 0], pull
                )
            if TUBE_CURVATURE * size**2 <= COINCIDENCE:
                return tangent
        return None

    def locate(self, piece: Indices, within: Array) -> tuple[Indices, Array]:
        """Return the members (c,) that contain points, and the distances from their starts."""
        return piece, within

    def interpolate(self, displacements: Array, piece: Indices, within: Array) -> Array:
        """Return the displacements (c, 3) of points inside members, with cubic centre lines."""
        part, inside = self.locate(piece, within)
        start, end = displacements[self.start[part]], displacements[self.end[part]]
        axis, length = self.axis[part], self.length[part]
        first = (start[:, 0] + 1j * start[:, 1]) * axis.conj()
        apart = (end[:, 0] + 1j * end[:, 1]) * axis.conj() - first
        chord = length + apart
        turned, x = np.angle(chord), inside / length
        before, after = start[:, 2] - turned, end[:, 2] - turned
        skew = 12.0 * self.section[1, part] / self.section[2, part] / length**2
        follows = -(2.0 - skew) / (4.0 + skew)  # rotation of a pinned end / of the other end
        before = np.where(self.pins[0][part], follows * after, before)
        after = np.where(self.pins[1][part], follows * before, after)
        even, odd = before + after, before - after
        bow = 0.5 * x * (1.0 - x) * (odd + (1.0 - 2.0 * x) / (1.0 + skew) * even)
        slope = 0.5 * ((1.0 - 2.0 * x) * odd + (1.0 - 6.0 * x * (1.0 - x) / (1.0 + skew)) * even)
        moved = axis * (first + x * apart + 1j * bow * chord)
        return np.stack([moved.real, moved.imag, turned + slope], axis=1)

    def state(self, tangent: Tangent, loads: Array) -> FrameState:
        """Return displacements, reactions and member forces of the bent frame."""
        return FrameState(
            tangent.displacements,
            self._reactions(tangent.carried - loads.ravel()),
            tangent.end_forces,
            tangent.multipliers,
            tangent.forces.values[:, 0],
        )

    def _reactions(self, missing: Array) -> Array:
        """Return the support reactions (n, 3) from the residual of the balance (3 n,)."""
        found = np.zeros((len(self.points), 3))
        found[: len(self.held)] = missing.reshape(-1, 3)[: len(self.held)] * self.held
        return found


def _factorize(pattern: FramePattern, entries: Array) -> Elimination | None:
    """Return the factorised matrix of (4); None for a mechanism in double precision."""
    try:
        none = np.zeros((len(pattern.unknowns.free), 1))
        found, _ = Scaling.of(pattern, entries).eliminate(entries, none)
    except np.linalg.LinAlgError:
        return None
    return found if found.factored.condition < MAX_CONDITION else None
