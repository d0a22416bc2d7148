# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
How members give where an object presses on them, at places that may move along them.

A load at a place of a piece moves the ends of the piece, and with them the whole structure, and
bends the piece between its ends: `ClampedBeam` has both, with derivatives by the place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import functools
import itertools
import operator

from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.statics.interior import ClampedBeam
from isotruss_ros.core.statics.structure import Structure
import numpy as np

#: Numbers of one place: shares of both ends along the piece and their derivatives, `shapes`; then
#: those of the place and itself.
OF_PLACE = 35
#: Of what these are in responses by the ends (along, across, slope), in loads (along, across,
#: moment), and in the derivatives of both; -1: zero.
SHARE, SHARE_RATE = [0, -1, -1, 1, -1, -1], [2, -1, -1, 3, -1, -1]
ACROSS, SLOPE, ROTATION, BEND = ([-1, i, i + 1, -1, i + 2, i + 3] for i in (4, 8, 12, 16))
SHAPES = np.array([[SHARE, ACROSS, SLOPE], [SHARE, ACROSS, ROTATION], [SHARE_RATE, SLOPE, BEND]])
#: Numbers of two places on one piece: see `ClampedBeam.influence`.
OF_PAIR = 15
INFLUENCE = np.array([[[i, -1, -1], [-1, i + 1, i + 2], [-1, i + 3, i + 4]] for i in (0, 5, 10)])
#: Signs of these numbers on a piece that runs backward along its member.
PAIR_BACKWARD = [1.0, 1.0, -1.0, -1.0, 1.0, *[-1.0, -1.0, 1.0, 1.0, -1.0] * 2]
BACKWARD = [-1.0, -1.0, 1.0, 1.0, *[-1.0] * 4, *[1.0] * 8, *[-1.0] * 4, *PAIR_BACKWARD]


@dataclass(frozen=True, eq=False)
class ContactCompliance:
    """
    How k members give under loads at one place on each.

    Loads are forces along and across the member and a moment (f_along, f_across, m) [N, N m],
    responses are the displacement along and across and the slope of the bent centre line, the
    mean of both sides where a force puts a kink into it (u_along, u_across, w') [m, -].

    :ivar matrix: (k, 3, k, 3) responses for unit loads.
    """

    matrix: Array
    _loads: Array  # (3 k, 6 k) displacements where loads are by the ends
    _by_load: Array  # (3 k, k, 3) derivatives of the matrix by the place of the load
    _by_response: Array  # (3 k, 3 k) the same by the place of the response

    def respond(self, loads: Array) -> Array:
        """
        Return the responses (k, 3) to loads (k, 3).

        :param loads: (k, 3) forces along and across the member [N] and moment [N m].
        """
        size = loads.size
        return (self.matrix.reshape(size, size) @ loads.ravel()).reshape(-1, 3)

    def carried(self, loads: Array) -> Array:
        """
        Return what moves the ends of the pieces as loads (k, 3) do, in the frames of these (k, 6).

        :param loads: (k, 3) forces along and across the member [N] and moment [N m].
        """
        return (self._loads.T @ loads.ravel()).reshape(len(loads), 6)

    def rates(self, loads: Array) -> Array:
        """
        Return how the responses change with the places (k,) of contact: (k, 3, k) [1/m].

        :param loads: (k, 3) forces along and across the member [N] and moment [N m].
        """
        own = np.arange(len(loads))
        rates = np.einsum('ric,ic->ri', self._by_load, loads).reshape(-1, 3, len(loads))
        rates[own, :, own] += (self._by_response @ loads.ravel()).reshape(-1, 3)
        return rates


class MemberCompliance:
    """
    The compliance of a structure at places on some of its members.

    :ivar structure: the robot's frame.
    :ivar start: (k,) pinch points at which the members begin, x + iy [m].
    :ivar axis: (k,) directions of the members, from the start.
    :ivar length: (k,) pinch to pinch [m].
    :param structure: the robot's frame.
    :param members: the k members, numbered as in `Robot.member_names`; one that has two places of
        contact is there twice.
    :param scale: the stiffness of the structure against that of the model.
    """

    def __init__(self, structure: Structure, members: Sequence[int], scale: float = 1.0) -> None:
        self.structure = structure
        frame, topology = structure.frame, structure.config.robot.topology
        used = np.asarray(members, dtype=np.intp)
        count = len(used)
        # Pieces of a member in their order: B to D, D to E', C' to E', which runs backward.
        first, last, middle = structure.pieces
        pieces = np.stack([first[used], middle[used], last[topology.following[used]]], axis=1)
        self._pieces = pieces
        begin = frame.points[frame.members.start[pieces]]
        self.start = begin[:, 0]
        self.length = np.abs(begin[:, 2] - self.start)
        self.axis = (begin[:, 2] - self.start) / self.length
        length = frame.length[pieces]
        # Where one piece ends and the next one begins, by the place on the member.
        joints = np.stack([length[:, 0], length[:, 0] + length[:, 1]], axis=1)
        self._members, self._scale = used, scale
        own = frame.members
        of_beams = (length, *(each[pieces] for each in (own.axial, own.flexural, own.shear)))
        self._beams = np.stack(of_beams, axis=2).tolist()
        self._pinned = own.pinned_start[pieces].tolist()
        self._lengths: list[float] = self.length.tolist()
        self._ends_joined: list[list[float]] = joints.tolist()
        every = itertools.permutations(range(count), 2)
        self._pairs = tuple((i, j) for i, j in every if used[i] == used[j])
        self._pieces_at: dict[tuple[int, int], ClampedBeam] = {}
        self._ends_at: dict[tuple[int, ...], Array] = {}
        self._last: tuple[bytes, ContactCompliance] | None = None

    def locate(self, places: Array) -> tuple[Indices, Array]:
        """
        Return the pieces (k,) of the frame that places are on, and where, from their starts [m].

        :param places: (k,) distances from the members' starts [m].
        """
        return locate_places(self.structure, self._members, places)

    def at(self, places: Array) -> ContactCompliance:
        """
        Return the compliance at one place on each member; that of the last places is kept.

        :param places: (k,) distances from the members' starts [m].
        """
        key = places.tobytes()
        if self._last is None or self._last[0] != key:
            self._last = key, self._at(places)
        return self._last[1]

    def _at(self, places: Array) -> ContactCompliance:
        """Compute what `at` returns."""
        values: list[float] = []
        numbers, on_pieces = [], []
        for i, place in enumerate(places.tolist()):
            first, second = self._ends_joined[i]
            number = int(place >= first) + int(place >= second)
            x = self._lengths[i] - place if number == 2 else place - (0.0, first)[number]
            values += self._of_place(i, number, x)
            numbers.append(number)
            on_pieces.append(x)
        for i, j in self._pairs:
            values += self._of_pair(i, numbers[i], numbers[j], on_pieces[i], on_pieces[j])
        count = len(numbers)
        shapes_at, inside_at = _templates(count, self._pairs)
        flat = np.array([*values, 0.0])
        responses, loads, rate = flat.take(shapes_at)
        inside, by_response, by_load = flat.take(inside_at) / self._scale
        ends = self._ends(tuple(numbers))
        to_ends, by_ends = ends @ loads.T, responses @ ends
        return ContactCompliance(
            matrix=(responses @ to_ends + inside).reshape(count, 3, count, 3),
            _loads=loads,
            _by_load=(by_ends @ rate.T + by_load).reshape(-1, count, 3),
            _by_response=rate @ to_ends + by_response,
        )

    def _of_place(self, i: int, number: int, x: float) -> list[float]:
        """Return the numbers of a place on a piece of one of the members."""
        part, rate = x / self._beams[i][number][0], 1.0 / self._beams[i][number][0]
        shapes, influence = self._beam(i, number).at(x)
        values = [1.0 - part, part, -rate, rate, *itertools.chain(*shapes), *influence]
        return values if number < 2 else list(map(operator.mul, BACKWARD, values))

    def _of_pair(self, i: int, number: int, other: int, x: float, y: float) -> list[float]:
        """Return the numbers of two places on one of the members, zeros if their pieces differ."""
        if number != other:
            return [0.0] * OF_PAIR
        values = self._beam(i, number).influence(x, y)
        return values if number < 2 else list(map(operator.mul, PAIR_BACKWARD, values))

    def _beam(self, i: int, number: int) -> ClampedBeam:
        """Return a piece of one of the members; kept."""
        beam = self._pieces_at.get((i, number))
        if beam is None:
            beam = ClampedBeam(*self._beams[i][number], self._pinned[i][number])
            self._pieces_at[i, number] = beam
        return beam

    def _ends(self, numbers: tuple[int, ...]) -> Array:
        """Return the compliance (6 k, 6 k) of the ends of one piece of each member; kept."""
        found = self._ends_at.get(numbers)
        if found is None:
            pieces = self._pieces[np.arange(len(numbers)), list(numbers)]
            found = self.structure.frame.compliance(pieces) / self._scale
            self._ends_at[numbers] = found
        return found


def locate_places(structure: Structure, members: Indices, places: Array) -> tuple[Indices, Array]:
    """
    Return the pieces (k,) of the frame that places are on, and where, from their starts [m].

    :param structure: the robot's frame.
    :param members: (k,) numbers of the members.
    :param places: (k,) distances from the members' starts [m].
    """
    config, (first, last, middle) = structure.config, structure.pieces
    ring, length = config.robot.description.module.guide_ring_distance, config.member_lengths
    behind = config.robot.topology.following[members]
    begins, left = places < ring, length[members] - places
    ends = left <= ring
    pieces = np.where(begins, first[members], np.where(ends, last[behind], middle[members]))
    return pieces, np.where(begins, places, np.where(ends, left, places - ring))


@functools.lru_cache(maxsize=8)
def _templates(count: int, pairs: tuple[tuple[int, int], ...]) -> tuple[Indices, Indices]:
    """Return where the numbers of k places, and of pairs of them, go; zero is behind all."""
    begin = OF_PLACE * count
    zero = begin + OF_PAIR * len(pairs)
    shapes = np.full((3, count, 3, count, 6), zero)
    inside = np.full((3, count, 3, count, 3), zero)
    for i in range(count):
        shapes[:, i, :, i] = np.where(SHAPES < 0, zero, OF_PLACE * i + SHAPES)
    own = [(i, i, OF_PLACE * (i + 1) - OF_PAIR) for i in range(count)]
    for i, j, first in own + [(*pair, begin + OF_PAIR * n) for n, pair in enumerate(pairs)]:
        inside[:, i, :, j] = np.where(INFLUENCE < 0, zero, first + INFLUENCE)
    return shapes.reshape(3, 3 * count, -1), inside.reshape(3, 3 * count, -1)
