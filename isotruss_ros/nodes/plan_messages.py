"""Goals of the search for grasps from messages, and what it finds back."""

from __future__ import annotations

import math
from typing import NamedTuple

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import WrenchStamped
from isotruss_msgs.action import PlanGrasp
from isotruss_msgs.msg import PlannedGrasp as PlannedGraspMessage
from isotruss_ros.core import (
    Cylinder,
    GraspRequirements,
    Measure,
    PlannedGrasp,
    Progress,
    Robot,
)
from isotruss_ros.nodes.grasp_messages import external_wrench
from isotruss_ros.nodes.messages import check_frame, MAX_DISTANCE, MessageError, quoted
from isotruss_ros.plan.searcher import Answer
from isotruss_ros.plan.timing import path_times
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

#: More grasps than this are not looked at by anybody.
MAX_COUNT = 1000


class Wanted(NamedTuple):
    """
    What a goal asks for.

    :ivar time_limit: of the search [s]; none if 0.
    """

    cylinder: Cylinder
    requirements: GraspRequirements
    seed: int
    time_limit: float


def wanted(goal: PlanGrasp.Goal, robot: Robot) -> Wanted:
    """
    Return what a goal asks for.

    :raises MessageError: another frame, or a number that cannot be.
    :raises GraspError: a requirement that is not usable.
    """
    check_frame('object pose', goal.object_pose.header, robot.frame)
    position = goal.object_pose.pose.position
    for name, value in (('x', position.x), ('y', position.y), ('diameter', goal.object_diameter)):
        if not abs(value) <= MAX_DISTANCE:
            raise MessageError(
                f'object: {name} {value} m: must be finite, at most {MAX_DISTANCE:g} m'
            )
    if not 0.0 <= goal.time_limit < math.inf:
        raise MessageError(
            f'time_limit {goal.time_limit} s: must be a number, not negative; 0 for no limit'
        )
    if not 1 <= goal.count <= MAX_COUNT:
        raise MessageError(f'count {goal.count}: must be from 1 to {MAX_COUNT}')
    if goal.module and goal.module not in robot.module_names:
        raise MessageError(
            f'module {quoted(goal.module)}: robot {robot.name} has no such module; must be one of '
            f'{", ".join(robot.module_names)}, or empty for any'
        )
    measures = [measure.value for measure in Measure]
    if goal.measure not in measures:
        raise MessageError(f'measure {quoted(goal.measure)}: must be one of {", ".join(measures)}')
    bounds = {
        name: getattr(goal, name) or math.inf for name in ('max_contact_force', 'max_total_force')
    }
    if goal.min_rigidity:
        bounds['min_rigidity'] = goal.min_rigidity
    direction = tuple(goal.direction.tolist())
    if goal.measure == 'stiffness' or any(direction):
        bounds['direction'] = direction
    requirements = GraspRequirements(
        friction=goal.friction,
        external_wrench=external_wrench(WrenchStamped(wrench=goal.external_wrench), robot.frame),
        module=goal.module or None,
        min_margin=goal.min_margin,
        measure=goal.measure,
        count=goal.count,
        **bounds,
    )
    cylinder = Cylinder((position.x, position.y), goal.object_diameter)
    return Wanted(cylinder, requirements, goal.seed, goal.time_limit)


def feedback_message(progress: Progress) -> PlanGrasp.Feedback:
    """Return how far a search is."""
    return PlanGrasp.Feedback(
        evaluations=progress.evaluations,
        found=progress.found,
        best=math.nan if progress.best is None else progress.best,
        progress=progress.share,
        time_left=math.nan if progress.time_left is None else progress.time_left,
    )


def result_message(answer: Answer, robot: Robot) -> PlanGrasp.Result:
    """Return how a search ended."""
    result = PlanGrasp.Result(code=int(answer.outcome), message=answer.message)
    plan = answer.plan
    if plan is None:
        return result
    result.grasps = [grasp_message(grasp, robot) for grasp in plan.grasps]
    if plan.nearest_miss is not None:
        result.missed = plan.nearest_miss.requirement
        result.missed_value = float(plan.nearest_miss.value)
        result.missed_bound = float(plan.nearest_miss.bound)
    result.evaluations, result.analyses = plan.evaluations, plan.analyses
    result.computing_time = plan.computing_time
    return result


def grasp_message(grasp: PlannedGrasp, robot: Robot) -> PlannedGraspMessage:
    """Return a grasp with the way there."""
    times = path_times(grasp.path, robot.description.max_speed)
    path = JointTrajectory(joint_names=list(robot.roller_names))
    path.header.frame_id = robot.frame
    path.points = [
        JointTrajectoryPoint(positions=row, time_from_start=duration(when))
        for row, when in zip(grasp.path.tolist(), times.tolist(), strict=True)
    ]
    return PlannedGraspMessage(
        module=grasp.grasp.module,
        members=list(grasp.members),
        roller_positions=grasp.roller_positions.tolist(),
        score=grasp.score,
        closure_margin=grasp.closure_margin,
        required_friction=grasp.required_friction,
        max_contact_force=grasp.max_contact_force,
        total_force=grasp.total_force,
        travel=grasp.travel,
        rigidity=grasp.rigidity,
        path=path,
        touch=duration(float(times[grasp.touch])),
    )


def duration(seconds: float) -> Duration:
    """Return a time that is not negative [s] as a message."""
    whole, rest = divmod(round(1e9 * seconds), 1_000_000_000)
    return Duration(sec=whole, nanosec=rest)
