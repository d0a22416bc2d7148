# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
State that a view displays, updated from messages.

Messages are read by the names of their fields, so those of rclpy and those read from a recording
without ROS are treated alike.
"""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field
import enum
import math
from typing import Any

from isotruss_ros.core import Pose, Robot, Status
from isotruss_ros.core.fixed_object.analyze_grasp import NO_CONTACT
from isotruss_ros.core.kinematics.configuration import ConfigurationTracker
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.manipulation.status import GRIP_FAULTS
from isotruss_ros.core.model.convex_object import segment_gaps
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.servo.decision import describe_squeeze
from isotruss_ros.viewer.message_checks import (
    check_pose,
    check_state,
    check_status,
    DEFORMED,
    GROUPS,
    HELD_UNKNOWN,
    MIN_CODE_WITHOUT_RESULT,
    read_line,
    read_pose,
    read_travel,
)
from isotruss_ros.viewer.room import Room
import numpy as np

#: Largest age at which a message counts as current [s].
MESSAGE_TIMEOUT = 1.0
#: Time span of the plots [s].
HISTORY_DURATION = 20.0
#: Largest number of samples in the plots, which suffices for 20 samples per second [-].
MAX_SAMPLES = 400
#: Actions of markers that delete one marker (in older recordings) or all markers.
DELETE, DELETEALL = 2, 3
#: Largest number of stored statuses, enough for some seconds of a control loop [-].
MAX_STATUSES = 2000
#: Status codes of the manipulation while no limit reduces the commanded motion.
UNLIMITED_STATUSES = (Status.OK, Status.IDLE, Status.FOLLOWING_TRAJECTORY, Status.ARRIVED)

#: Next step of a person at the page after a halt that persists.
NEXT_STEPS = {
    Status.HALT_EMERGENCY_STOP: 'stopped: switch control on and press “release the stop”',
    **{code: f'{fault.word}: press “{fault.action}”' for code, fault in GRIP_FAULTS.items()},
    Status.HALT_TRAJECTORY: 'trajectory ended: drag the blue ball',
}

#: Starts and ends of the pieces of a line through points.
PIECES = (slice(None, -1), slice(1, None))
#: Plot without a curve.
EMPTY_CURVE = (np.array([-1.0, 0.0]), np.array([np.nan, np.nan]))


class Hold(enum.Enum):
    """Hold of the object by the robot."""

    HELD = 'held'
    NOT_HELD = 'not held'  #: touched, but not held
    FREE = 'free'  #: without any contact
    UNKNOWN = 'hold unknown'


@dataclass
class Picture:
    """
    State of robot and object that a view displays, from the latest messages.

    Times `now` are on the clock of the messages' arrival [s].

    :ivar config: configuration at the last measured roller positions.
    :ivar room: obstacles and planned path.
    """

    robot: Robot  #: the robot
    diameter: float  #: diameter of the object [m]
    shape: Shape | None = None  #: shape of the object; None: disc with this diameter
    pose: Pose | None = None  #: pose of the object; None before the first pose
    goal: tuple[float, float] | None = None  #: target (x, y) of a drag [m]; None without a drag
    goal_report: str = ''  #: state of the last goal in words; empty before the first goal
    state: Any = None  #: last message grasp/state; None before the first
    status: Any = None  #: last message manipulation/status; None before the first
    #: points (k, 3) [m] for the namespace and id of each marker; they are the points of a line,
    #: the corners of the triangles of a contact region, or the ends of arrows
    lines: dict[tuple[str, int], Array] = field(default_factory=dict)
    #: samples of the plots: time [s], mean normal force of the grasping members [N], and distance
    #: of the object from its goal [m]; NaN if unknown
    samples: deque[tuple[float, float, float]] = field(
        default_factory=lambda: deque(maxlen=MAX_SAMPLES)
    )

    def __post_init__(self) -> None:
        """Set the configuration to home."""
        self.config, self.room = self.robot.home, Room()
        self._tracker = ConfigurationTracker(self.robot.home)
        self._received: dict[str, float] = {}
        #: Statuses of the last seconds, with their times of arrival.
        self._statuses: deque[tuple[float, Any]] = deque(maxlen=MAX_STATUSES)
        #: Travel of each roller, with its time of arrival.
        self._travel: dict[str, tuple[float, float]] = {}

    def is_fresh(self, name: str, now: float) -> bool:
        """Return whether the last message of a topic is at most `MESSAGE_TIMEOUT` old."""
        return now - self._received.get(name, -math.inf) < MESSAGE_TIMEOUT

    def receive_joint_states(self, message: Any, now: float) -> None:
        """Update the configuration from measured roller positions."""
        names = self.robot.roller_names
        travel = read_travel(message, names)
        self._travel |= {name: (value, now) for name, value in travel.items()}
        known = [self._travel.get(name, (0.0, -math.inf)) for name in names]
        if travel and all(now - received < MESSAGE_TIMEOUT for _, received in known):
            self.config = self._tracker.configuration([value for value, _ in known])
            self._received['joint_states'] = now

    def receive_object_pose(self, message: Any, now: float) -> None:
        """
        Update the pose of the object from a message.

        :param message: geometry_msgs/PoseStamped in the robot frame.
        """
        self.take_pose(read_pose(message), now)

    def take_pose(self, pose: Pose, now: float) -> None:
        """
        Update the pose of the object.

        :param pose: pose in the robot frame.
        """
        check_pose(pose)
        self.pose = pose
        self.room.leave_path(pose)
        self._received['object_pose'] = now

    def receive_state(self, message: Any, now: float) -> None:
        """Update the analysis of the grasp."""
        check_state(message, len(self.robot.member_names))
        self.state = message
        self._received['state'] = now

    def receive_status(self, message: Any, now: float) -> None:
        """Update the status of the manipulation node."""
        check_status(message)
        self.status = message
        self._statuses.append((now, message))
        self._received['status'] = now

    def receive_markers(self, message: Any, now: float) -> None:
        """Update the lines of the deformed tubes, the contact regions and the forces."""
        for marker in message.markers:
            key = (marker.ns, marker.id)
            if marker.action == DELETEALL:
                self.lines.clear()
            elif marker.action == DELETE:
                self.lines.pop(key, None)
            elif marker.ns in GROUPS:
                self.lines[key] = read_line(marker)
                if marker.ns == DEFORMED:
                    self._received['markers'] = now

    def receive_cycle(self, message: Any, now: float) -> None:
        """Update the obstacles from the record of a cycle of the manipulation node."""
        self.room.receive_cycle(message, now)

    def receive_path(self, message: Any, now: float) -> None:
        """Update the planned path."""
        self.room.receive_path(message, now)

    def select_lines(self, name: str, now: float) -> list[Array]:
        """Return the points of all markers of a namespace, ordered by id; empty if too old."""
        if not self.is_fresh('markers', now):
            return []
        return [self.lines[key] for key in sorted(self.lines) if key[0] == name]

    def is_analyzed(self, now: float) -> bool:
        """Return whether the last grasp analysis has a result."""
        return self.is_fresh('state', now) and self.state.code < MIN_CODE_WITHOUT_RESULT

    def hold(self, now: float) -> Hold:
        """Return the hold of the object by the last grasp analysis."""
        if not self.is_analyzed(now) or self.state.held == HELD_UNKNOWN:
            return Hold.UNKNOWN
        if self.state.held:
            return Hold.HELD
        return Hold.FREE if self.state.message == NO_CONTACT else Hold.NOT_HELD

    def is_stopped(self, now: float) -> bool:
        """Return whether the manipulation node reports that an emergency stop is set."""
        return self.is_fresh('status', now) and self.status.code == Status.HALT_EMERGENCY_STOP

    def describe_manipulation(self, now: float) -> str:
        """Return a text with the status of the manipulation node."""
        if not self.is_fresh('status', now):
            return 'manipulation: no status'
        is_free = self._is_put_down(now)
        is_idle = self.status.code == Status.HALT_NO_TWIST and self.goal is None
        words = _describe_status(self.status)
        if is_idle:
            words = 'manipulation: at rest, nothing is commanded'
        elif is_free:
            words = 'manipulation: at rest, the object is free'
        at_rest = is_idle or is_free or self.status.code in (Status.IDLE, Status.ARRIVED)
        return words + self._describe_overlap(now) if at_rest else words

    def _describe_overlap(self, now: float) -> str:
        """Return the names of a part of the drawn robot and an obstacle that overlap; or ''."""
        obstacles = [obstacle for obstacle, _ in self.room.list_obstacles(now)]
        if not obstacles:
            return ''
        model = collision_model(self.robot)
        lines, bent = list(model.lines(self.config).points), self.select_lines(DEFORMED, now)
        if len(bent) == len(self.robot.member_names):
            lines[: len(bent)] = [points[:, 0] + 1j * points[:, 1] for points in bent]
        starts, ends = (np.concatenate([line[k] for line in lines]) for k in PIECES)
        parts = np.repeat(np.arange(len(lines)), [len(line) - 1 for line in lines])
        radii, longest = model.part_radii[parts], np.abs(ends - starts).max()
        for obstacle in obstacles:
            body = obstacle.body
            reach = body.shape.reach + radii.max() + longest
            if np.abs(starts - body.center).min() > reach:
                continue
            gaps = segment_gaps(body, starts, ends).gaps - radii
            nearest = int(gaps.argmin())
            if gaps[nearest] < 0.0:
                name = model.part_names()[parts[nearest]]
                return f': {name} and obstacle {obstacle.name} overlap; drag the obstacle away'
        return ''

    def describe_next_step(self, now: float) -> str:
        """Return the next step after a halt that persists; empty without such a halt."""
        if self._is_put_down(now):
            return 'to carry the object: press “pick”'
        return NEXT_STEPS.get(self.status.code, '') if self.is_fresh('status', now) else ''

    def _is_put_down(self, now: float) -> bool:
        """Return whether the manipulation waits for a grip, because the object is free."""
        return (
            self.is_fresh('status', now)
            and self.status.code == Status.HALT_NOT_HELD
            and self.hold(now) is Hold.FREE
        )

    def describe_squeeze(self, now: float) -> str:
        """Return a text with the estimated squeeze; empty without squeeze control."""
        if not self.is_fresh('status', now) or math.isnan(self.status.squeeze):
            return ''
        status = self.status
        return describe_squeeze(status.squeeze, status.squeeze_deviation, status.squeeze_assumed)

    def describe_hindrance(self, now: float, span: float) -> str:
        """
        Return a text with the limit that reduced the motion most often in an interval.

        :param span: length of the interval, which ends now [s].
        """
        lately = [status for time, status in self._statuses if now - time <= span]
        codes = Counter(status.code for status in lately if status.code not in UNLIMITED_STATUSES)
        if not codes:
            return self.describe_manipulation(now)
        (code, _), *_ = codes.most_common(1)
        slowest = min((s for s in lately if s.code == code), key=lambda s: s.scale)
        return _describe_status(slowest)

    def sample(self, now: float) -> None:
        """Add a sample of squeeze and pose error to the plots."""
        squeeze = error = math.nan
        if self.is_analyzed(now) and len(self.state.squeeze):
            squeeze = float(np.mean(self.state.squeeze))
        if self.goal is not None and self.pose is not None:
            error = math.dist(self.goal, self.pose[:2])
        self.samples.append((now, squeeze, error))


def _describe_status(status: Any) -> str:
    code = str(Status(status.code)).replace('_', ' ')
    return ': '.join(filter(None, ('manipulation', code, status.message)))


def trim_start(time: Array, values: Array) -> tuple[Array, Array]:
    """
    Return a curve without the NaN values at its start.

    uPlot does not draw a curve with a leading NaN.

    :param time: (k,) times [s].
    :param values: (k,) values of the curve, NaN if unknown.
    """
    known = np.flatnonzero(np.isfinite(values))
    if not len(known):
        return EMPTY_CURVE
    first = known[0]
    return time[first:], values[first:]
