# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Reading of the goals of a grasp search, and conversion of its results to messages."""

from __future__ import annotations

import math
from typing import NamedTuple

from geometry_msgs.msg import PoseStamped, WrenchStamped
from isotruss_msgs.action import PlanGrasp
from isotruss_msgs.msg import PlannedGrasp as PlannedGraspMessage
from isotruss_ros.core import ConvexObject, GraspRequirements, Robot, Uncertainty
from isotruss_ros.core.paths.object_path import MAX_POSES
from isotruss_ros.core.planning.grasp_plan import export_figures, export_path, PlannedGrasp
from isotruss_ros.core.planning.violations import export_violation
from isotruss_ros.nodes.conversions.grasp_messages import read_external_wrench
from isotruss_ros.nodes.conversions.messages import check_frame, MessageError, read_pose
from isotruss_ros.nodes.conversions.object_messages import read_described
from isotruss_ros.nodes.conversions.path_messages import to_duration, to_trajectory_message
from isotruss_ros.nodes.grasp.searcher import Answer
import numpy as np

#: Largest number of grasps that a goal may request [-].
MAX_COUNT = 1000


class SearchGoal(NamedTuple):
    """Arguments of a grasp search, read from a goal."""

    body: ConvexObject  #: the object at its pose
    requirements: GraspRequirements  #: requirements of the grasps
    seed: int  #: random seed of the search
    time_limit: float  #: time limit of the search [s]; 0: no limit
    uncertainty: Uncertainty | None  #: uncertainty of robot and object; None: not in the goal


def read_goal(
    goal: PlanGrasp.Goal, robot: Robot, described: ConvexObject | None = None
) -> SearchGoal:
    """
    Convert the goal of a grasp search to the arguments of the search.

    :param described: object for goals that describe none, its pose is not used; None: the goal
        must describe an object.
    """
    if goal.object_pose == PoseStamped():
        raise MessageError(
            'object_pose: missing; must be the pose of the object; for a pose at the origin, at '
            f'least its frame {robot.frame!r}'
        )
    check_frame('object pose', goal.object_pose.header, robot.frame)
    if not 0.0 <= goal.time_limit < math.inf:
        raise MessageError(
            f'time_limit {goal.time_limit} s: must be a number, not negative; 0 for no limit'
        )
    if not 1 <= goal.count <= MAX_COUNT:
        raise MessageError(f'count {goal.count}: must be from 1 to {MAX_COUNT}')
    body = _read_body(goal, described)
    needs, uncertainty = _read_requirements(goal, robot), None
    if goal.uncertainty:
        uncertainty = Uncertainty.of(robot, body, goal.uncertainty)
    return SearchGoal(body, needs, goal.seed, goal.time_limit, uncertainty)


def _read_requirements(goal: PlanGrasp.Goal, robot: Robot) -> GraspRequirements:
    """Return the requirements in a goal; fields that are zero or empty mean the defaults."""
    names = ('max_contact_force', 'max_total_force', 'max_utilisation', 'min_rigidity')
    fields = {name: getattr(goal, name) for name in (*names, 'squeeze', 'module')}
    direction = tuple(goal.direction.tolist())
    if goal.measure == 'stiffness' or any(direction):
        fields['direction'] = direction
    wrench = read_external_wrench(WrenchStamped(wrench=goal.external_wrench), robot.frame)
    return GraspRequirements(
        friction=goal.friction,
        external_wrench=wrench,
        members=tuple(goal.members) or None,
        min_slip_margin=goal.min_slip_margin,
        measure=goal.measure,
        carry=_read_carry(goal),
        count=goal.count,
        **{name: value for name, value in fields.items() if value},
    )


def _read_carry(goal: PlanGrasp.Goal) -> tuple[tuple[float, float, float], ...]:
    """Return the poses along which the grasped object must be carried, with continuous angles."""
    if len(goal.carry) == 1 or len(goal.carry) > MAX_POSES:
        raise MessageError(f'carry: {len(goal.carry)} poses: must be none, or 2 to {MAX_POSES}')
    poses = [read_pose(f'pose {i} of carry', pose) for i, pose in enumerate(goal.carry)]
    angles = np.unwrap([pose.angle for pose in poses]).tolist()
    return tuple((pose.x, pose.y, angle) for pose, angle in zip(poses, angles, strict=True))


def _read_body(goal: PlanGrasp.Goal, described: ConvexObject | None) -> ConvexObject:
    """Return the object in the goal, or else in the parameter `object`, at the goal's pose."""
    pose, diameter = goal.object_pose.pose, goal.object_diameter
    body = read_described(goal.object, pose, 'object_diameter', diameter)
    if body is not None:
        return body
    if diameter != 0.0:
        return ConvexObject.disc((pose.position.x, pose.position.y), diameter)
    if described is None:
        raise MessageError(
            'object_diameter 0.0 m: must be positive for a disc; otherwise `object`, or the '
            'parameter object, must describe the object'
        )
    return described.moved_to(read_pose('object pose', pose))


def to_result_message(answer: Answer, robot: Robot) -> PlanGrasp.Result:
    """Convert the result of a grasp search to a message."""
    plan = answer.plan
    if plan is None:
        return PlanGrasp.Result(code=int(answer.outcome), message=answer.message)
    return PlanGrasp.Result(
        code=int(answer.outcome),
        message=answer.message,
        grasps=[_to_grasp_message(grasp, robot) for grasp in plan.grasps],
        evaluations=plan.evaluations,
        analyses=plan.analyses,
        computing_time=plan.computing_time,
        **export_violation(plan.closest_violation),
    )


def _to_grasp_message(grasp: PlannedGrasp, robot: Robot) -> PlannedGraspMessage:
    """Convert a grasp, with the roller trajectory that leads to it, to a message."""
    exported = export_path(grasp)
    times = exported['times']
    path = to_trajectory_message(robot, exported['path'], times)
    touch = to_duration(times[exported['touch']])
    figures = {'chance': math.nan} | export_figures(grasp)
    return PlannedGraspMessage(**figures, path=path, touch=touch)
