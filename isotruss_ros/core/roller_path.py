"""Rollers along a path: straight lines of roller travel between waypoints, in time."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.arrays import finite_array
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.robot import Robot
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: What takes longer is a mistake [s].
MAX_DURATION = 86_400.0


class Wanted(NamedTuple):
    """Where the rollers should be (r,) [m], and how quick (r,) [m/s]."""

    positions: Array
    speeds: Array


class RollerPath:
    """
    A path of the rollers, followed by speeds from measured positions.

    :ivar duration: of the whole path [s].
    :param robot: the robot.
    :param positions: (k, r) waypoints [m], at least one.
    :param times: (k,) when to be there [s], from 0 on, increasing, at most a day.
    :raises ConfigurationError: shapes that do not fit, numbers that are not finite, times that do
        not increase or do not end, or a speed beyond what the robot's rollers can do.
    """

    def __init__(self, robot: Robot, positions: ArrayLike, times: ArrayLike) -> None:
        given = positions if np.iterable(positions) else [positions]
        rows = [robot.check_rollers(row, 'roller positions [m]') for row in given]
        if not rows:
            raise ConfigurationError(
                'a path of the rollers without a point: must have one or more'
            )
        self._positions = np.array(rows)
        self._times = finite_array(times, len(rows), 'times of the path [s]', ConfigurationError)
        steps = np.diff(self._times)
        good = np.append(self._times[0] >= 0.0, steps > 0.0) & (self._times <= MAX_DURATION)
        if not good.all():
            place = int(good.argmin())
            raise ConfigurationError(
                f'time {self._times[place]:.9g} s of point {place} of the path: must be later '
                f'than that of the point before, from 0 to {MAX_DURATION:g} s'
            )
        with np.errstate(over='ignore'):  # too quick is too quick
            self._slopes = np.diff(self._positions, axis=0) / steps[:, None]
        quickest = float(np.abs(self._slopes).max(initial=0.0))
        fastest = robot.description.max_speed
        if quickest > fastest * (1.0 + 1e-6):
            raise ConfigurationError(
                f'the path asks a roller for {quickest:.9g} m/s; must be at most {fastest:g}'
            )
        self.duration = float(self._times[-1])

    def at(self, time: float) -> Wanted:
        """Return what the rollers should do at a time [s]; they stand still before and after."""
        place = int(np.searchsorted(self._times, time, side='right')) - 1
        if place < 0:
            return Wanted(self._positions[0], np.zeros_like(self._positions[0]))
        if place >= len(self._slopes):
            return Wanted(self._positions[-1], np.zeros_like(self._positions[-1]))
        slope = self._slopes[place]
        return Wanted(self._positions[place] + (time - self._times[place]) * slope, slope)
