# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A frame with nodes where loads act inside its members, and how that of a robot changes.

Its members are Timoshenko beams of the flexibility F(L, EA, EI, GA). With their end forces q and
deformations d, d = F q, so that q' = F^-1 (d' - F' q): derivatives need none of the stiffness.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.statics.frame import Frame, FrameState
from isotruss_ros.core.statics.frame_pattern import Members
from isotruss_ros.core.statics.structure import (
    frame_layout,
    Structure,
)
import numpy as np


class FrameRates(NamedTuple):
    """
    How a frame changes with p parameters.

    :ivar points: (n, p) of the nodes, x + iy [m].
    :ivar flexibility: (3, k, p) of 1 / EA, 1 / EI and 1 / GA of the members.
    :ivar rows: (e, p) of the entries of the constraints.
    """

    points: Points
    flexibility: Array
    rows: Array


class CutFrame(Frame):
    """
    A frame whose members are cut at some points, which become its last nodes.

    The members themselves become their first parts; the others are the last members.

    :ivar nodes: (c,) the nodes at the points.
    :ivar before: (c,) the parts that end at the points.
    :ivar behind: (c,) the parts that begin there.
    :param frame: to be cut.
    :param piece: (c,) numbers of the members with points inside.
    :param within: (c,) distances of these from the members' starts [m].
    """

    def __init__(self, frame: Frame, piece: Indices, within: Array) -> None:
        count, parts = len(piece), len(frame.members.start)
        whole = np.concatenate([np.arange(parts), piece])
        members = Members(*(each[whole] for each in frame.members))
        start, end, *_, pinned_start, pinned_end = members
        pinned_start[parts:] = pinned_end[parts:] = False
        self.nodes = len(frame.points) + np.arange(count)
        self.behind = parts + np.arange(count)
        self.before = self.behind.copy()
        # From the far ends of the members: what is left of each is its part from its start.
        for i in np.argsort(-within).tolist():
            cut, part = piece[i], self.behind[i]
            start[part], end[part], pinned_end[part] = self.nodes[i], end[cut], pinned_end[cut]
            end[cut], pinned_end[cut] = self.nodes[i], False
        for i, node in enumerate(self.nodes.tolist()):
            self.before[i] = np.flatnonzero(end == node)[0]
        points = frame.points[frame.members.start[piece]] + within * frame.axis[piece]
        held = np.append(frame._held.reshape(-1, 3), np.zeros((count, 3), dtype=bool), axis=0)
        super().__init__(
            np.append(frame.points, points),
            members,
            held,
            [*frame._names, *map(str, self.nodes)],
            frame.rows,
        )
        self.whole = whole

    def rates(
        self, state: FrameState, rates: FrameRates, loads: Array, still: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """
        Return how displacements (n, 3, p), end forces (k, 6, p) and multipliers (c, p) change.

        :param state: under the loads.
        :param rates: of the frame.
        :param loads: (n, 3, p) of the loads.
        :param still: (k, 6, p) of the end forces besides, as the nodes stay; see `mixed_rates`.
        """
        pattern, rows, count = self._pattern, self.rows, loads.shape[2]
        spin, changed = self._still_rates(state, rates)
        if still is not None:
            changed += still
        # On the members, in the plane: turned with them.
        forces = state.end_forces[:, :, None]
        turned = np.empty_like(changed)
        for at in (0, 3):
            turned[:, at] = changed[:, at] - spin * forces[:, at + 1]
            turned[:, at + 1] = changed[:, at + 1] + spin * forces[:, at]
            turned[:, at + 2] = changed[:, at + 2]
        left = loads.reshape(-1, count).copy()
        places = pattern.places.ravel()
        np.subtract.at(left, places, (self.turn.transpose(0, 2, 1) @ turned).reshape(-1, count))
        pushed = rates.rows * state.multipliers[rows.row][:, None]
        np.subtract.at(left, rows.column, pushed)
        moved = rates.rows * state.displacements.ravel()[rows.column][:, None]
        opened = np.zeros((rows.count, count))
        np.subtract.at(opened, rows.row, moved)
        displacements, multipliers = self.rest.respond(left, opened)
        changed += self._local @ (self.turn @ displacements[pattern.places])
        return displacements.reshape(-1, 3, count), changed, multipliers

    def mixed_rates(
        self, state: FrameState, changes: tuple[Array, Array], rates: FrameRates, cuts: Array
    ) -> Array:
        """
        Return by how much more end forces change while the nodes stay where cuts have moved.

        :param state: under the loads.
        :param changes: of displacements (n, 3, p) and end forces (k, 6, p), see `rates`.
        :param rates: of the frame.
        :param cuts: (k,) how much longer its parts get as the cuts move along the members [m].
        :return: (k, 6, p), mixed second derivatives, see `rates`.
        """
        own, length, share = self.members, self.length[:, None], (cuts / self.length)[:, None]
        span = (rates.points[own.end] - rates.points[own.start]) / self.axis[:, None]
        spin, longer = span.imag / length, 2.0 * span.real / length
        by_axial, by_bending, by_shear = rates.flexibility
        places = self._pattern.places
        stretch, sway = self._sways(state.displacements.reshape(-1, 1)[places])
        swayed = self._sways(changes[0].reshape(-1, changes[0].shape[2])[places])[1]
        moments, moments_rate = state.end_forces[:, [2, 5], None], changes[1][:, [2, 5]]
        both, both_rate = moments.sum(axis=1), moments_rate.sum(axis=1)
        pulled = -share * (
            changes[1][:, 3] + own.axial[:, None] * by_axial * state.end_forces[:, 3, None]
        )
        sheared = (both_rate - longer * both) / own.shear[:, None] + by_shear * both
        turned = (share / length * (swayed - spin * stretch - longer * sway + sheared))[:, None]
        bending = moments_rate / own.flexural[:, None, None] + by_bending[:, None] * moments
        turned = turned - (share * length)[:, None] / 6.0 * (
            3.0 * bending - bending.sum(axis=1)[:, None]
        )
        bent = self._local[:, [2, 5]][:, :, [2, 5]] @ turned
        across = (bent.sum(axis=1) - share * (both_rate - 0.5 * longer * both)) / length
        return np.stack([-pulled, across, bent[:, 0], pulled, -across, bent[:, 1]], axis=1)

    def _sways(self, ends: Array) -> tuple[Array, Array]:
        """Return how far ends (k, 6, p) move apart, along members and across them, (k, p)."""
        ends = self.turn @ ends
        return ends[:, 3] - ends[:, 0], ends[:, 4] - ends[:, 1]

    def _still_rates(self, state: FrameState, rates: FrameRates) -> tuple[Array, Array]:
        """Return spins (k, p), and rates (k, 6, p) of end forces while the nodes stay."""
        own, length = self.members, self.length[:, None]
        span = (rates.points[own.end] - rates.points[own.start]) / self.axis[:, None]
        spin, longer = span.imag / length, span.real
        by_axial, by_bending, by_shear = rates.flexibility
        stretch, sway = self._sways(state.displacements.reshape(-1, 1)[self._pattern.places])
        moments, pull = state.end_forces[:, [2, 5]][:, :, None], state.end_forces[:, 3, None]
        # Deformations as the nodes stay: stretch, and rotation of both ends against the chord.
        pulled = spin * sway - pull * (longer / own.axial[:, None] + length * by_axial)
        pulled *= self._local[:, 0, 0, None]
        chord = (-spin * stretch - sway / length * longer) / length
        # F = L / (6 EI) [2, -1; -1, 2] + 1 / (GA L) [1, 1; 1, 1].
        bending = (longer / own.flexural[:, None] + length * by_bending) / 6.0
        shear = (by_shear - longer / (own.shear[:, None] * length)) / length
        both = moments.sum(axis=1)
        turned = -(chord + shear * both)[:, None] - bending[:, None] * (
            3.0 * moments - both[:, None]
        )
        stiffness = self._local[:, [2, 5]][:, :, [2, 5]]
        bent = stiffness @ turned
        across = bent.sum(axis=1) / length - state.end_forces[:, 1, None] * longer / length
        return spin, np.stack([-pulled, across, bent[:, 0], pulled, -across, bent[:, 1]], axis=1)


def structure_rates(structure: Structure, moved: Points, inflated: Array) -> FrameRates:
    """
    Return how a frame changes with p parameters.

    :param structure: the robot's frame.
    :param moved: (N, p) of the nodes of its configuration, x + iy [m].
    :param inflated: (t, p) of the gauge pressures of the tubes [Pa].
    """
    config, frame, robot = structure.config, structure.frame, structure.config.robot
    topology, b = robot.topology, frame_layout(robot).b
    start, end = topology.b, topology.end
    side, change = config.points[end] - config.points[start], moved[end] - moved[start]
    turned = change / side[:, None]
    points = np.empty((len(frame.points), moved.shape[1]), dtype=np.complex128)
    joints = len(topology.joint_names)
    points[:joints] = moved[:joints]
    points[b], points[b + 1] = moved[topology.b], moved[topology.c]
    # Guide rings stay at their distance from the pinch points; they turn with the side.
    ahead = 1j * turned.imag * (frame.points[b + 2] - frame.points[b])[:, None]
    points[b + 2] = points[b] + ahead
    points[b + 3] = points[b + 1] - ahead[topology.previous]
    pressures = np.array(structure.pressures)[topology.tube]
    by_length, by_pressure = structure.tube.flexibility_rates(config.member_lengths, pressures)
    longer = turned.real * np.abs(side)[:, None]
    of_tubes = by_length[:, :, None] * longer + by_pressure[:, :, None] * inflated[topology.tube]
    softer = np.zeros((3, 6, *longer.shape))
    softer[:, 3] = softer[:, 5] = of_tubes
    softer[:, 4] = of_tubes[:, topology.previous]
    rows: Any = frame.rows
    parts = rows.share[:, None] * points[rows.node]
    turning = np.zeros((len(rows.weight), parts.shape[1]), dtype=np.complex128)
    np.add.at(turning, rows.span, parts)
    spans = rows._spans(frame.points)[:, None].conj()
    turning = -1j * turning.conj() / spans**2 * rows.weight[:, None]
    entries = turning[rows.span] * rows.share[:, None]
    entries = np.concatenate([entries.real, entries.imag])
    return FrameRates(points, softer.reshape(3, -1, moved.shape[1]), entries)
