# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What the view shows, kept from messages.

Messages are read by their fields, so that those of rclpy and those that are read from a recording
without ROS serve alike.
"""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field
import math
from typing import Any

from isotruss_ros.core import Pose, Robot, Status
from isotruss_ros.core.kinematics.configuration import ConfigurationTracker
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.viewer.message_checks import (
    check_pose,
    check_state,
    check_status,
    DEFORMED,
    GROUPS,
    NO_RESULT,
    read_line,
    read_pose,
    read_travel,
)
import numpy as np

#: What is older than this is not shown as if it were present [s].
TIMEOUT = 1.0
#: So much of the past is plotted [s].
HISTORY = 20.0
#: Samples that are kept of it, for 20 Hz.
SAMPLES = 400
#: Actions of markers that delete one, as in older recordings, or all.
DELETE, DELETEALL = 2, 3
#: Statuses that are kept: of some seconds at the rates of a control loop.
STATUSES = 2000
#: Codes of a motion that nothing holds back.
UNHINDERED = (Status.OK, Status.IDLE, Status.FOLLOWING_TRAJECTORY, Status.ARRIVED)

#: A plot without a curve.
NOTHING = (np.array([-1.0, 0.0]), np.array([np.nan, np.nan]))


@dataclass
class Picture:
    """
    The latest messages, as the view needs them.

    :ivar config: its configuration by the last joint states.
    :ivar pose: of the object; None before the first message.
    :ivar goal: (x, y) to which the object is dragged [m]; None without one.
    :ivar lines: points (k, 3) [m] of the markers by namespace and id: of lines, of the triangles
        of regions, the two ends of arrows.
    :ivar samples: points of the plots: time [s], mean normal force of the grasping members [N],
        distance of the object from its goal [m]; NaN where these are not known.
    """

    robot: Robot  #: the robot
    diameter: float  #: of the object [m]
    shape: Shape | None = None  #: of an object that is no disc of that diameter; None for that
    pose: Pose | None = None
    goal: tuple[float, float] | None = None
    goal_report: str = ''  #: what becomes of the last goal, in words; empty before the first
    state: Any = None  #: last grasp/state; None before the first
    status: Any = None  #: last manipulation/status; None before the first
    lines: dict[tuple[str, int], Array] = field(default_factory=dict)
    samples: deque[tuple[float, float, float]] = field(
        default_factory=lambda: deque(maxlen=SAMPLES)
    )

    def __post_init__(self) -> None:
        """Begin at home."""
        self.config = self.robot.home
        self._tracker = ConfigurationTracker(self.robot.home)
        self._received: dict[str, float] = {}
        #: Of the last seconds, with the times of their arrival.
        self._statuses: deque[tuple[float, Any]] = deque(maxlen=STATUSES)
        #: Travel of each roller, and when it was received.
        self._travel: dict[str, tuple[float, float]] = {}

    def is_fresh(self, name: str, now: float) -> bool:
        """
        Return whether a message was received lately.

        :param name: `joint_states`, `object_pose`, `state`, `status` or `markers`.
        :param now: on the clock of the `receive` functions [s].
        """
        return now - self._received.get(name, -math.inf) < TIMEOUT

    def receive_joint_states(self, message: Any, now: float) -> None:
        """
        Find the configuration of the measured roller positions.

        :param message: sensor_msgs/JointState of some or all rollers, or of other joints.
        :param now: time of arrival [s].
        :raises PictureError: the message cannot be used.
        :raises ConfigurationError: no configuration of the robot fits.
        """
        names = self.robot.roller_names
        travel = read_travel(message, names)
        self._travel |= {name: (value, now) for name, value in travel.items()}
        known = [self._travel.get(name, (0.0, -math.inf)) for name in names]
        if travel and all(now - received < TIMEOUT for _, received in known):
            self.config = self._tracker.configuration([value for value, _ in known])
            self._received['joint_states'] = now

    def receive_object_pose(self, message: Any, now: float) -> None:
        """
        Keep the pose of the object.

        :param message: geometry_msgs/PoseStamped in the robot's frame.
        :param now: time of arrival [s].
        :raises PictureError: the message has no pose.
        """
        self.take_pose(read_pose(message), now)

    def take_pose(self, pose: Pose, now: float) -> None:
        """
        Keep the pose of the object.

        :param pose: in the robot's frame.
        :param now: time of arrival [s].
        :raises PictureError: it is none.
        """
        check_pose(pose)
        self.pose = pose
        self._received['object_pose'] = now

    def receive_state(self, message: Any, now: float) -> None:
        """
        Keep the analysis of the grasp.

        :param message: isotruss_msgs/GraspState.
        :param now: time of arrival [s].
        :raises PictureError: the message cannot be used.
        """
        check_state(message, len(self.robot.member_names))
        self.state = message
        self._received['state'] = now

    def receive_status(self, message: Any, now: float) -> None:
        """
        Keep the status of the manipulation.

        :param message: isotruss_msgs/ManipulationStatus.
        :param now: time of arrival [s].
        :raises PictureError: the message cannot be used.
        """
        check_status(message)
        self.status = message
        self._statuses.append((now, message))
        self._received['status'] = now

    def receive_markers(self, message: Any, now: float) -> None:
        """
        Keep the lines of the bent tubes, the contact regions and the forces.

        :param message: visualization_msgs/MarkerArray of grasp_analysis.
        :param now: time of arrival [s].
        :raises PictureError: a marker cannot be used; those before it are kept.
        """
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

    def select_lines(self, name: str, now: float) -> list[Array]:
        """
        Return the lines of a namespace in the order of their ids, none that are out of date.

        :param name: namespace of the markers.
        :param now: as above [s].
        """
        if not self.is_fresh('markers', now):
            return []
        return [self.lines[key] for key in sorted(self.lines) if key[0] == name]

    def is_held(self, now: float) -> bool | None:
        """
        Return whether the object is held; None if that is unknown.

        :param now: as above [s].
        """
        if not self.is_fresh('state', now) or self.state.code >= NO_RESULT:
            return None
        return bool(self.state.held)

    def is_stopped(self, now: float) -> bool:
        """
        Return whether the manipulation says that an emergency stop is latched.

        :param now: as above [s].
        """
        return self.is_fresh('status', now) and self.status.code == Status.HALT_EMERGENCY_STOP

    def describe_manipulation(self, now: float) -> str:
        """
        Return the status of the manipulation in words.

        :param now: as above [s].
        """
        if not self.is_fresh('status', now):
            return 'no manipulation'
        if self.status.code == Status.HALT_NO_TWIST and self.goal is None:
            return 'manipulation: at rest, nothing is commanded'
        return _describe_status(self.status)

    def describe_squeeze(self, now: float) -> str:
        """
        Return the estimated squeeze in words; empty where none is regulated.

        :param now: as above [s].
        """
        if not self.is_fresh('status', now) or math.isnan(self.status.squeeze):
            return ''
        deviation = self.status.squeeze_deviation
        sure = 'deviation not known' if math.isinf(deviation) else f'deviation {deviation:.1f} N'
        return f'squeeze {self.status.squeeze:.1f} N, {sure}'

    def describe_hindrance(self, now: float, span: float) -> str:
        """
        Return what held the manipulation back most of a time, in words.

        :param now: as above [s].
        :param span: the time, up to now [s].
        """
        lately = [status for time, status in self._statuses if now - time <= span]
        codes = Counter(status.code for status in lately if status.code not in UNHINDERED)
        if not codes:
            return self.describe_manipulation(now)
        (code, _), *_ = codes.most_common(1)
        slowest = min((s for s in lately if s.code == code), key=lambda s: s.scale)
        return _describe_status(slowest)

    def sample(self, now: float) -> None:
        """
        Add a point to the plots.

        :param now: as above [s].
        """
        squeeze = error = math.nan
        if self.is_held(now) is not None and len(self.state.squeeze):
            squeeze = float(np.mean(self.state.squeeze))
        if self.goal is not None and self.pose is not None:
            error = math.dist(self.goal, self.pose[:2])
        self.samples.append((now, squeeze, error))


def _describe_status(status: Any) -> str:
    code = str(Status(status.code)).replace('_', ' ')
    return ': '.join(filter(None, ('manipulation', code, status.message)))


def trim_start(time: Array, values: Array) -> tuple[Array, Array]:
    """
    Return a curve from its first finite value on; uPlot draws none that begins with NaN.

    :param time: (k,) [s].
    :param values: (k,) of the curve, NaN where there is none.
    """
    known = np.flatnonzero(np.isfinite(values))
    if not len(known):
        return NOTHING
    first = known[0]
    return time[first:], values[first:]
