# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Points inside members: how they move with the ends and under loads, without more nodes.

A Timoshenko beam between its ends deforms as a cantilever from the start whose far end is brought
to where it is held; what a load does to the tip of the cantilever follows by reciprocity, and a
start that turns freely does so without moment. All is exact (Przemieniecki, Theory of Matrix
Structural Analysis, section 5.6), so that a frame with loaded points anywhere needs no finer mesh.

The formulas hold for numbers of Python and for arrays alike: the former are several times quicker
for the few places at which an object is held, the latter for the many that it could touch.
"""

from __future__ import annotations

from typing import Any

from isotruss_ros.core.numerics.arrays import Array, Flags, Indices
from isotruss_ros.core.statics.frame import Frame
import numpy as np

#: A number of Python, or an array over beams or places.
Number = Any
#: Rows of what a place does across the beam: deflection, slope of the line, rotation of the
#: section, and the change of both angles along the beam.
DEFLECTION, SLOPE, ROTATION, BEND = range(4)
#: Rows of responses and of what loads work on: of deflection and slope by force and moment, and of
#: their derivatives by the place of the response and by that of the load.
INFLUENCES = tuple(
    (row, column)
    for rows, columns in (
        ((DEFLECTION, SLOPE), (DEFLECTION, ROTATION)),
        ((SLOPE, BEND), (DEFLECTION, ROTATION)),
        ((DEFLECTION, SLOPE), (SLOPE, BEND)),
    )
    for row in rows
    for column in columns
)


class ClampedBeam:
    """
    A straight beam between its ends, or many of them.

    :param length: [m].
    :param axial: EA [N].
    :param flexural: EI [N m^2].
    :param shear: GA [N], infinite for no shear deformation.
    :param pinned: whether the start transmits no moment.
    """

    def __init__(
        self, length: Number, axial: Number, flexural: Number, shear: Number, pinned: Number
    ) -> None:
        ei, ga = 1.0 / flexural, 1.0 / shear
        # Deflection and rotation of the tip by force and moment there, and the inverse of that.
        sink, cross, turn = length**3 * ei / 3.0 + length * ga, 0.5 * length**2 * ei, length * ei
        scale = 1.0 / (sink * turn - cross * cross)
        p, q, r = scale * turn, -scale * cross, scale * sink
        # Force and moment at the tip by deflection and rotation of the start, then of the end.
        force, moment = [-p, -length * p - q, p, q], [-q, -length * q - r, q, r]
        by_turn = force[1], moment[1]
        # The moment at the start by these four: a pinned one turns until there is none.
        pin = [-length * f - m for f, m in zip(force, moment, strict=True)]
        free = [pinned * value / pin[1] for value in pin]
        turns = [-free[0], 1.0 - free[1], -free[2], -free[3]]
        # Force and moment at the tip, and turn of the start, by what both ends do.
        self._by_ends = [
            (f - by_turn[0] * z, m - by_turn[1] * z, t)
            for f, m, z, t in zip(force, moment, free, turns, strict=True)
        ]
        self._tip, self._by_turn, self._pin = (p, q, r), by_turn, pinned / pin[1]
        self._length, self._ei, self._ga = length, ei, ga
        self._stretch = 1.0 / (axial * length)

    def _by_tip(self, x: Number) -> tuple[tuple[Number, Number, Number], ...]:
        """Return the rows at a place by force and moment at the tip, and by a turn of it all."""
        ei, length = self._ei, self._length
        bow = x * ei
        turn = bow * (length - 0.5 * x)
        sink = x * (bow * (3.0 * length - x) / 6.0 + self._ga)
        deflection, slope = (sink, 0.5 * x * bow, x), (turn + self._ga, bow, 1.0)
        return deflection, slope, (turn, bow, 1.0), ((length - x) * ei, ei, 0.0)

    def shapes(self, x: Number, rows: int = 4) -> list[list[Number]]:
        """
        Return what a place does across the beam, by what the ends do across it.

        :param x: from the start [m].
        :param rows: how many of the rows from `DEFLECTION` to `BEND` are returned.
        :return: rows by deflection and rotation of the start and of the end.
        """
        found = [
            [a * f + b * m + c * t for f, m, t in self._by_ends]
            for a, b, c in self._by_tip(x)[:rows]
        ]
        found[DEFLECTION][0] += 1.0
        return found

    def at(self, x: float) -> tuple[list[list[float]], list[float]]:
        """
        Return how a place moves with the ends, and by loads at the place itself.

        :param x: from the start [m].
        :return: see `shapes` and `influence`.
        """
        return self.shapes(x), self.influence(x, x)

    def _held_back(
        self, x: Number, rows: int = 4
    ) -> tuple[list[tuple[Number, ...]], list[tuple[Number, ...]]]:
        """
        Return what the held end takes off a cantilever from the start, and a pin adds.

        For each row two factors of three numbers: what one row does at x by loads that work on
        another one at y is less by the scalar product of the former's first factor with the
        latter's second one.
        """
        (p, q, r), (force, moment), pin = self._tip, self._by_turn, self._pin
        first, second = [], []
        for a, b, lever in self._by_tip(x)[:rows]:
            turned = a * force + b * moment + lever
            first.append((a * p + b * q, a * q + b * r, -pin * turned))
            second.append((a, b, turned))
        return first, second

    def _cantilever(self, near: Number, far: Number) -> Number:
        """Return the deflection of the cantilever at one place by a force at another one [m/N]."""
        return near * (near * (3.0 * far - near) * (self._ei / 6.0) + self._ga)

    def give(self, place: Array) -> Array:
        """
        Return what unit forces do along and across the beams, ends held, (2, c, c) [m/N].

        :param place: (c,) of points on c beams, from their starts [m].
        """
        near, far = np.minimum(place[:, None], place), np.maximum(place[:, None], place)
        (left,), (right,) = self._held_back(place, 1)
        along = near * (self._length - far) * self._stretch
        across = self._cantilever(near, far) - np.transpose(left) @ np.array(right)
        return np.stack([along, across])

    def influence(self, x: float, y: float) -> list[float]:
        """
        Return what loads at a place do at another one, or at the same.

        A force puts a kink into the line where it acts: there the slope is the mean of both sides.

        :param x: place of the responses, from the start [m].
        :param y: place of the loads [m].
        :return: displacement along by the force along; deflection by force across and moment;
            slope by these two; then the derivatives of these five by x, and by y.
        """
        near, far, before = min(x, y), max(x, y), 0.5 * (1 + (x < y) - (x > y))
        behind, rest = 1.0 - before, self._length - far
        ei, ga, stretch = self._ei, self._ga, self._stretch
        slope, sag = near * (y - 0.5 * near) * ei + before * ga, near * (x - 0.5 * near) * ei
        bow = near * ei
        cantilever = (
            *(self._cantilever(near, far), sag, slope, bow),
            *(slope, bow, (y - near) * ei, before * ei),
            *(sag + behind * ga, (x - near) * ei, bow, behind * ei),
        )
        first, second = self._held_back(x)
        if x != y:
            second = self._held_back(y)[1]
        across = []
        for value, (row, column) in zip(cantilever, INFLUENCES, strict=True):
            (a, b, c), (d, e, f) = first[row], second[column]
            across.append(value - (a * d + b * e + c * f))
        along = stretch * near * rest
        by_x, by_y = before * rest - behind * near, behind * rest - before * near
        return [along, *across[:4], stretch * by_x, *across[4:8], stretch * by_y, *across[8:]]


def interior_points(
    frame: Frame, pieces: Indices, member: Indices, place: Array
) -> tuple[Array, Array]:
    """
    Return how points on members of a frame move, see `points_on_beams`.

    :param frame: the frame.
    :param pieces: (p,) numbers of the members.
    :param member: (c,) which of these each point is on.
    :param place: (c,) distance from its start [m].
    """
    own = frame.members
    values = frame.length, own.axial, own.flexural, own.shear, own.pinned_start
    return points_on_beams(member, place, *(each[pieces] for each in values))


def points_on_beams(
    member: Indices,
    place: Array,
    length: Array,
    axial: Array,
    flexural: Array,
    shear: Array,
    pinned: Flags,
) -> tuple[Array, Array]:
    """
    Return how points on beams move.

    :param member: (c,) which of the p beams each point is on.
    :param place: (c,) distance from its start [m].
    :param length: (p,) of the beams [m].
    :param axial: (p,) EA [N].
    :param flexural: (p,) EI [N m^2].
    :param shear: (p,) GA [N].
    :param pinned: (p,) whether the start transmits no moment.
    :return: the shape functions (c, 2, 6): along and across the member, by (ux, uy, theta) at
        start and end; and the compliance (2, c, c) along the members, and across them, under unit
        forces at points while the ends are held [m/N], zero between members.
    """
    beams = length, axial, flexural, shear, pinned
    beam = ClampedBeam(*(values[member] for values in beams))
    part = place / length[member]
    shapes = np.zeros((len(part), 2, 6))
    shapes[:, 0, 0], shapes[:, 0, 3] = 1.0 - part, part
    shapes[:, 1, [1, 2, 4, 5]] = np.transpose(beam.shapes(place, 1)[DEFLECTION])
    return shapes, beam.give(place) * (member[:, None] == member)
