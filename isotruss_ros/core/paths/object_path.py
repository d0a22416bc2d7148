# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Path of the object: its desired pose as a function of time, interpolated between given poses.

Position and angle are interpolated linearly between poses, the angle in the shorter direction. The
duration of a segment is the time for the translation at `speed` or the time for the rotation at
`turn_rate`, whichever is longer. A smooth path is a centripetal Catmull-Rom spline through the
poses, sampled in short segments; it has no cusps or loops between two poses (Yuksel, Schaefer and
Keyser, Computer-Aided Design 2011).
"""

from __future__ import annotations

import math

from isotruss_ros.core.errors import format_numbers, NoMotionError, PathError
from isotruss_ros.core.model.pose import check_range, pose_fault
from isotruss_ros.core.numerics.arrays import Array, finite_rows, MAX_MAGNITUDE
from isotruss_ros.core.numerics.tolerances import ROUNDING
import numpy as np
from numpy.typing import ArrayLike
import scipy

#: Largest number of poses [-] and longest duration [s] of a valid path.
MAX_POSES, MAX_DURATION = 10_000, 86_400.0
#: Smallest speed [m/s] and turn rate [rad/s]; slower paths of a metre last longer than a day.
MIN_RATE = 1e-6
#: Approximate length [m] and rotation [rad] of a segment of a smooth path; segments are longer if
#: there would be more than `MAX_POSES`.
PIECE, PIECE_TURN = 0.005, 0.02


class ObjectPath:
    """
    Path of the object, given by poses with their times.

    :ivar poses: (n, 3) x, y [m] and angle [rad] in the robot frame. Angles are continued beyond
        one turn, from the given angle of the first pose.
    :ivar times: (n,) times of the poses, from 0 [s].
    :ivar duration: duration of the path [s].
    :ivar length: length of the centre's path [m].
    :param poses: (n, 3) two or more poses x, y [m], angle [rad]; successive equal poses are
        removed.
    :param speed: speed of the centre along the path [m/s].
    :param turn_rate: largest angular velocity [rad/s].
    :param smooth: True for a spline through the poses in place of straight segments.
    :param first: number of the first pose in error messages.
    :raises PathError: a value is invalid; the message names it and its valid range.
    """

    def __init__(
        self,
        poses: ArrayLike,
        speed: float,
        turn_rate: float,
        smooth: bool = False,
        first: int = 0,
    ) -> None:
        self.speed = check_range(speed, 'speed', 'm/s', MIN_RATE, 10.0, PathError)
        self.turn_rate = check_range(turn_rate, 'turn rate', 'rad/s', MIN_RATE, 100.0, PathError)
        self.poses = _drop_repeated(_read_poses(poses, first))
        if smooth:
            self.poses = _drop_repeated(_sample_spline(self.poses, self._durations()))
        self.times = np.concatenate([[0.0], np.cumsum(self._durations())])

    def _durations(self) -> Array:
        """Return the durations (n - 1,) of the segments [s]."""
        steps = np.abs(np.diff(self.poses, axis=0))
        lengths = np.hypot(steps[:, 0], steps[:, 1])
        with np.errstate(over='ignore'):  # infinite durations are refused
            durations = np.maximum(lengths / self.speed, steps[:, 2] / self.turn_rate)
            total = float(durations.sum())
        if total > MAX_DURATION:
            raise PathError(
                f'the path takes {total:.4g} s at {self.speed:g} m/s and '
                f'{self.turn_rate:g} rad/s; must be at most {MAX_DURATION:g} s'
            )
        return durations

    @property
    def duration(self) -> float:
        """Return the duration of the path [s]."""
        return float(self.times[-1])

    @property
    def length(self) -> float:
        """Return the length of the path of the object's centre [m]."""
        return float(np.abs(np.diff(self.poses[:, :2] @ [1.0, 1.0j])).sum())

    def pose(self, time: float) -> Array:
        """
        Return the desired pose at a time; it is constant before the start and after the end.

        :param time: time since the start of the path [s].
        :raises PathError: the time is not a number.
        """
        if math.isnan(time):
            raise PathError(f'time {time!r} s on the path: must be a number')
        return np.array([np.interp(time, self.times, values) for values in self.poses.T])


def _read_poses(poses: ArrayLike, first: int) -> Array:
    """Return the poses (n, 3), with angles that are continued beyond one turn."""
    what = 'the poses of the path (x, y, angle) [m, rad]'
    array = finite_rows(poses, 3, what, PathError, MAX_MAGNITUDE)
    if not 2 <= len(array) <= MAX_POSES:
        counts = f'two or more, at most {MAX_POSES}'
        raise PathError(f'the path has {len(array)} poses; must be {counts}')
    for number, (x, y) in enumerate(array[:, :2].tolist(), first):
        if fault := pose_fault(x, y):
            raise PathError(f'pose {number} of the path: ({x:g}, {y:g}): {fault}')
    array[:, 2] = np.unwrap(array[:, 2])
    # A half turn has no shorter direction.
    half_turns = np.flatnonzero(np.abs(np.diff(array[:, 2])) > math.pi - 1e-6)
    if len(half_turns):
        raise PathError(
            f'pose {half_turns[0] + 1 + first} of the path is half a turn from the previous pose, '
            'so the direction of rotation is ambiguous; add a pose in between'
        )
    return array


def _drop_repeated(poses: Array) -> Array:
    """Return the poses without those that equal the previous pose."""
    cells = np.round(poses / ROUNDING)
    differs = (np.diff(cells, axis=0) != 0.0).any(axis=1)
    if not differs.any():
        raise NoMotionError(
            f'all poses of the path equal {format_numbers(poses[0])}; two or more must differ'
        )
    return poses[np.concatenate([[True], differs])]


def _sample_spline(poses: Array, durations: Array) -> Array:
    """Return samples of the centripetal Catmull-Rom spline with durations as knot intervals."""
    knots = np.concatenate([[0.0], np.cumsum(np.sqrt(durations))])
    # Tangents of the parabola through each pose and its neighbours.
    tangents = np.gradient(poses, knots, axis=0, edge_order=2 if len(poses) > 2 else 1)
    spline = scipy.interpolate.CubicHermiteSpline(knots, poses, tangents)
    # Number of pieces of each segment, by distance and angle.
    steps = np.abs(np.diff(poses, axis=0))
    pieces = np.maximum(np.hypot(steps[:, 0], steps[:, 1]) / PIECE, steps[:, 2] / PIECE_TURN)
    pieces *= min(1.0, MAX_POSES / pieces.sum())
    counts = np.ceil(pieces).clip(1).astype(int)
    # The samples of a segment are at even steps of the parameter between its knots.
    knot_indices = np.concatenate([[0], np.cumsum(counts)])
    parameters = np.interp(np.arange(knot_indices[-1] + 1), knot_indices, knots)
    return spline(parameters)
