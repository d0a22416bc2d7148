# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Follow a path of the object: feed-forward of the path, feedback of the measured pose.

    twist = r * (d pose of the path / d tau)  +  K * (pose of the path - measured pose)

The object moves as its twist says, so each coordinate is an integrator, and what slip, noise and
a wrong shape add is a disturbance at its input: the error decays at the rate K and stays within
disturbance / K, however long the path is. Path time runs at the rate r = d tau / dt from 0 to 1:
slower where the robot lags, never backward, and never in jumps.
"""

from __future__ import annotations

from dataclasses import dataclass
import enum
import math
from typing import NamedTuple

from isotruss_ros.core.control.object_path import ObjectPath
from isotruss_ros.core.control.path_timing import PathClock
from isotruss_ros.core.errors import PathError
from isotruss_ros.core.model.pose import MAX_DISTANCE, Pose, pose_difference
from isotruss_ros.core.numerics.arrays import Array, finite_array
import numpy as np

#: K times the delay of the loop is at most this. An integrator under feedback with a delay that
#: varies up to T is stable while K T < 3/2 (Yorke 1970); half of that is the margin.
MAX_GAIN_TIMES_DELAY = 0.75
#: An object held at the frequency omega is off its path by about this times a / omega^2 where it
#: is accelerated by a: twice for a step of a, and more with the lag of the loop.
INERTIA = 2.5
#: Path time runs freely up to this share of the tolerances, and stands still from this one on.
FREE, STANDING = 0.5, 0.9
#: At the end the error must be below this share of the tolerances.
REACHED = 0.5
#: The feedback is at most this share of the path's own speed and turn rate.
MAX_CORRECTION = 0.5
#: Zero divided by this is zero.
TINY = 1e-12


class PathPhase(enum.Enum):
    """How it goes along the path."""

    FOLLOWING = enum.auto()  #: path time runs as it should
    SLOWED = enum.auto()  #: path time runs slower: the robot lags, or is slowed by its limits
    HELD = enum.auto()  #: the robot is stopped; path time stands still
    SETTLING = enum.auto()  #: the path is over, the object not yet within tolerance of its end
    REACHED = enum.auto()  #: the object is at the end of the path
    OFF_PATH = enum.auto()  #: off the path, or off its end for too long
    STUCK = enum.auto()  #: stopped, or too slow, for too long


#: In these there is nothing more to follow.
FINISHED = frozenset({PathPhase.REACHED, PathPhase.OFF_PATH, PathPhase.STUCK})


@dataclass(frozen=True)
class TrackingSettings:
    """
    How to follow.

    :ivar position_tolerance: how far the object may be off the path [m].
    :ivar angle_tolerance: the same for its orientation [rad].
    :ivar position_gain: rate at which errors of position decay [1/s].
    :ivar angle_gain: the same for the orientation [1/s].
    :ivar ramp_time: from rest to the full speed of the path, and back [s].
    :ivar progress_timeout: the object may stand still for this long [s].
    :raises PathError: names the value and what would be right.
    """

    position_tolerance: float = 0.01
    angle_tolerance: float = 0.2
    position_gain: float = 2.0
    angle_gain: float = 2.0
    ramp_time: float = 0.5
    progress_timeout: float = 3.0

    def __post_init__(self) -> None:
        """Reject what is not a positive number; gains may be 0."""
        for name, value in vars(self).items():
            if not (value > 0.0 or (value == 0.0 and name.endswith('gain'))) or value == math.inf:
                raise PathError(f'{name} {value!r}: must be a positive number')


#: How an object is brought back that went along a little as the grip closed on it: at this speed
#: [m/s] and rate of turn [rad/s], so slowly that robots with masses do not swing.
RETURN = TrackingSettings(position_tolerance=0.0025)
RETURN_SPEED, RETURN_TURN_RATE = 0.002, 0.02


class Tracking(NamedTuple):
    """
    What to do in one cycle, and how it goes.

    :ivar phase: of following the path.
    :ivar twist: (3,) of the object, robot frame [m/s, rad/s]; zero where it must not move.
    :ivar position_error: from where the object should have been when it was measured [m].
    :ivar angle_error: the same for its orientation, not negative [rad].
    :ivar progress: 0 to 1, by time.
    :ivar time_left: if nothing slows the object any more [s].
    :ivar message: in words, with the numbers, once it is finished.
    """

    phase: PathPhase
    twist: Array
    position_error: float
    angle_error: float
    progress: float
    time_left: float
    message: str


class PathTracker:
    """
    State of following one path.

    :ivar clock: path time.
    :ivar max_position_error: so far [m].
    :ivar max_angle_error: so far [rad].
    :param path: what to follow.
    :param settings: how.
    :param period: of the control loop [s].
    """

    def __init__(self, path: ObjectPath, settings: TrackingSettings, period: float) -> None:
        self.path = path
        self.settings = settings
        self.clock = PathClock(
            path.duration, settings.ramp_time, settings.progress_timeout, period
        )
        self.max_position_error = self.max_angle_error = 0.0
        self._watched, self._squares = 0.0, 0.0

    def allow_for_inertia(self, frequency: float) -> None:
        """
        Take so long from rest to speed that the object keeps within its free share of the path.

        :param frequency: lowest natural frequency of the held object; 0 if not known [rad/s].
        """
        if frequency > 0.0:
            settings, path = self.settings, self.path
            shares = (
                path.speed / settings.position_tolerance,
                path.turn_rate / settings.angle_tolerance,
            )
            needed = INERTIA * max(shares) / (FREE * frequency**2)
            self.clock.ramp_time = max(settings.ramp_time, needed)

    @property
    def rms_position_error(self) -> float:
        """Return the root mean square error of position so far, over time [m]."""
        return math.sqrt(self._squares / self._watched) if self._watched > 0.0 else 0.0

    def update(
        self, measured: Pose, age: float, elapsed: float, scale: float = 1.0, held: bool = False
    ) -> Tracking:
        """
        Return what to do until the next cycle.

        :param measured: pose of the object.
        :param age: how old it is [s].
        :param elapsed: since the last cycle; a longer one than two periods counts as two [s].
        :param scale: 0 to 1, what part of the last twist the limits of the robot left.
        :param held: whether the robot is stopped.
        :raises PathError: the measured pose is not three finite numbers within range.
        """
        finite_array(
            measured, 3, 'the measured pose (x, y, angle) [m, rad]', PathError, MAX_DISTANCE
        )
        age, elapsed = max(age, 0.0), max(elapsed, 0.0)
        error = pose_difference(self.path.pose(self.clock.time_then(elapsed, age)), measured)
        position_error, angle_error = math.hypot(error[0], error[1]), abs(float(error[2]))
        step = self.clock.step(elapsed)
        self._note(position_error, angle_error, step)
        share = max(
            position_error / self.settings.position_tolerance,
            angle_error / self.settings.angle_tolerance,
        )
        room = min(max((STANDING - share) / (STANDING - FREE), 0.0), 1.0)
        here, over = self.path.pose(self.clock.time), self.clock.at_end
        self.clock.advance(elapsed, room, scale, held)
        phase = self._phase(share, over, min(room, scale), held)
        twist = np.zeros(3)
        if phase not in FINISHED and phase is not PathPhase.HELD:
            # The mean over the step: exact also where the path turns a corner in it, or ends.
            ahead = (self.path.pose(self.clock.time) - here) / max(step, TINY)
            twist = ahead + self._feedback(error, age)
        return Tracking(
            phase,
            twist,
            position_error,
            angle_error,
            self.clock.time / self.path.duration,
            self.clock.time_left,
            self._words(phase, f'{1e3 * position_error:.3g} mm and {angle_error:.3g} rad'),
        )

    def _note(self, position_error: float, angle_error: float, step: float) -> None:
        self.max_position_error = max(self.max_position_error, position_error)
        self.max_angle_error = max(self.max_angle_error, angle_error)
        self._watched += step
        self._squares += step * position_error * position_error  # of any size: ** would raise

    def _feedback(self, error: Array, age: float) -> Array:
        """Return the twist that takes the error away (3,), within its bounds."""
        settings, path = self.settings, self.path
        most = MAX_GAIN_TIMES_DELAY / (age + self.clock.period)
        twist = error * min(settings.position_gain, most)
        twist[2] = error[2] * min(settings.angle_gain, most)
        speed, turn = math.hypot(twist[0], twist[1]), abs(float(twist[2]))
        twist[:2] *= min(1.0, MAX_CORRECTION * path.speed / max(speed, TINY))
        twist[2] *= min(1.0, MAX_CORRECTION * path.turn_rate / max(turn, TINY))
        return twist

    def _phase(self, share: float, over: bool, pace: float, held: bool) -> PathPhase:
        """
        Return how it goes.

        :param share: the error over its tolerance.
        :param over: whether the object should be at the end of the path now.
        :param pace: the rate that the robot's lag and limits leave.
        """
        if share > 1.0:
            return PathPhase.OFF_PATH
        if over and not held and share <= REACHED:
            return PathPhase.REACHED
        if self.clock.waited > self.settings.progress_timeout:
            return PathPhase.OFF_PATH if over and not held else PathPhase.STUCK
        if held:
            return PathPhase.HELD
        if over:
            return PathPhase.SETTLING
        return PathPhase.SLOWED if pace < 1.0 else PathPhase.FOLLOWING

    def _words(self, phase: PathPhase, error: str) -> str:
        """Return the message for a path that is finished; empty for one that is not."""
        where = 'the end of the path' if self.clock.at_end else 'the path'
        if phase is PathPhase.STUCK:
            return f'no progress for {self.clock.waited:.3g} s, {error} off {where}'
        return f'{error} off {where}' if phase in FINISHED else ''
