# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Path tracking: feed-forward of the path's velocity, and feedback of the measured pose.

    twist = r * (d pose of the path / d tau)  +  K * (pose of the path - measured pose)

Each coordinate of the object is the integral of its component of the twist; slip, noise and
kinematic errors are disturbances of this twist. The error decays at the rate K; without delay it
is bounded by disturbance / K for any length of the path. Path time tau advances at the rate
r = d tau / dt, between 0 and 1. It never jumps, and it advances more slowly if the robot lags
behind.
"""

from __future__ import annotations

from dataclasses import dataclass
import enum
import math
from typing import NamedTuple

from isotruss_ros.core.errors import PathError
from isotruss_ros.core.inputs import MAX_TIMEOUT, Timeline
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.model.pose import check_range, Pose, pose_difference
from isotruss_ros.core.model.setting_ranges import check_settings
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import Array, finite_array, MAX_MAGNITUDE
from isotruss_ros.core.numerics.tolerances import COINCIDENCE
from isotruss_ros.core.paths.object_path import ObjectPath
import numpy as np

#: Largest product of the gain K and the delay of the loop [-]. An integrator under feedback with a
#: delay of up to T is stable for K T < 3/2 (Yorke 1970); so a gain margin of 2 remains.
MAX_GAIN_DELAY_PRODUCT = 0.75
#: Peak deviation of an object with natural frequency omega under a step of acceleration a, in
#: units of a / omega^2 [-]. It is 2 without damping, and larger with the lag of the loop.
PEAK_DEVIATION_FACTOR = 2.5
#: Ratios of error to tolerance at which path time begins to slow down, and at which it stops [-].
#: While members slide along a post, the object lags by nearly the second one. With 0.5 and 0.9,
#: two of ten such paths are lost in MuJoCo: at a natural frequency of 7 rad/s the object swings by
#: 3 mm, and from 9 mm on the end is not reached in time. With 0.2 and 0.7 one is lost. With 0.1
#: and 0.6, noise of 1 mm makes paths take 1.2 times longer, with these 1.1 times.
SLOWING_SHARE, STOPPING_SHARE = 0.15, 0.65
#: Largest error at the end of a path, and deviation by inertia, relative to the tolerances [-].
END_SHARE = 0.5
#: Largest feedback relative to the path's speed and turn rate [-].
MAX_FEEDBACK_SHARE = 0.5
#: Smallest rate of path time while limits slow the robot [-]; at this rate the path goes on to
#: poses at which no limit binds.
MIN_LIMITED_RATE = 0.1
#: Mean rate of path time during the progress timeout below which there is no progress [-]. Of 11
#: paths of random robots and of a disc near a singularity, the same five end early with a third
#: and three times of it, at shares that differ by at most 0.002. With five times, cycles of 40 ms
#: end early near a singularity where those of 20 ms arrive.
MIN_PROGRESS_RATE = 0.01


class PathPhase(enum.Enum):
    """Phases of path following."""

    FOLLOWING = enum.auto()  #: path time advances at full rate
    SLOWED = enum.auto()  #: path time advances more slowly: the robot lags or is at its limits
    HELD = enum.auto()  #: the robot and path time are stopped
    SETTLING = enum.auto()  #: path time is at its end, but the object is not yet within tolerance
    REACHED = enum.auto()  #: the object is within tolerance of the end
    #: the object is farther from the path than the tolerance, or it has not come close enough to
    #: the end in time
    OFF_PATH = enum.auto()
    STUCK = enum.auto()  #: path time has made no progress for too long


#: Final phases of path following.
FINISHED = frozenset({PathPhase.REACHED, PathPhase.OFF_PATH, PathPhase.STUCK})


def speed_share(status: int, scale: float) -> float:
    """
    Return the factor by which limits reduced the speed of a twist, for `PathTracker.update`.

    A twist that slides along a limit has lost its component into the limit. Slower motion would
    not restore this component, so path time is then slowed by the lag of the object only.

    :param status: status of the command, see `Status`.
    :param scale: factor by which limits reduced the twist, 0 to 1.
    """
    return 1.0 if status == Status.SLIDING else scale


#: Largest period of the tracking [s]; predictions of long paths have long steps.
MAX_PERIOD = 100.0
#: Unit, smallest and largest plausible value of each setting.
TRACKING_RANGES = {
    'position_tolerance': ('m', 1e-6, 10.0),
    'angle_tolerance': ('rad', 1e-6, 2.0 * math.pi),
    'position_gain': ('1/s', 0.0, MAX_MAGNITUDE),
    'angle_gain': ('1/s', 0.0, MAX_MAGNITUDE),
    'ramp_time': ('s', 1e-3, 1e3),
    'progress_timeout': ('s', 1e-3, 1e4),
}


@dataclass(frozen=True)
class TrackingSettings:
    """Settings of path tracking."""

    position_tolerance: float = 0.01  #: error of position at which the path is aborted [m]
    angle_tolerance: float = 0.2  #: error of orientation at which the path is aborted [rad]
    position_gain: float = 2.0  #: decay rate of the position error [1/s]
    angle_gain: float = 2.0  #: decay rate of the orientation error [1/s]
    #: time in which the speed rises from zero to the speed of the path, or falls back [s]
    ramp_time: float = 0.5
    progress_timeout: float = 3.0  #: largest time without progress [s]

    def __post_init__(self) -> None:
        """Raise PathError if a number is out of its range."""
        check_settings(self, TRACKING_RANGES, PathError)


#: Tracking settings, speed [m/s] and turn rate [rad/s] for the return of an object that the
#: closing grip has displaced. They are slow enough not to excite oscillations of robots with
#: masses.
RETURN_SETTINGS = TrackingSettings(position_tolerance=0.0025)
RETURN_SPEED, RETURN_TURN_RATE = 0.002, 0.02


class Tracking(NamedTuple):
    """Twist and state of path tracking in one cycle."""

    phase: PathPhase  #: phase of path following
    twist: Array  #: (3,) twist of the object, robot frame [m/s, rad/s]
    position_error: float  #: error of position at the time of the measurement [m]
    angle_error: float  #: error of orientation at the time of the measurement, not negative [rad]
    progress: float  #: path time relative to the path's duration, 0 to 1
    time_left: float  #: remaining time at full rate [s]
    message: str  #: sentence with the result; empty before a final phase


class PathClock:
    """
    Clock of the path time, which runs from 0 to the path's duration at a rate from 0 to 1.

    :ivar ramp_time: time in which the rate changes from 0 to 1, or back [s].
    :ivar waited: time since the last progress [s].
    :param timeout: largest time without progress [s].
    """

    def __init__(self, duration: float, ramp_time: float, timeout: float, period: float) -> None:
        self.time = self.rate = self.waited = 0.0
        self._duration, self.ramp_time, self.period = duration, ramp_time, period
        self._least_progress = MIN_PROGRESS_RATE * timeout
        self._progress_time = self._now = 0.0  # path time at the last progress; time of the loop
        self._path_times = Timeline().added(0.0, 0.0)  # path time by time of the loop

    @property
    def at_end(self) -> bool:
        """Return whether path time has reached the end of the path."""
        return self.time >= self._duration

    @property
    def time_left(self) -> float:
        """Return the time to the end of the path at full rate of path time [s]."""
        remaining = self._duration - self.time
        # The rate rises to its peak, is constant during the cruise, and falls to zero.
        peak = min(1.0, math.sqrt(remaining / self.ramp_time + 0.5 * self.rate**2))
        cruise = remaining - (peak**2 - 0.5 * self.rate**2) * self.ramp_time
        return (2.0 * peak - self.rate) * self.ramp_time + max(cruise, 0.0)

    def time_then(self, elapsed: float, age: float) -> float:
        """Return path time [s] at a measurement of this age, `elapsed` after the last cycle."""
        return self._path_times.at(self._now + elapsed - age)

    def advance(self, elapsed: float, max_rate: float, scale: float, held: bool) -> float:
        """
        Advance path time by one cycle of the control loop; return the time step of the cycle [s].

        The step has at most two periods, so that a late cycle causes no jump. A rate above
        `max_rate`, which the robot's lag admits, is reduced at once. The rate approaches `scale`
        along a ramp, because this feedback on limits is some cycles late.
        """
        self._now += elapsed
        self.waited += elapsed
        # The history has the path time at the expected end of the last cycle. If this cycle is
        # late, path time has stood still since then.
        if self._now > self._path_times.last[0]:
            self._path_times = self._path_times.added(self._now, self.time)
        self._path_times = self._path_times.since(self._now - MAX_TIMEOUT)
        # Rate of path time, by ramps of constant slope 1 / ramp_time.
        time_step = min(elapsed, 2.0 * self.period)
        desired = 1.0 if scale >= 1.0 else max(self.rate * scale, MIN_LIMITED_RATE)
        change = time_step / self.ramp_time
        ramped = min(max(desired, self.rate - change), self.rate + change)
        # From this rate, the ramp to zero ends at the end of the path.
        stopping_rate = math.sqrt(2.0 * (self._duration - self.time) / self.ramp_time)
        self.rate = 0.0 if held else min(ramped, max_rate, stopping_rate)

        self.time = min(self.time + self.rate * time_step, self._duration)
        self._path_times = self._path_times.added(self._now + self.period, self.time)
        if self.time - self._progress_time > self._least_progress:
            self.waited, self._progress_time = 0.0, self.time
        return time_step


class PathTracker:
    """
    Feedback controller that tracks one path, with its state.

    :ivar clock: path time.
    :ivar max_position_error: largest position error so far [m].
    :ivar max_angle_error: largest orientation error so far [rad].
    :param path: path of the object.
    :param settings: settings of the tracking.
    :param period: period of the control loop [s].
    """

    @check_kinds
    def __init__(self, path: ObjectPath, settings: TrackingSettings, period: float) -> None:
        self.path, self.settings = path, settings
        check_range(period, 'period', 's', 0.0, MAX_PERIOD, PathError)
        ramp_time, timeout = settings.ramp_time, settings.progress_timeout
        self.clock = PathClock(path.duration, ramp_time, timeout, period)
        self.max_position_error = self.max_angle_error = 0.0
        self._seconds = self._squared_errors = 0.0  # duration, and integral of squared errors

    def allow_for_inertia(self, frequency: float) -> None:
        """
        Lengthen the acceleration and deceleration times, to limit deviations due to inertia.

        The object's deviations from the path then stay within the tolerances.

        :param frequency: lowest natural frequency of the held object [rad/s]; 0 if unknown.
        """
        if frequency > 0.0:
            settings, path = self.settings, self.path
            # On a ramp, with the acceleration speed / ramp_time, the peak deviation is at most
            # `END_SHARE` of the tolerance.
            translation = path.speed / settings.position_tolerance
            rotation = path.turn_rate / settings.angle_tolerance
            factor = PEAK_DEVIATION_FACTOR / (END_SHARE * frequency**2)
            self.clock.ramp_time = max(settings.ramp_time, factor * max(translation, rotation))

    @property
    def rms_position_error(self) -> float:
        """Return the root mean square of the position error so far [m]."""
        return math.sqrt(self._squared_errors / self._seconds) if self._seconds > 0.0 else 0.0

    def update(
        self, measured: Pose, age: float, elapsed: float, scale: float = 1.0, held: bool = False
    ) -> Tracking:
        """
        Advance path time by one cycle, and return the twist of this cycle.

        :param measured: measured pose of the object.
        :param age: age of the pose [s].
        :param elapsed: time since the last cycle [s]; at most two periods of it are counted.
        :param scale: factor by which limits reduced the speed of the last twist, 0 to 1; see
            `speed_share`.
        :param held: whether the robot is stopped.
        :raises PathError: the measured pose is not three finite numbers within range.
        """
        what = 'the measured pose (x, y, angle) [m, rad]'
        finite_array(measured, 3, what, PathError, MAX_MAGNITUDE)
        age, elapsed = max(age, 0.0), max(elapsed, 0.0)
        clock, settings = self.clock, self.settings

        # Pose error at the time of the measurement.
        error = pose_difference(self.path.pose(clock.time_then(elapsed, age)), measured)
        position_error, angle_error = math.hypot(error[0], error[1]), abs(float(error[2]))
        error_share = max(
            position_error / settings.position_tolerance, angle_error / settings.angle_tolerance
        )

        # The rate of path time falls linearly from 1 at `SLOWING_SHARE` to 0 at `STOPPING_SHARE`.
        max_rate = (STOPPING_SHARE - error_share) / (STOPPING_SHARE - SLOWING_SHARE)
        max_rate = min(max(max_rate, 0.0), 1.0)
        previous, was_at_end = self.path.pose(clock.time), clock.at_end
        time_step = clock.advance(elapsed, max_rate, scale, held)

        # Statistics of the errors.
        self.max_position_error = max(self.max_position_error, position_error)
        self.max_angle_error = max(self.max_angle_error, angle_error)
        self._seconds += time_step
        # The operator ** would raise an error for large numbers.
        self._squared_errors += time_step * position_error * position_error

        phase = self._phase(error_share, was_at_end, min(max_rate, scale), held)
        twist, message = np.zeros(3), ''
        if phase in FINISHED:
            where = 'the end of the path' if clock.at_end else 'the path'
            turn = math.degrees(angle_error)
            message = f'{1e3 * position_error:.1f} mm and {turn:.1f}° off {where}'
            if phase is PathPhase.STUCK:
                message = f'no progress for {clock.waited:.3g} s, {message}'
        elif phase is not PathPhase.HELD:
            # Feed-forward of the mean velocity over the cycle, which is exact also at corners and
            # at the end.
            velocity = (self.path.pose(clock.time) - previous) / max(time_step, COINCIDENCE)
            twist = velocity + self._feedback(error, age)
        progress = clock.time / self.path.duration
        return Tracking(
            phase, twist, position_error, angle_error, progress, clock.time_left, message
        )

    def _feedback(self, error: Array, age: float) -> Array:
        """Return the feedback twist (3,) of the pose error, with bounded magnitude."""
        settings, path = self.settings, self.path
        max_gain = MAX_GAIN_DELAY_PRODUCT / (age + self.clock.period)
        twist = error * min(settings.position_gain, max_gain)
        twist[2] = error[2] * min(settings.angle_gain, max_gain)
        speed, turn_rate = math.hypot(twist[0], twist[1]), abs(float(twist[2]))
        twist[:2] *= min(1.0, MAX_FEEDBACK_SHARE * path.speed / max(speed, COINCIDENCE))
        twist[2] *= min(1.0, MAX_FEEDBACK_SHARE * path.turn_rate / max(turn_rate, COINCIDENCE))
        return twist

    def _phase(self, error_share: float, was_at_end: bool, rate: float, held: bool) -> PathPhase:
        """
        Return the phase of path following.

        :param error_share: error divided by its tolerance [-].
        :param was_at_end: whether path time had reached its end when the pose was measured.
        :param rate: rate of path time that the robot's lag and limits admit.
        """
        if error_share > 1.0:
            return PathPhase.OFF_PATH
        # At the end of the path, half of the tolerances applies.
        if was_at_end and not held and error_share <= END_SHARE:
            return PathPhase.REACHED
        if self.clock.waited > self.settings.progress_timeout:
            return PathPhase.OFF_PATH if was_at_end and not held else PathPhase.STUCK
        if held:
            return PathPhase.HELD
        if was_at_end:
            return PathPhase.SETTLING
        return PathPhase.SLOWED if rate < 1.0 else PathPhase.FOLLOWING
