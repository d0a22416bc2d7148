"""
Roller path servo: in every cycle, go on along a path of the rollers, wait, or give up.

It begins where the rollers are, goes by measured positions, and whatever is not known ends it.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.errors import ConfigurationError, IsotrussError
from isotruss_ros.core.robot import Robot
from isotruss_ros.core.roller_path import RollerPath
from isotruss_ros.core.samples import Input, require_fresh
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Errors are made good at this rate [1/s].
GAIN = 5.0
#: The path must begin this near to where the rollers are [m].
START_TOLERANCE = 0.01
#: The rollers have arrived when all are this near to the end [m], and still are when it is
#: measured so much later [s]: those that pass by are elsewhere then.
TOLERANCE, REST = 2e-5, 0.1
#: The path waits while a roller lags by more than this [m], and is given up after so long [s].
LAG, PATIENCE = 5e-3, 3.0


class RollerStep(NamedTuple):
    """
    What to do in this cycle.

    :ivar speeds: (r,) of the rollers [m/s].
    :ivar ended: whether the path is over, well or not.
    :ivar failure: why it was given up; empty while it goes on and when the rollers arrived.
    """

    speeds: Array
    ended: bool
    failure: str


class RollerPathServo:
    """
    State of following one path.

    :ivar rollers: sample of the measured `RollerState`, a refusal, or None for none yet.
    :ivar time: how far on the path the rollers are [s].
    :param robot: the robot.
    :param timeout: measurements older than this are not relied on [s].
    """

    def __init__(self, robot: Robot, timeout: float) -> None:
        self._robot = robot
        self.timeout = timeout
        self.rollers: Input = None
        self.time = 0.0
        self._path: RollerPath | None = None
        self._before = self._waited = 0.0
        self._near_since: float | None = None

    @property
    def busy(self) -> bool:
        """Tell whether there is a path to follow."""
        return self._path is not None

    def begin(self, path: RollerPath, now: float) -> None:
        """
        Take a path, in place of another one if there is any; one that is refused changes nothing.

        :param now: time on the clock of the samples [s].
        :raises InputError: nobody knows where the rollers are.
        :raises ConfigurationError: the path does not begin there.
        """
        state = require_fresh('joint states', self.rollers, now, self.timeout).value
        away = np.abs(path.at(0.0).positions - state.positions)
        worst = int(away.argmax())
        if away[worst] > START_TOLERANCE:
            raise ConfigurationError(
                f'the path begins {away[worst]:.4g} m from where roller '
                f'{self._robot.roller_names[worst]} is; must begin within {START_TOLERANCE} m'
            )
        self._path, self._before = path, now
        self.time, self._waited, self._near_since = 0.0, 0.0, None

    def end(self) -> None:
        """Let the path go."""
        self._path = None

    def decide(self, now: float) -> RollerStep:
        """
        Return what to do in the cycle that begins now, on a path; never raises for an input.

        :param now: time on the clock of the samples [s].
        """
        still = np.zeros(len(self._robot.roller_names))
        # Cycles come late on a busy machine, or seldom by a clock that ticks seldom.
        elapsed, self._before = min(max(0.0, now - self._before), self.timeout), now
        path = self._path
        if path is None:
            return RollerStep(still, True, 'there is no path to follow')
        try:
            measured = require_fresh('joint states', self.rollers, now, self.timeout)
        except IsotrussError as error:
            self._path = None
            return RollerStep(still, True, str(error))
        positions, ahead = measured.value.positions, min(self.time + elapsed, path.duration)
        wanted, behind = path.at(ahead), path.at(self.time).positions - positions
        error, speeds = wanted.positions - positions, wanted.speeds
        # Rollers at rest are behind, those under way are ahead by what they do in a cycle.
        waits = min(float(np.abs(error).max()), float(np.abs(behind).max())) > LAG
        if waits:
            error, speeds = behind, still
        lag, at_end = float(np.abs(error).max()), ahead >= path.duration
        near = at_end and lag <= TOLERANCE
        if self._rests(near, min(measured.time, now), now):
            self._path = None
            return RollerStep(still, True, '')
        if not waits and self.time < path.duration:
            self.time, self._waited = ahead, 0.0
        elif not near:
            self._waited += elapsed
        if self._waited > PATIENCE:
            self._path = None
            worst = self._robot.roller_names[int(np.abs(error).argmax())]
            return RollerStep(still, True, f'roller {worst} stays {lag:.4g} m behind the path')
        speeds = speeds + GAIN * error
        if at_end:
            # What has arrived rests: rollers are uneven only while they move.
            speeds = np.where(np.abs(error) <= TOLERANCE, 0.0, speeds)
        limit = self._robot.description.max_speed
        return RollerStep(np.clip(speeds, -limit, limit), False, '')

    def _rests(self, near: bool, measured: float, now: float) -> bool:
        """
        Take note of whether the rollers are near to the end; tell whether they stay there.

        :param measured: when they were there [s].
        """
        if not near:
            self._near_since = None
        elif self._near_since is None:
            self._near_since = now
        return self._near_since is not None and measured - self._near_since > REST
