# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Contact points of round tubes in many grasps, one after the other, and how they give."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from isotruss_ros.core.grasping.contact_points import SAME
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.statics.frame_stack import FrameStack, LoadedStack
from isotruss_ros.core.statics.interior import InteriorPoints
from isotruss_ros.core.statics.structure import frame_layout, tube_pieces
import numpy as np


@dataclass(frozen=True, eq=False)
class PointStack:
    """
    The contact points of n grasps, c in all, on q pieces of tube in all; see `ContactPoints`.

    :ivar counts: (n,) points of each grasp.
    :ivar grasp: (c,) the grasp that each point belongs to, in order.
    :ivar points: (c,) on the centre lines, x + iy from the object's centre [m].
    :ivar axis: (c,) direction of the tube.
    :ivar member: (c,) the member that each is on.
    :ivar place: (c,) distance from the member's start [m].
    :ivar piece: (c,) which of the q pieces each is on.
    :ivar pieces: (q,) their numbers among the members of the frame.
    :ivar owner: (q,) the grasps that they belong to.
    :ivar slot: (q,) their numbers among the pieces of their grasp.
    :ivar interior: the points as ones inside these pieces.
    """

    counts: Indices
    grasp: Indices
    points: Points
    axis: Points
    member: Indices
    place: Array
    piece: Indices
    pieces: Indices
    owner: Indices
    slot: Indices
    interior: InteriorPoints

    @cached_property
    def first(self) -> Indices:
        """Return the number of the first point of each grasp, (n,)."""
        return np.cumsum(self.counts) - self.counts

    @cached_property
    def shapes(self) -> Array:
        """Return displacements (c, 2, 6) along and across by those of the pieces' ends."""
        return self.interior.shapes()

    def take(self, grasps: Indices) -> PointStack:
        """
        Return the points of some of the grasps, whose pieces keep their numbers.

        :param grasps: (g,) which, in order.
        """
        number = np.full(len(self.counts), -1)
        number[grasps] = np.arange(len(grasps))
        kept = np.flatnonzero(number[self.grasp] >= 0)
        inside = self.interior
        part = PointStack(
            self.counts[grasps],
            number[self.grasp[kept]],
            self.points[kept],
            self.axis[kept],
            self.member[kept],
            self.place[kept],
            self.piece[kept],
            self.pieces,
            number[self.owner],
            self.slot,
            InteriorPoints(
                inside.member[kept],
                inside.place[kept],
                inside.length,
                inside.axial,
                inside.flexural,
                inside.shear,
                inside.pinned,
            ),
        )
        part.__dict__['shapes'] = self.shapes[kept]
        return part


def stack_points(stack: FrameStack, centers: Points, radius: Array, spacing: float) -> PointStack:
    """
    Place contact points on the tubes of many grasps, as `find_contact_points` does on one.

    :param stack: the frames.
    :param centers: (n,) of the objects, x + iy [m].
    :param radius: (n,) of the discs that centre lines meet [m].
    :param spacing: distance of the points along the tube [m].
    """
    topology, layout = stack.robot.topology, frame_layout(stack.robot)
    m, points = topology.n_modules, stack.points
    pieces = tube_pieces(m).ravel()
    member = np.concatenate([np.arange(m), topology.previous, np.arange(m)])
    start = points[layout.start[pieces]]
    length, axis = stack.beams.length[pieces], stack.beams.direction[pieces]
    away = (centers - start) * axis.conj()
    foot, off = away.real, np.abs(away.imag)
    reach = radius + 2.0 * spacing
    chord = np.sqrt(np.maximum(0.0, reach**2 - off**2))
    low, high = np.maximum(0.0, foot - chord), np.minimum(length, foot + chord)
    owner, which = np.nonzero(((high > low) & (off < reach)).T)
    foot, low, high, long = (
        foot[which, owner],
        low[which, owner],
        high[which, owner],
        which >= 2 * m,
    )
    first = np.ceil((low - foot) / spacing - SAME * long).astype(int)
    last = np.floor((high - foot) / spacing + np.where(long, SAME, -SAME)).astype(int)
    counts = last - first + 1
    piece = np.repeat(np.arange(len(which)), counts)
    number = np.arange(len(piece)) - np.repeat(np.cumsum(counts) - counts - first, counts)
    used = pieces[which]
    inside = InteriorPoints(
        piece,
        np.clip(foot[piece] + spacing * number, 0.0, length[which, owner][piece]),
        length[which, owner],
        *stack.sections[:, used, owner],
        np.stack([layout.pinned_start[used], layout.pinned_end[used]], axis=1),
    )
    grasp, along = owner[piece], axis[which, owner][piece]
    at = (start - centers)[which, owner][piece] + inside.place * along
    on = member[which][piece]
    line, origin = axis[2 * m + on, grasp], (start - centers)[2 * m + on, grasp]
    amount = np.bincount(owner, minlength=len(centers))
    return PointStack(
        np.bincount(grasp, minlength=len(centers)),
        grasp,
        at,
        along,
        on,
        length[on, grasp] + ((at - origin) * line.conj()).real,
        piece,
        used,
        owner,
        np.arange(len(owner)) - np.repeat(np.cumsum(amount) - amount, amount),
        inside,
    )


class Touches:
    """
    Some of the points of each grasp, up to a of them, and how all give under forces there.

    :ivar place: (n, a) numbers of the points; 0 where a grasp has fewer.
    :ivar used: (n, a) whether there is a point.
    :ivar axis: (n, a) direction of the tube.
    :ivar compliance: (n, 2, a, 2, a) of these points, along and across the tube [m/N].
    :param points: of all grasps.
    :param loaded: how the frames give.
    :param grasps: (n,) the numbers of the grasps among the frames.
    :param active: (c,) which points.
    """

    def __init__(
        self, points: PointStack, loaded: LoadedStack, grasps: Indices, active: Array
    ) -> None:
        self._points = points
        chosen = np.flatnonzero(active)
        grasp = points.grasp[chosen]
        counts = np.bincount(grasp, minlength=len(points.counts))
        most = max(1, int(counts.max(initial=0)))
        column = np.arange(len(chosen)) - np.repeat(np.cumsum(counts) - counts, counts)
        self.place = np.zeros((len(counts), most), dtype=np.intp)
        self.place[grasp, column] = chosen
        self.used = np.arange(most) < counts[:, None]
        self.axis = points.axis[self.place]
        slots = loaded.ends.shape[1] // 6
        levers = np.zeros((len(counts), 2, most, slots, 6))
        turned = _to_plane(points.shapes[chosen], points.axis[chosen][:, None])
        levers[grasp, :, column, points.slot[points.piece[chosen]]] = turned
        levers = levers.reshape(len(counts), 2 * most, 6 * slots)
        self.levers = levers
        #: (n, 6 s, 2 a) how the ends of pieces move under unit forces at the points.
        self._ends = loaded.ends[grasps] @ levers.transpose(0, 2, 1)
        matrix = (levers @ self._ends).reshape(len(counts), 2, most, 2, most)
        inside = _inside(points, self.place[:, :, None], self.place[:, None, :])
        inside *= self.used[:, :, None] & self.used[:, None, :]
        matrix[:, 0, :, 0] += inside[0]
        matrix[:, 1, :, 1] += inside[1]
        self.compliance = matrix

    @cached_property
    def _inside_all(self) -> Array:
        """Return how all points give within their pieces, (2, c, a)."""
        points = self._points
        places = self.place[points.grasp]
        inside = _inside(points, np.arange(len(points.grasp))[:, None], places)
        return inside * self.used[points.grasp]

    def displace(self, forces: Points) -> Points:
        """
        Return how all points move, (c,) x + iy [m].

        :param forces: (n, a) x + iy [N]; zero where there is no point.
        """
        points = self._points
        local = self.axis.conj() * forces
        push = np.concatenate([local.real, local.imag], axis=1)
        ends = (self._ends @ push[:, :, None]).reshape(len(push), -1, 6)
        own = ends[points.grasp, points.slot[points.piece]]
        start, end = own[:, 0] + 1j * own[:, 1], own[:, 3] + 1j * own[:, 4]
        turn, shapes = points.axis.conj(), points.shapes
        start, end = start * turn, end * turn
        by_point = local[points.grasp]
        along = shapes[:, 0, 0] * start.real + shapes[:, 0, 3] * end.real
        across = shapes[:, 1, 1] * start.imag + shapes[:, 1, 4] * end.imag
        across += shapes[:, 1, 2] * own[:, 2] + shapes[:, 1, 5] * own[:, 5]
        inside = self._inside_all
        along += (inside[0] * by_point.real).sum(axis=1)
        across += (inside[1] * by_point.imag).sum(axis=1)
        return points.axis * (along + 1j * across)


def _to_plane(rows: Array, axis: Points) -> Array:
    """Turn rows (c, 2, 6) on displacements along and across pieces into rows in the plane."""
    turned = rows.copy()
    for at in (0, 3):
        moved = (rows[..., at] + 1j * rows[..., at + 1]) * axis
        turned[..., at], turned[..., at + 1] = moved.real, moved.imag
    return turned


def _inside(points: PointStack, at: Indices, by: Indices) -> Array:
    """Return how points give, along and across, under forces at others while ends are held."""
    inside = points.interior
    piece = points.piece[at]
    place, other = inside.place[at], inside.place[by]
    near, far = np.minimum(place, other), np.maximum(place, other)
    length = inside.length[piece]
    left, right = inside.held_back
    stretch = near * (length - far) / (inside.axial[piece] * length)
    bend = near**2 * (3.0 * far - near) / (6.0 * inside.flexural[piece])
    bend += near / inside.shear[piece]
    for one, another in zip(left, right, strict=True):
        bend -= one[at] * another[by]
    return np.stack([stretch, bend]) * (piece == points.piece[by])
