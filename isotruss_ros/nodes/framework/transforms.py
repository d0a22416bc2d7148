# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Publication of the coordinate frames of object, contacts and modules on `/tf`."""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any, TYPE_CHECKING

from geometry_msgs.msg import TransformStamped
from isotruss_ros.core.holding.held_shape import contact_resultants
from isotruss_ros.nodes.conversions.messages import (
    ALIGNED_OBJECT,
    CONTACT,
    make_header,
    name_frame,
    OBJECT,
)
from isotruss_ros.nodes.framework.topics import EVENTS
import numpy as np

if TYPE_CHECKING:
    from isotruss_ros.core import Configuration, Pose, Robot
    from isotruss_ros.core.holding.held_grip import HeldGrip
    from isotruss_ros.nodes.framework.managed import ManagedNode

try:
    from tf2_msgs.msg import TFMessage
except ModuleNotFoundError:  # part of every ROS installation, without a wheel
    TFMessage = None


class TransformBroadcaster:
    """
    Broadcaster of the frames of object, contacts and modules, relative to the robot frame.

    The object has two frames with the same origin: the object frame is fixed to the object; the
    aligned frame, of wrenches, has axes parallel to the robot frame. The x axis of
    a contact frame is normal to the member and points into the object. A module frame has its
    origin at the joint and its x axis along the connection rod. If `tf2_msgs` is not installed,
    nothing is broadcast and a warning is logged.
    """

    def __init__(self, node: ManagedNode, robot: Robot) -> None:
        self._robot = robot
        self._transforms = None
        parts = (OBJECT, ALIGNED_OBJECT, *robot.module_names)
        self._names = [name_frame(robot.frame, part) for part in parts]
        if TFMessage is None:
            node.get_logger().info(
                f'tf2_msgs is not installed: {self._names[0]} and module frames are not broadcast'
            )
            return
        self._transforms = node.advertise(TFMessage, '/tf', EVENTS)

    def broadcast(
        self,
        config: Configuration,
        pose: Pose,
        contacts: Mapping[str, tuple[complex, complex]],
        time: float,
    ) -> None:
        """
        Publish the transforms from the robot frame to object, contacts and modules.

        :param pose: pose of the object, robot frame.
        :param contacts: contact frame of each member in contact, see `find_contact_frames`.
        :param time: time of the measurements [s].
        """
        if self._transforms is None:
            return
        topology, points = self._robot.topology, config.points
        joints = points[topology.joint]
        rods = 0.5 * (points[topology.b] + points[topology.c]) - joints
        center, turn = complex(pose.x, pose.y), np.exp(1j * pose.angle)
        origins = [center, center, *joints, *(origin for origin, _ in contacts.values())]
        directions = [turn, 1.0, *rods, *(direction for _, direction in contacts.values())]
        frame = self._robot.frame
        names = [*self._names, *(name_frame(frame, name + CONTACT) for name in contacts)]
        header = make_header(time, frame)
        half: Any = 0.5 * np.angle(directions)
        stamped = []
        for name, origin, angle in zip(names, origins, half.tolist(), strict=True):
            message = TransformStamped(header=header, child_frame_id=name)
            move, rotation = message.transform.translation, message.transform.rotation
            move.x, move.y = float(origin.real), float(origin.imag)
            rotation.z, rotation.w = math.sin(angle), math.cos(angle)
            stamped.append(message)
        self._transforms.publish(TFMessage(transforms=stamped))


def find_contact_frames(grip: HeldGrip) -> dict[str, tuple[complex, complex]]:
    """
    Return origin and x axis of the contact frame of each member that holds an object.

    The origin is the centre of pressure, x + iy [m]. The x axis is a unit vector x + iy, normal to
    the member and pointing into the object.
    """
    centers, _ = contact_resultants(grip)
    state = grip.state
    inward = grip.contacts.sum_by_member(-state.normal_forces * state.normals)
    axes = inward / np.abs(inward)
    return dict(
        zip(grip.member_names, zip(centers.tolist(), axes.tolist(), strict=True), strict=True)
    )
