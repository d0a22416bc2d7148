# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Plane frames of beam-columns that are pinned or fixed to nodes, with constraints: (1) and (4).

`Frame.solve` is linear about the unloaded frame, as in the paper. `Frame.bend` finds the
equilibrium of the bent frame by Newton's method; its first step is `Frame.solve`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.factorization import factorize_with_condition
from isotruss_ros.core.numerics.tolerances import COINCIDENCE, MAX_CONDITION, MAX_NEWTON_ITERATIONS
from isotruss_ros.core.statics.beam_column import BeamColumns, chord_motions
from isotruss_ros.core.statics.frame_assembly import FrameAssembly
from isotruss_ros.core.statics.tangent import end_forces, FactoredFrame, Tangent, TUBE_CURVATURE
import numpy as np
from scipy.sparse import csc_matrix

#: Largest admissible ratio of the displacements to those of the linear prediction [-].
MAX_GROWTH = 1.5


@dataclass(frozen=True, eq=False)
class FrameState:
    """
    Displacements, reactions and member forces of a frame under loads.

    :ivar displacements: (n, 3) displacements ux, uy [m], theta [rad]; theta is zero at nodes at
        which all members are pinned.
    :ivar reactions: (n, 3) forces fx, fy [N] and moments m [N m] of the supports on the frame;
        zero at nodes without support.
    :ivar end_forces: (k, 6) forces of the nodes on the members; at the start and then at the end,
        the force along the chord and across it [N] and the moment [N m].
    :ivar multipliers: (c,) Lagrange multipliers of the constraints.
    :ivar bowing: (k,) axial forces that amplify moments inside members [N]; zero in the linear
        model.
    """

    displacements: Array
    reactions: Array
    end_forces: Array
    multipliers: Array
    bowing: Array


class Frame(FrameAssembly):
    """Frame of beam-columns, with the factorised matrix of its unloaded state."""

    @cached_property
    def _columns(self) -> BeamColumns:
        return BeamColumns(self.length, *self.members[2:])

    @property
    def straight(self) -> Tangent:
        """Return the frame linearised about its unloaded state, without factorisation."""
        return self.tangent(np.zeros((len(self.points), 3)), np.zeros(self.rows.count))

    @cached_property
    def rest(self) -> Tangent:
        """
        Return the frame linearised about its unloaded state, with its factorised matrix (4).

        :raises StructureError: the frame is a mechanism; the message names the nodes that move.
        """
        tangent = self.straight
        matrix, scale = tangent.system
        factor, condition = factorize_with_condition(matrix)
        if factor is None or not condition < MAX_CONDITION:
            moving = ', '.join(self._what_moves(matrix, scale))
            raise StructureError(
                f'the structure is a mechanism: {moving} can move without resistance; '
                'support it or connect it'
            )
        tangent.__dict__['factored'] = FactoredFrame(factor, scale, tangent.points)
        return tangent

    def tangent(
        self, displacements: Array, multipliers: Array, pull: Array | None = None
    ) -> Tangent:
        """
        Return the frame linearised about given displacements.

        :param displacements: (n, 3) displacements ux, uy [m], theta [rad].
        :param multipliers: (c,) Lagrange multipliers of the constraints.
        :param pull: (k,) axial forces [N], see `BeamColumns.evaluate`; None: they are computed.
        """
        ends = displacements.ravel()[self.places]
        apart = (ends[:, 3] - ends[:, 0] + 1j * (ends[:, 4] - ends[:, 1])) * self.axis.conj()
        span = self.length + apart
        length = np.abs(span)
        axis = self.axis * span / length
        # (l^2 - l0^2) / (l + l0), because l - l0 has large rounding errors.
        longer = (2.0 * self.length * apart.real + np.abs(apart) ** 2) / (length + self.length)
        start, end = 0.5 * ends[:, 2], 0.5 * ends[:, 5]
        stretched = longer, np.column_stack([start + end - np.angle(span), start - end])
        forces = self._columns.evaluate(*stretched, pull)
        return Tangent(
            displacements,
            multipliers,
            axis,
            length,
            chord_motions(axis, length),
            stretched,
            forces,
            self.rows.linearize(self.points, displacements),
            self,
        )

    def _what_moves(self, matrix: Array | csc_matrix, scale: Array) -> list[str]:
        """Return the names of the nodes that can move without force in a singular frame."""
        dense = matrix if isinstance(matrix, np.ndarray) else matrix.toarray()
        values, vectors = np.linalg.eigh(dense)
        loose = np.abs(values) < np.abs(values).max() / MAX_CONDITION**0.5
        loose[np.abs(values).argmin()] = True
        unknown = self.pattern.unknowns
        motion = np.abs(scale[:, None] * vectors[:, loose]).max(axis=1)
        by_node = np.where(unknown >= 0, motion[unknown], 0.0).reshape(-1, 3).max(axis=1)
        return [self.names[i] for i in np.flatnonzero(by_node > 1e-3 * by_node.max())]

    def solve(self, loads: Array) -> FrameState:
        """
        Return displacements, reactions and member forces under loads by the linear model (4).

        :param loads: (n, 3) loads fx, fy [N], m [N m] on the nodes.
        :raises StructureError: the frame is a mechanism (the message names the nodes that move),
            or the loads overflow.
        """
        rest, flat = self.rest, loads.ravel()
        moved, multipliers = (each[:, 0] for each in rest.respond(flat[:, None]))
        with np.errstate(over='ignore', invalid='ignore'):
            forces, _ = rest.force_changes(moved.reshape(-1, 3, 1))
            ends = end_forces(forces[..., 0], rest.length)
        if not np.isfinite(ends).all():
            raise StructureError(
                f'loads up to {np.abs(loads).max():.3g} N: the forces in the members overflow; '
                'loads must be smaller'
            )
        pushed = rest.nodal_forces(slice(None), forces)
        carried = np.bincount(self.places.ravel(), pushed.ravel(), minlength=len(flat))
        values, *_ = self.rows.linearize(self.points, np.zeros_like(loads))
        pushed = values * multipliers[self.rows.row]  # forces of the constraints
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
        """
        Return the bent frame in equilibrium under loads, found by Newton's method.

        :param loads: (n, 3) loads fx, fy [N], m [N m] on the nodes.
        :param start: frame linearised about the initial state; None: about the unloaded state.
        :param growth: largest admissible ratio of the displacements to those of the linear
            prediction [-].
        :return: the frame linearised about its equilibrium; None if no equilibrium is found near
            `start`.
        :raises StructureError: the frame is a mechanism.
        """
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
        """
        Return the members (c,) that contain points, and the points' distances from their starts.

        :param piece: (c,) index of the member at each point, of a `CutFrame` before it is cut.
        :param within: (c,) distances of the points from the starts of these members [m].
        """
        return piece, within

    def interpolate(self, displacements: Array, piece: Indices, within: Array) -> Array:
        """
        Return the displacements (c, 3) of points inside members, with cubic centre lines.

        :param displacements: (n, 3) displacements ux, uy [m], theta [rad] of the nodes.
        :param piece: (c,) index of the member at each point, of a `CutFrame` before it is cut.
        :param within: (c,) distances of the points from the starts of these members [m].
        """
        part, inside = self.locate(piece, within)
        start, end = displacements[self.members.start[part]], displacements[self.members.end[part]]
        axis, length = self.axis[part], self.length[part]
        first = (start[:, 0] + 1j * start[:, 1]) * axis.conj()
        apart = (end[:, 0] + 1j * end[:, 1]) * axis.conj() - first
        chord = length + apart
        turned, x = np.angle(chord), inside / length
        before, after = start[:, 2] - turned, end[:, 2] - turned
        own = self.members
        skew = 12.0 * own.flexural[part] / own.shear[part] / length**2
        follows = -(2.0 - skew) / (4.0 + skew)  # rotation of a pinned end / of the other end
        before = np.where(own.pinned_start[part], follows * after, before)
        after = np.where(own.pinned_end[part], follows * before, after)
        even, odd = before + after, before - after
        bow = 0.5 * x * (1.0 - x) * (odd + (1.0 - 2.0 * x) / (1.0 + skew) * even)
        slope = 0.5 * ((1.0 - 2.0 * x) * odd + (1.0 - 6.0 * x * (1.0 - x) / (1.0 + skew)) * even)
        moved = axis * (first + x * apart + 1j * bow * chord)
        return np.stack([moved.real, moved.imag, turned + slope], axis=1)

    def state(self, tangent: Tangent, loads: Array) -> FrameState:
        """
        Return displacements, reactions and member forces of the bent frame.

        :param tangent: frame linearised about its equilibrium.
        :param loads: (n, 3) loads fx, fy [N], m [N m] on the nodes.
        """
        return FrameState(
            tangent.displacements,
            self._reactions(tangent.carried - loads.ravel()),
            tangent.end_forces,
            tangent.multipliers,
            tangent.forces.values[:, 0],
        )

    def _reactions(self, missing: Array) -> Array:
        """Return the support reactions (n, 3) from the residual of the balance (3 n,)."""
        return np.where(self.held.ravel(), missing, 0.0).reshape(-1, 3)
