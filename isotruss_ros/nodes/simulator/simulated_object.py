# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Object of the node `simulator`: shape, initial pose and grip."""

from __future__ import annotations

from dataclasses import replace

from isotruss_ros.core import ConvexObject, Disc, place_between, Pose, Robot, tangent_center
from isotruss_ros.nodes.framework import common_parameters as common
from isotruss_ros.nodes.framework.parameters import FixedSpec, ParameterError, Parameters

# The simulated object is grasped permanently, or free at the start.
SPECS = (
    replace(common.OBJECT_DIAMETER, read_only=True),
    common.OBJECT,
    replace(common.GRIP_MODULE, read_only=True),
    replace(common.GRIP, read_only=True),
    FixedSpec(
        'indentation',
        0.0,
        'Indentation of the tubes by the object at home, 0 for contact without force [m]',
        (0.0, 0.1),
    ),
    FixedSpec(
        'object_is_free',
        False,
        'The object is free at object_pose until friction closes a grasp; grasped if false',
    ),
    FixedSpec(
        'object_pose',
        [0.6, 0.3, 0.0],
        'Pose (x, y, angle) of the free object; a grasped object has its angle [m, rad]',
    ),
    replace(common.FRICTION, read_only=True),
    FixedSpec(
        'ground_friction',
        0.0,
        'Friction force of the object on the ground along x or y, mujoco only [N]',
        (0.0, 1e3),
    ),
)


def place_at_start(robot: Robot, values: Parameters) -> ConvexObject:
    """
    Return the object at its initial pose in the robot frame, which is equal for all plants.

    :raises IsotrussError: a parameter is invalid, or the object does not fit.
    """
    if len(values.object_pose) != 3:
        raise ParameterError(
            f'parameter object_pose: {list(values.object_pose)}: must be three numbers'
        )
    place, indentation = Pose(*values.object_pose), values.indentation
    described = common.read_described(values)
    body = described or ConvexObject(Disc(values.object_diameter), friction=values.friction)
    if values.object_is_free:
        return body.moved_to(place)
    if described or common.named_members(values.grip):
        members = common.select_grip(robot, values)
        pose = place_between(robot.home, members, body.shape, place.angle, indentation).body.pose
        return body.moved_to(pose)
    module = values.grip_module or robot.module_names[-1]
    center = tangent_center(robot.home, module, values.object_diameter, indentation)
    return body.moved_to(Pose(*center, place.angle))
