# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Path servo, which decides in each control cycle whether a path is followed, paused or aborted.

A missing, stale or rejected pose ends the path, and so does a manipulation node without valid
feedback for the same timeout. While this node has stopped the robot, path time does not advance
and the twist is zero.
"""

from __future__ import annotations

import enum
import math
from typing import NamedTuple

from isotruss_ros.core.errors import PathError
from isotruss_ros.core.inputs import InputError, InputFault, LatestInputs, require_fresh
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.model.pose import Pose, pose_difference
from isotruss_ros.core.paths.object_path import ObjectPath
from isotruss_ros.core.paths.path_tracking import (
    PathPhase,
    PathTracker,
    speed_share,
    Tracking,
    TrackingSettings,
)


class PathOutcome(enum.IntEnum):
    """Codes for the result of path following, equal to those of isotruss_msgs/FollowObjectPath."""

    REACHED = 0
    CANCELLED = 1
    BAD_GOAL = 2
    OFF_PATH = 3
    STOPPED = 4
    PREEMPTED = 5


class ServoFeedback(NamedTuple):
    """Feedback of the manipulation node on the execution of the last twist."""

    code: int  #: status code, see `Status`
    scale: float  #: factor by which limits reduced the twist, 0 to 1
    message: str  #: sentence with the reason of the status
    frequency: float = 0.0  #: lowest natural frequency of the held object [rad/s]; 0 if unknown


class Step(NamedTuple):
    """Output of the path servo in one control cycle: twist, or result of a path that has ended."""

    tracking: Tracking | None  #: twist and state of the tracking; None after an invalid input
    outcome: PathOutcome | None = None  #: result of path following; None while it is followed
    message: str = ''  #: sentence with the result of path following


#: Result of path following for each final phase.
OUTCOMES = {
    PathPhase.REACHED: PathOutcome.REACHED,
    PathPhase.OFF_PATH: PathOutcome.OFF_PATH,
    PathPhase.STUCK: PathOutcome.STOPPED,
}


class PathServo:
    """Servo that follows one path of the object after another, with its inputs and state."""

    def __init__(self, period: float, timeout: float, inputs: LatestInputs) -> None:
        self.period, self.timeout, self.inputs = period, timeout, inputs
        self.tracker: PathTracker | None = None
        # The stamp of the last valid feedback is at least the start of the path [s].
        self._last_cycle = self._feedback_time = 0.0

    def measured(self, now: float) -> Pose:
        """Return the measured pose of the object."""
        return require_fresh(now, self.timeout, object_pose=self.inputs.pose)[0].value

    def begin(self, path: ObjectPath, settings: TrackingSettings, now: float) -> None:
        """Start a path, which is followed from the next cycle on."""
        self.tracker = None
        measured = self.measured(now)
        error = pose_difference(path.poses[0], measured)
        distance, angle = math.hypot(error[0], error[1]), abs(float(error[2]))
        if distance > settings.position_tolerance or angle > settings.angle_tolerance:
            raise PathError(
                f'the path begins {distance:.4g} m and {angle:.4g} rad from the object, which is '
                f'at ({measured.x:.4g}, {measured.y:.4g}) m, {measured.angle:.4g} rad; must begin '
                f'within {settings.position_tolerance:g} m and {settings.angle_tolerance:g} rad'
            )
        self.tracker = PathTracker(path, settings, self.period)
        self._last_cycle = self._feedback_time = now

    def decide(self, now: float) -> Step:
        """Return the twist of the current cycle, or the result; an invalid input ends the path."""
        elapsed, self._last_cycle = now - self._last_cycle, now
        self.tracker.clock.period = self.period
        try:
            feedback = self._read_feedback(now)
            held = feedback.code >= Status.HALT_NO_TWIST  # the robot is stopped
            self.tracker.allow_for_inertia(feedback.frequency)
            (pose,) = require_fresh(now, self.timeout, object_pose=self.inputs.pose)
            age = now - pose.time
            scale = speed_share(feedback.code, feedback.scale)
            tracking = self.tracker.update(pose.value, age, elapsed, scale, held)
        except (InputError, PathError) as error:
            return Step(None, PathOutcome.STOPPED, str(error))
        if tracking.phase not in OUTCOMES:
            return Step(tracking)
        message = tracking.message
        if feedback.message:
            message = f'{message}; manipulation: {feedback.message}'
        return Step(tracking, OUTCOMES[tracking.phase], message)

    def _read_feedback(self, now: float) -> ServoFeedback:
        """Return the feedback of the manipulation node; in a short gap, that of a halted robot."""
        try:
            (status,) = require_fresh(now, self.timeout, status=self.inputs.servo_feedback)
            feedback: ServoFeedback = status.value
            if not 0.0 <= feedback.scale <= 1.0:
                words = f'status: scale {feedback.scale}: must be from 0 to 1'
                raise InputError(InputFault.INVALID, 'status', words)
        except InputError as error:
            if now - self._feedback_time > self.timeout:
                raise
            return ServoFeedback(Status.HALT_NO_TWIST, 0.0, str(error))
        self._feedback_time = max(self._feedback_time, status.time)
        return feedback
