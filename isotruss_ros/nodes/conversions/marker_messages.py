# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Conversion of measured joint positions from and to `sensor_msgs/MultiDOFJointState`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from geometry_msgs.msg import Transform
from isotruss_ros.core import Robot
from isotruss_ros.core.errors import quote
from isotruss_ros.nodes.conversions.messages import check_place, MessageError
from sensor_msgs.msg import MultiDOFJointState


def read_joint_markers(
    message: MultiDOFJointState, robot: Robot
) -> dict[str, tuple[float, float, float]]:
    """
    Return the measured position (x, y, z) of each joint by name, in the message's frame [m].

    :raises MessageError: the numbers of names and transforms differ, a joint is unknown or
        repeated, or a position is not finite.
    """
    if len(message.joint_names) != len(message.transforms):
        raise MessageError(
            f'joint markers: {len(message.joint_names)} names and {len(message.transforms)} '
            'transforms: must be as many'
        )
    known, found = robot.topology.joint_names, {}
    for name, transform in zip(message.joint_names, message.transforms, strict=True):
        if name not in known or name in found:
            raise MessageError(
                f'joint marker {quote(name)}: must be one of {", ".join(known)}, each once'
            )
        place = transform.translation
        check_place(f'joint marker {name}', place.x, place.y)
        found[name] = place.x, place.y, place.z
    return found


def to_joint_markers(joints: Mapping[str, Sequence[float]]) -> MultiDOFJointState:
    """
    Return the message of measured joint positions; its header is empty.

    :param joints: position (x, y) of each joint by name [m].
    """
    message = MultiDOFJointState(joint_names=list(joints))
    for x, y in joints.values():
        transform = Transform()
        transform.translation.x, transform.translation.y = float(x), float(y)
        message.transforms.append(transform)
    return message
