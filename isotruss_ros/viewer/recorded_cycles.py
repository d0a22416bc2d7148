# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cycles of the node `manipulation` in a recording, without ROS."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
import math
from pathlib import Path
from typing import Any

from isotruss_ros.core import ConvexObject, Disc, Grip, Robot, Status
from isotruss_ros.core.errors import quote
from isotruss_ros.core.inputs import MAX_TIMEOUT, RollerState, StampedInput
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.recording.recorded_cycle import read_cycle, RecordedCycle
from isotruss_ros.core.recording.repeated_run import read_robot
from isotruss_ros.core.servo.servo_settings import ServoSettings
from isotruss_ros.viewer.recording import BrokenRecordingError, read_recording, RecordingError
import numpy as np

RECORDS = {'manipulation/cycle': 'std_msgs/msg/String'}
#: Topics from which the cycles of an older recording are read.
OLDER = {
    'joint_states': 'sensor_msgs/msg/JointState',
    'object_pose': 'geometry_msgs/msg/PoseStamped',
    'manipulation/status': 'isotruss_msgs/msg/ManipulationStatus',
}
#: What a recording without `manipulation/cycle` lacks; the defaults of the node are used.
ABSENT = (
    'settings',
    'cycles before the first status',
    'times of the cycles between the statuses',
    'roller velocities',
    'inputs.estimate',
    'inputs.pressures',
    'inputs.failed',
    'inputs.halt',
    'calls',
    'versions',
    'robot',
)
#: Period of the cycles that the node has by default [s].
PERIOD = 0.01
#: Number of last messages among which the inputs of a cycle are.
MAX_RECEIVED = 50


def read_cycles(path: str | Path) -> Iterator[RecordedCycle]:
    """Yield each recorded cycle; raise `BrokenRecordingError` at the end of a damaged file."""
    for _, _, message in read_recording(path, RECORDS):
        yield read_cycle(message.data)


def find_cycles(path: str | Path, robot: Robot, diameter: float) -> Iterator[RecordedCycle]:
    """
    Yield each cycle of a recording, with or without records of cycles.

    :param robot: robot of recordings without robot file.
    :param diameter: diameter of the disc of recordings without settings [m].
    """
    return read_cycles(path) if has_cycles(path) else read_older_cycles(path, robot, diameter)


def read_told_squeeze(path: str | Path) -> np.ndarray | None:
    """Return the times [s], squeezes and deviations [N] of the statuses, (k, 3), if recorded."""
    kind = OLDER['manipulation/status']
    rows = []
    try:
        for _, _, message in read_recording(path, {'manipulation/status': kind}):
            stamp = message.header.stamp
            squeeze = getattr(message, 'squeeze', math.nan)
            deviation = getattr(message, 'squeeze_deviation', math.nan)
            rows.append((stamp.sec + 1e-9 * stamp.nanosec, squeeze, deviation))
    except RecordingError:  # without statuses, or damaged behind those that were read
        pass
    table = np.array(rows).reshape(-1, 3)
    known = table[np.isfinite(table).all(axis=1)]
    return known if len(known) else None


def has_cycles(path: str | Path) -> bool:
    """Return whether a file contains records of cycles."""
    try:
        next(read_recording(path, RECORDS))
    except BrokenRecordingError:
        return True
    except RecordingError:
        return False
    return True


def read_setup(path: str | Path) -> tuple[Robot | None, Shape | None]:
    """Return robot and shape of the object of the first recorded cycle, if they are recorded."""
    try:
        first = next(read_cycles(path))
    except RecordingError:  # without cycles, or damaged before the first one
        return None, None
    return read_robot(first), first.settings.grip.body.shape


def read_older_cycles(path: str | Path, robot: Robot, diameter: float) -> Iterator[RecordedCycle]:
    """
    Yield a cycle for each status of a recording without records of cycles.

    Its inputs are the last messages before the status, and the twist that the status repeats.

    :param diameter: diameter of the held disc [m].
    """
    grip = Grip(members_at(robot, robot.module_names[-1]), ConvexObject(Disc(diameter)))
    settings = ServoSettings(grip, PERIOD, MAX_TIMEOUT)
    received: deque[tuple[str, StampedInput]] = deque(maxlen=MAX_RECEIVED)
    number = 0
    for _, topic, message in read_recording(path, OLDER):
        stamp = message.header.stamp
        now = float(stamp.sec + 1e-9 * stamp.nanosec)
        try:
            if topic.endswith('joint_states'):
                received.append(('rollers', StampedInput(_read_rollers(message, robot), now)))
            elif topic.endswith('object_pose'):
                received.append(('pose', StampedInput(_read_pose(message.pose), now)))
            else:
                decision = _read_status(message)
                # Messages behind the cycle may be recorded before its status.
                inputs: dict[str, Any] = {n: one for n, one in received if one.time <= now}
                if decision['status'] < Status.HALT_NO_TWIST:
                    inputs['twist'] = StampedInput(_read_twist(message.commanded), now)
                yield RecordedCycle(number, now, settings, inputs, decision, absent=ABSENT)
                number += 1
        except (AttributeError, KeyError, IndexError, TypeError, ValueError) as error:
            raise RecordingError(f'{topic}: {quote(str(error))}: not of known form') from error


def _read_rollers(message: Any, robot: Robot) -> RollerState:
    speeds = message.velocity if len(message.velocity) else np.zeros(len(message.name))
    places = [list(message.name).index(name) for name in robot.roller_names]
    return RollerState(np.array(message.position)[places], np.array(speeds)[places])


def _read_pose(pose: Any) -> Pose:
    q = pose.orientation
    angle = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y**2 + q.z**2))
    return Pose(float(pose.position.x), float(pose.position.y), angle)


def _read_twist(twist: Any) -> np.ndarray:
    return np.array([twist.linear.x, twist.linear.y, twist.angular.z])


def _read_status(message: Any) -> Mapping[str, Any]:
    return {
        'status': Status(message.code),
        'message': message.message,
        'achieved': _read_twist(message.achieved),
    }
