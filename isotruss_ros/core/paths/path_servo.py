# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Path servo: in every cycle, follow the path, wait, or abort, by the inputs and their ages.

An unusable input stops the object: a pose that is missing, too old or rejected ends the path, and
while the manipulation is stopped, or timed out, path time stands still and the twist is zero.
"""

from __future__ import annotations

import enum
import math
from typing import NamedTuple

from isotruss_ros.core.errors import PathError
from isotruss_ros.core.inputs import Input, InputError, require_fresh
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.model.pose import Pose, pose_difference
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.paths.object_path import ObjectPath
from isotruss_ros.core.paths.path_tracking import (
    FINISHED,
    PathPhase,
    PathTracker,
    Tracking,
    TrackingSettings,
)
import numpy as np


class Outcome(enum.IntEnum):
    """How following a path ended, the same as in isotruss_msgs/FollowObjectPath."""

    REACHED = 0
    CANCELLED = 1
    BAD_GOAL = 2
    OFF_PATH = 3
    STOPPED = 4
    PREEMPTED = 5


class ServoFeedback(NamedTuple):
    """
    How the manipulation carried out the last twist.

    :ivar code: number of the `Status`.
    :ivar scale: part of the twist that was carried out, 0 to 1.
    :ivar message: the reason in words.
    :ivar frequency: lowest natural frequency of the held object; 0 if not known [rad/s].
    """

    code: int
    scale: float
    message: str
    frequency: float = 0.0


class Step(NamedTuple):
    """
    What to do in this cycle.

    :ivar twist: (3,) of the object, robot frame [m/s, rad/s].
    :ivar outcome: how it ended, None while it goes on.
    :ivar message: in words, once it ended.
    :ivar tracking: how it goes; None where that is not known.
    """

    twist: Array
    outcome: Outcome | None
    message: str
    tracking: Tracking | None


#: The outcome for each phase that ends the path.
OUTCOMES = {
    PathPhase.REACHED: Outcome.REACHED,
    PathPhase.OFF_PATH: Outcome.OFF_PATH,
    PathPhase.STUCK: Outcome.STOPPED,
}


class PathServo:
    """
    State of following a path: its settings and the latest input of each kind.

    :ivar pose: input of the measured `Pose` of the object, robot frame.
    :ivar servo_feedback: input of the `ServoFeedback` of the manipulation.
    :ivar rollers: input of the measured `RollerState`, by which paths are foreseen.
    :ivar held_grip: likewise, input of the `GripRecord` of the loop that holds the object.
    :ivar estimate: input of the `EstimatedTravel` whose offsets the rollers have; None without.
    :ivar tracker: of the present path, or of the last one; None before the first.
    :param period: time from cycle to cycle [s].
    :param timeout: inputs older than this are not relied on [s].
    """

    def __init__(self, period: float, timeout: float) -> None:
        self.period = period
        self.timeout = timeout
        self.pose: Input = None
        self.servo_feedback: Input = None
        self.rollers: Input = None
        self.held_grip: Input = None
        self.estimate: Input = None
        self.tracker: PathTracker | None = None
        self._before = 0.0

    def measured(self, now: float) -> Pose:
        """
        Return where the object is.

        :param now: time on the clock of the inputs [s].
        :raises InputError: its pose is missing, stale or invalid.
        """
        return require_fresh(now, self.timeout, object_pose=self.pose)[0].value

    def begin(self, path: ObjectPath, settings: TrackingSettings, now: float) -> None:
        """
        Take a path; the next cycle is its first.

        :param path: of the object.
        :param settings: of the tracking.
        :param now: time on the clock of the inputs [s].
        :raises PathError: it does not begin where the object is.
        :raises InputError: there is no usable pose of the object.
        """
        self.tracker = None
        measured = self.measured(now)
        error = pose_difference(path.poses[0], measured)
        away, turned = math.hypot(error[0], error[1]), abs(float(error[2]))
        if away > settings.position_tolerance or turned > settings.angle_tolerance:
            raise PathError(
                f'the path begins {away:.4g} m and {turned:.4g} rad from the object, which is at '
                f'({measured.x:.4g}, {measured.y:.4g}) m, {measured.angle:.4g} rad; must begin '
                f'within {settings.position_tolerance:g} m and {settings.angle_tolerance:g} rad'
            )
        self.tracker = PathTracker(path, settings, self.period)
        self._before = now

    def decide(self, now: float) -> Step:
        """
        Return what to do in the cycle that begins now; never raises for an input.

        :param now: time on the clock of the inputs [s].
        """
        elapsed, self._before = now - self._before, now
        self.tracker.clock.period = self.period
        feedback = self._last_feedback(now)
        held = feedback.code >= Status.HALT_NO_TWIST
        self.tracker.allow_for_inertia(feedback.frequency)
        try:
            (pose,) = require_fresh(now, self.timeout, object_pose=self.pose)
            age = now - pose.time
            tracking = self.tracker.update(pose.value, age, elapsed, feedback.scale, held)
        except (InputError, PathError) as error:
            return Step(np.zeros(3), Outcome.STOPPED, str(error), None)
        if tracking.phase not in FINISHED:
            return Step(tracking.twist, None, '', tracking)
        outcome, message = OUTCOMES[tracking.phase], tracking.message
        if feedback.message:
            message = f'{message}; manipulation: {feedback.message}'
        return Step(tracking.twist, outcome, message, tracking)

    def _last_feedback(self, now: float) -> ServoFeedback:
        """Return how the manipulation carried out the last twist; a halt if that is not known."""
        try:
            (given,) = require_fresh(now, self.timeout, status=self.servo_feedback)
        except InputError as error:
            return ServoFeedback(Status.HALT_NO_TWIST, 0.0, str(error))
        feedback: ServoFeedback = given.value
        if 0.0 <= feedback.scale <= 1.0:
            return feedback
        words = f'status: scale {feedback.scale}: must be from 0 to 1'
        return ServoFeedback(Status.HALT_NO_TWIST, 0.0, words)
