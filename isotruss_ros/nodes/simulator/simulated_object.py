# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Object of the node `simulator`: shape, initial pose and grip."""

from __future__ import annotations

from dataclasses import replace

from isotruss_ros.core import ConvexObject, Disc, place_between, Pose, Robot, tangent_center
from isotruss_ros.nodes.framework import common_parameters as common
from isotruss_ros.nodes.framework.parameters import FixedSpec, Parameters

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
        'The object is free at object_x, object_y until friction closes a grasp; grasped if false',
    ),
    FixedSpec('object_x', 0.6, 'Position of the free object [m]', (-1e3, 1e3)),
    FixedSpec('object_y', 0.3, 'Position of the free object [m]', (-1e3, 1e3)),
    FixedSpec(
        'object_angle',
        0.0,
        'Orientation of the object at the start, free or grasped [rad]',
        (-6.3, 6.3),
    ),
    replace(common.FRICTION, read_only=True),
    FixedSpec('object_mass', 0.5, 'Mass of the object, mujoco only [kg]', (0.01, 1e3)),
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
    angle, indentation = values.object_angle, values.indentation
    described = common.read_described(values)
    body = described or ConvexObject(Disc(values.object_diameter), friction=values.friction)
    if values.object_is_free:
        return body.moved_to(Pose(values.object_x, values.object_y, angle))
    if described or common.named_members(values.grip):
        members = common.select_grip(robot, values)
        pose = place_between(robot.home, members, body.shape, angle, indentation).body.pose
        return body.moved_to(pose)
    module = values.grip_module or robot.module_names[-1]
    center = tangent_center(robot.home, module, values.object_diameter, indentation)
    return body.moved_to(Pose(*center, angle))
