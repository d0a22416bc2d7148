# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Estimates of the robot's state to messages, and from them."""

from __future__ import annotations

from geometry_msgs.msg import Point
from isotruss_msgs.msg import StateEstimate as StateEstimateMessage
from isotruss_ros.core import Pose, Robot
from isotruss_ros.core.control.state_estimate import EstimatedTravel, StateEstimate
from isotruss_ros.nodes.conversions.messages import (
    check_frame,
    make_header,
    MessageError,
    to_pose_message,
)
import numpy as np

#: Places of x, y and the turn in the covariance (6, 6) of a pose.
PLANAR = np.ix_([0, 1, 5], [0, 1, 5])  # type: ignore[var-annotated]
#: Zeros are not farther off than this [m].
MAX_OFFSET = 1.0


def to_estimate_message(estimate: StateEstimate, robot: Robot) -> StateEstimateMessage:
    """
    Return the message of an estimate.

    :param estimate: of the state.
    :param robot: whose state it is.
    """
    message = StateEstimateMessage(
        roller_names=list(robot.roller_names),
        travel=estimate.travel.tolist(),
        offsets=estimate.offsets.tolist(),
        offset_covariance=estimate.offset_covariance.ravel().tolist(),
        joint_names=list(robot.topology.joint_names),
        joints=[Point(x=x, y=y) for x, y in estimate.joints.tolist()],
        joint_deviations=np.sqrt(np.diag(estimate.joint_covariance)).tolist(),
        used_joints=estimate.used,
        left_out_joints=estimate.left_out,
        slipping_rollers=estimate.slipping,
    )
    if estimate.pose is not None:
        message.held = True
        message.pose.pose = to_pose_message(Pose(*estimate.pose.tolist()))
        covariance = np.zeros((6, 6))
        covariance[PLANAR] = estimate.pose_covariance
        message.pose.covariance = covariance.ravel()
        message.squeeze = estimate.squeeze
        message.squeeze_deviation = estimate.squeeze_deviation
    message.header = make_header(estimate.time, robot.frame)
    return message


def read_estimate(message: StateEstimateMessage, robot: Robot) -> EstimatedTravel:
    """
    Return what a loop takes from an estimate.

    :param message: of the topic `state_estimate`.
    :param robot: whose state it is.
    :raises MessageError: another frame or other rollers, or offsets that are not finite.
    """
    check_frame('state estimate', message.header, robot.frame)
    names, offsets = tuple(message.roller_names), np.array(message.offsets)
    if names != robot.roller_names or len(offsets) != len(names):
        raise MessageError(
            f'state estimate of rollers {", ".join(names)}: must be those of robot {robot.name}'
        )
    if not (np.abs(offsets) <= MAX_OFFSET).all():
        raise MessageError(
            f'state estimate with offsets {offsets.tolist()} m: must be finite, at most '
            f'{MAX_OFFSET:g} m'
        )
    if not message.held:
        return EstimatedTravel(offsets)
    return EstimatedTravel(offsets, message.squeeze, message.squeeze_deviation)
