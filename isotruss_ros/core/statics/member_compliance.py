# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How members give where an object presses on them, at places that may move along them.

A load at a place of a piece moves the ends of the piece, and with them the whole structure, and
bends the piece between its ends: `Beams` has both, with derivatives by the place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.statics.beam import Beams, IDENTITY, sum_series
from isotruss_ros.core.statics.structure import Structure
import numpy as np


@dataclass(frozen=True, eq=False)
class ContactCompliance:
    """
    How k members give under loads at one place on each.

    Loads are forces along and across the member and a moment (f_along, f_across, m) [N, N m],
    responses are the displacement along and across and the slope of the bent centre line, the
    mean of both sides where a force puts a kink into it (u_along, u_across, w') [m, -].

    :ivar matrix: (k, 3, k, 3) responses for unit loads.
    :ivar pieces: (k,) numbers of the pieces of the frame that the places are on.
    """

    matrix: Array
    pieces: Indices
    _work: Array  # (k, 3, 6) what loads do at the ends of their pieces
    #: (k, k, 6, 6) of response and load: responses, and their derivatives by their own place, to
    #: unit loads, and derivatives by the place of these.
    _rates: Array

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
        return (loads[:, None] @ self._work)[:, 0]

    def rates(self, loads: Array) -> Array:
        """
        Return how the responses change with the places (k,) of contact: (k, 3, k) [1/m].

        :param loads: (k, 3) forces along and across the member [N] and moment [N m].
        """
        own = np.arange(len(loads))
        rates = (self._rates[:, :, :3, 3:] @ loads[:, :, None])[..., 0].swapaxes(1, 2)
        moved = self._rates[:, :, 3:, :3].swapaxes(1, 2).reshape(len(loads), 3, -1)
        rates[own, :, own] += moved @ loads.ravel()
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
        config, self._members = structure.config, np.asarray(members, dtype=np.intp)
        topology = config.robot.topology
        self.start = config.points[topology.b[self._members]]
        self.length = config.member_lengths[self._members]
        end = config.points[topology.c[topology.following[self._members]]]
        self.axis = (end - self.start) / self.length
        self._scale = scale
        self._pieces: dict[bytes, _LoadedPieces] = {}
        self._last: tuple[bytes, ContactCompliance] | None = None

    def at(self, places: Array) -> ContactCompliance:
        """
        Return the compliance at one place on each member; that of the last places is kept.

        :param places: (k,) distances from the members' starts [m].
        """
        key = places.tobytes()
        if self._last is None or self._last[0] != key:
            pieces, within, ahead = self.structure.locate(self._members, places)
            which = pieces.tobytes()
            if which not in self._pieces:
                self._pieces[which] = _LoadedPieces(self.structure, pieces, ahead, self._scale)
            self._last = key, self._pieces[which].respond(within)
        return self._last[1]


class _LoadedPieces:
    """Pieces of tube under k members with one load each; some may be there twice."""

    def __init__(self, structure: Structure, pieces: Indices, ahead: Array, scale: float) -> None:
        frame, count = structure.frame, len(pieces)
        self._numbers, self._pairs = pieces, np.nonzero(pieces[:, None] == pieces)
        first, second = self._pairs
        beams = Beams(*(each[pieces] for each in frame.beams))
        ends = frame.compliance(pieces) / scale
        self._length, self._ends = beams.length, ends.reshape(count, 6, count, 6).swapaxes(1, 2)
        slope = beams.series[:, 1]
        # From the piece's frame to that of the member, along which it may run backward.
        turn = np.stack([ahead, ahead, np.ones(count)], axis=1)[:, :, None]
        along = ahead[:, None, None] * slope
        # What responds: u, w and w' = theta + V / GA; then their derivatives by the place.
        rows = turn * IDENTITY[:3]
        rows[:, 2, 4] = slope[:, 1, 4]
        rows = np.concatenate([rows, rows @ along], axis=1)[:, None]
        # Jumps of N, V and M by loads; then their derivatives by the place.
        jumps = IDENTITY[:, 3:] * turn.swapaxes(1, 2)
        jumps = np.concatenate([jumps, -along @ jumps], axis=2)[:, None] / scale
        # By powers of the place, of the distance from the other end, and of that between loads.
        shapes = rows @ beams.series @ beams.by_ends[:, None]
        between = (rows @ beams.series)[first] @ jumps[second]
        self._series = np.concatenate([shapes, beams.series @ jumps, between])
        # Loads turn the sections, which shear does not.
        self._sheared = np.zeros((count, 6, 6))
        self._sheared[:, 2] = slope[:, 1, 4, None] * beams.by_ends[:, 4]

    def respond(self, x: Array) -> ContactCompliance:
        """Return the compliance at places (k,) from the starts of the pieces [m]."""
        i, j = self._pairs
        count, apart = len(x), x[i] - x[j]
        series = sum_series(self._series, np.concatenate([x, self._length - x, apart]))
        shapes, behind, between = np.split(series, [count, 2 * count])
        work = shapes - self._sheared
        rates = shapes[:, None] @ self._ends @ work.swapaxes(1, 2)
        # Of a load at the place itself: the mean of both sides.
        between *= 0.5 * (1.0 + np.sign(apart))[:, None, None]
        rates[i, j] += shapes[i, :, 3:] @ behind[j, :3] - between
        matrix = np.ascontiguousarray(rates[:, :, :3, :3].swapaxes(1, 2))
        return ContactCompliance(matrix, self._numbers, work[:, :3], rates)
