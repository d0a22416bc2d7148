# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Memory of the twist servo."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
import math
from typing import NamedTuple

from isotruss_ros.core.inputs import CommandHistory, InputError, InputFault, StampedInput, Timeline
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.limits import default_limits, Limit
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.records import replace
from isotruss_ros.core.safety.roller_failure import FailureDetector
from isotruss_ros.core.safety.shape_guard import ShapeGuard
from isotruss_ros.core.servo.obstacle_evasion import ObstacleTracks
from isotruss_ros.core.servo.servo_settings import ServoSettings
from isotruss_ros.core.servo.squeeze_control import SqueezeControl
import numpy as np

# Detection of a tracker that repeats its last pose with new stamps while the object moves.

#: Largest commanded motion of the object at which its measured pose may stay the same to the last
#: bit, with rotations times the characteristic radius [m]. At rest, poses without noise are equal.
MAX_REPEATED_MOTION = 0.005
#: Largest measured travel of a roller in this time at which rollers may have failed instead [m].
MAX_STUCK_TRAVEL = 0.001


@dataclass(frozen=True, eq=False)
class RepeatedPose:
    """
    Time and commanded motion since the measured pose changed.

    :ivar value: measured pose of the last cycle; empty before the first one.
    :ivar first: stamp of the pose from which the time counts [s].
    :ivar last: stamp of the last equal pose [s].
    :ivar cycle: time of the last cycle [s].
    :ivar motion: (3,) commanded motion of the object since the first equal pose [m, rad].
    :ivar positions: (r,) measured roller positions of the first equal pose [m].
    """

    value: tuple[float, ...] = ()
    first: float = math.nan
    last: float = math.nan
    cycle: float = math.nan
    motion: Array = field(default_factory=partial(np.zeros, 3))
    positions: Array = field(default_factory=partial(np.zeros, 0))

    def updated(
        self,
        pose: StampedInput,
        positions: Array,
        velocity: Array,
        now: float,
        timeout: float,
    ) -> RepeatedPose:
        """
        Return the record with a measured pose, from which the object is at rest.

        The time counts from the first pose after the rollers have moved: at rest, poses without
        noise are equal however long. After a pause without commands, all counts anew.

        :param positions: (r,) measured roller positions [m].
        :param velocity: (3,) velocity of the object since the last cycle [m/s, rad/s].
        """
        elapsed, value = now - self.cycle, tuple(pose.value)
        if value == self.value and 0.0 <= elapsed <= timeout:
            motion = self.motion + elapsed * velocity
            travel = np.abs(positions - self.positions).max(initial=0.0)
            first = pose.time if travel <= MAX_STUCK_TRAVEL else self.first
            return RepeatedPose(value, first, pose.time, now, motion, self.positions)
        return RepeatedPose(value, pose.time, pose.time, now, positions=np.array(positions))

    def check(self, timeout: float, arm: float) -> None:
        """
        Raise InputError if the pose is older than the timeout [s] although its stamp is not.

        :param arm: characteristic radius of the object [m].
        """
        age, distance = self.last - self.first, math.hypot(*(self.motion * (1.0, 1.0, arm)))
        if age > timeout and distance > MAX_REPEATED_MOTION:
            change = f'while the rollers moved the object by {1e3 * distance:.0f} mm'
            message = f'object pose: equal to the last bit for {age:.3f} s {change}'
            remedy = 'the tracker must send new poses, or the object has left the grip'
            raise InputError(InputFault.STALE, 'object_pose', f'{message}: {remedy}')


# Memory of a servo from cycle to cycle, and setup of all cycles.


class ServoSetup(NamedTuple):
    """Setup of all cycles until the settings change."""

    robot: Robot  #: the robot
    settings: ServoSettings  #: settings of the servo
    limits: tuple[Limit, ...]  #: limits of the robot file and of the user
    guard: ShapeGuard | None  #: barriers; None without bounds

    @classmethod
    def of(cls, robot: Robot, settings: ServoSettings) -> ServoSetup:
        """Return the setup of a robot with settings."""
        limits = (*default_limits(robot), *settings.limits)
        guard = None
        if settings.bounds is not None:
            guard = ShapeGuard(robot, settings.bounds, settings.barriers, settings.obstacles)
        return cls(robot, settings, limits, guard)


@dataclass(frozen=True, eq=False)
class ServoMemory:
    """
    Memory of the servo from cycle to cycle; no part of it is written into.

    :ivar config: configuration at the last measured roller travel.
    :ivar history: commands sent.
    :ivar detector: detector of failed rollers.
    :ivar detected_at: time of the roller state that it compared last [s].
    :ivar velocity: (3,) velocity of the object by the last command [m/s, rad/s].
    :ivar repeated_pose: time and motion since the measured pose changed.
    :ivar poses: last pose up to the time of the rollers, and the later ones.
    :ivar squeeze: squeeze control with the tracked grip; None if the opening angle is constant.
    :ivar followed_at: time of the last cycle that followed the grip [s]; None before the first.
    :ivar obstacles: last poses of the moving obstacles.
    """

    config: Configuration
    history: CommandHistory
    detector: FailureDetector
    detected_at: float = math.nan
    velocity: Array = field(default_factory=partial(np.zeros, 3))
    repeated_pose: RepeatedPose = field(default_factory=RepeatedPose)
    poses: Timeline = field(default_factory=Timeline)
    squeeze: SqueezeControl | None = None
    followed_at: float | None = None
    obstacles: ObstacleTracks = field(default_factory=ObstacleTracks)

    @classmethod
    def of(cls, robot: Robot, settings: ServoSettings) -> ServoMemory:
        """Return the memory before the first cycle."""
        detector = FailureDetector.of(robot.roller_names, settings.failure_time)
        squeeze = None if settings.squeeze is None else SqueezeControl()
        history = CommandHistory(len(robot.roller_names))
        return cls(robot.home, history, detector, squeeze=squeeze)

    def adapted(self, settings: ServoSettings, is_new_motion: bool) -> ServoMemory:
        """
        Return the memory for new settings; the squeeze control goes on unless it has a fault.

        :param is_new_motion: whether twists move another joint or object than before.
        """
        squeeze = self.squeeze
        if squeeze is not None and is_new_motion:
            squeeze = squeeze.acknowledged()
        if settings.squeeze is None:
            squeeze = None
        elif squeeze is None or squeeze.fault is not None:
            squeeze = SqueezeControl()
        detector = replace(self.detector, failure_time=settings.failure_time)
        return replace(self, detector=detector, squeeze=squeeze)
