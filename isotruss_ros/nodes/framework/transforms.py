# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where the object and the modules are, as transforms on `/tf`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from geometry_msgs.msg import TransformStamped
from isotruss_ros.nodes.conversions.messages import make_header, name_object_frame
from isotruss_ros.nodes.framework.topics import EVENTS
import numpy as np

if TYPE_CHECKING:
    from isotruss_ros.core import Configuration, Robot
    from isotruss_ros.nodes.framework.managed import ManagedNode

try:
    from tf2_msgs.msg import TFMessage
except ModuleNotFoundError:  # every ROS installation has it, but there are no wheels of it
    TFMessage = None


class TransformBroadcaster:
    """
    Broadcasts the frames of the object and of the modules, relative to the robot's frame.

    That of the object, which wrenches are about, has its origin at the object's centre and axes
    parallel to those of the robot's frame. That of a module has its origin at the joint, and its
    x axis along the connection rod. Without `tf2_msgs` nothing is broadcast, which the log states.

    :param node: publishes.
    :param robot: the robot.
    """

    def __init__(self, node: ManagedNode, robot: Robot) -> None:
        self._robot = robot
        self._transforms = None
        modules = (f'{robot.frame}_{name.replace("/", "_")}' for name in robot.module_names)
        names = (name_object_frame(robot.frame), *modules)
        if TFMessage is None:
            node.get_logger().info(
                f'tf2_msgs is not installed: {names[0]} and the modules are not on /tf'
            )
            return
        self._transforms = node.create_lifecycle_publisher(TFMessage, '/tf', EVENTS)
        self._message = TFMessage(
            transforms=[TransformStamped(child_frame_id=name) for name in names]
        )

    def broadcast(self, config: Configuration, center: tuple[float, float], time: float) -> None:
        """
        Publish the transforms from the robot's frame.

        :param config: measured configuration of the robot.
        :param center: of the object, robot frame [m].
        :param time: when both were measured.
        """
        if self._transforms is None:
            return
        topology, points = self._robot.topology, config.points
        joints = points[topology.joint]
        half = 0.5 * np.angle(0.5 * (points[topology.b] + points[topology.c]) - joints)
        origins = np.append(complex(*center), joints)
        poses = np.stack(
            [
                origins.real,
                origins.imag,
                np.sin(np.append(0.0, half)),
                np.cos(np.append(0.0, half)),
            ],
            axis=1,
        )
        header = make_header(time, self._robot.frame)
        for stamped, (x, y, z, w) in zip(self._message.transforms, poses.tolist(), strict=True):
            stamped.header = header
            stamped.transform.translation.x, stamped.transform.translation.y = x, y
            stamped.transform.rotation.z, stamped.transform.rotation.w = z, w
        self._transforms.publish(self._message)
