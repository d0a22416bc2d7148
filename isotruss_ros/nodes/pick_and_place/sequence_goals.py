# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of the goals of PickObject, PlaceObject and MoveObject."""

from __future__ import annotations

import math

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import MoveObject, PickObject, PlaceObject, PlanGrasp
from isotruss_ros.core import ConvexObject, Pose, Robot
from isotruss_ros.core.errors import NoMotionError
from isotruss_ros.nodes.conversions.messages import MessageError
from isotruss_ros.nodes.conversions.object_messages import to_object_message
from isotruss_ros.nodes.conversions.path_messages import read_object_path
from isotruss_ros.nodes.conversions.plan_messages import read_goal
from isotruss_ros.nodes.framework.parameters import Parameters
from std_msgs.msg import Header


def to_search_goal(
    goal: PickObject.Goal, lay: PoseStamped, values: Parameters, described: ConvexObject | None
) -> PlanGrasp.Goal:
    """
    Return the goal of the grasp search for an object to be picked.

    :param goal: goal of the action.
    :param lay: pose of the object.
    :param values: parameters of the node with friction and diameter of the object.
    :param described: described object; None for a disc.
    """
    wanted = PlanGrasp.Goal(
        object_pose=lay,
        friction=values.friction,
        module=goal.module,
        members=goal.members,
        squeeze=goal.squeeze,
        min_slip_margin=goal.min_slip_margin,
        time_limit=goal.time_limit,
        count=1,
    )
    if described is None:
        wanted.object_diameter = values.object_diameter
    else:
        wanted.object = to_object_message(described)
    return wanted


def check_pick(
    goal: PickObject.Goal, robot: Robot, values: Parameters, described: ConvexObject | None
) -> None:
    """
    Raise IsotrussError for a goal whose grasp search would be invalid at any pose of the object.

    :param goal: goal of the action.
    :param robot: the robot.
    :param values: parameters of the node, see `to_search_goal`.
    :param described: described object; None for a disc.
    :raises IsotrussError: see `read_goal`.
    """
    anywhere = PoseStamped(header=Header(frame_id=robot.frame))
    anywhere.pose.orientation.w = 1.0
    read_goal(to_search_goal(goal, anywhere, values, described), robot, described)


def check_place(goal: PlaceObject.Goal) -> None:
    """
    Raise MessageError for an invalid clearance.

    :param goal: goal of the action.
    :raises MessageError: the clearance is invalid; the text names the value and its valid range.
    """
    if not 0.0 < goal.clearance < math.inf:
        raise MessageError(f'clearance {goal.clearance} m: must be a positive number')


def check_move(goal: MoveObject.Goal, robot: Robot, here: Pose) -> None:
    """
    Raise IsotrussError for an invalid path.

    :param goal: goal of the action.
    :param robot: the robot.
    :param here: current pose of the object, the first pose of a path with fewer than two poses.
    :raises IsotrussError: see `read_object_path`.
    """
    try:
        read_object_path(goal.path, goal.speed, goal.turn_rate, robot, False, here)
    except NoMotionError:
        if len(goal.path.poses) != 1:
            raise
