# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""One robot and one object: what a worker of the cluster computes, and sends back."""

from __future__ import annotations

from dataclasses import dataclass, replace

from isotruss_ros.core import ConvexObject, GraspRequirements, IsotrussError, plan_grasps
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.description import RobotDescription
from isotruss_ros.core.planning.describe_plan import export_figures
from isotruss_ros.core.planning.grasp_plan import GraspPlan
from isotruss_ros.core.planning.violations import export_violation


@dataclass(frozen=True)
class SweepResult:
    """What became of one robot and one object; numbers only, so that thousands are light."""

    robot: int  #: its place among the robots
    item: int  #: the place of the object among the objects
    name: str  #: of the robot
    x: float  #: of the object's centre in the robot frame [m]
    y: float  #: of the object's centre in the robot frame [m]
    diameter: float  #: of the object, of one that is no disc the mean width [m]
    found: int = 0  #: how many distinct grasps; what follows is of the best, see `PlannedGrasp`
    module: str = ''  #: at which the members of the best grasp meet; empty without one
    members: tuple[str, ...] = ()  #: members in contact in the best grasp
    score: float | None = None  #: of the best grasp, by the measure
    squeeze: float | None = None  #: of the best grasp [N]
    slip_margin: float | None = None  #: of the best grasp [N]
    closure_margin: float | None = None  #: of the best grasp [N]
    required_friction: float | None = None  #: of the best grasp
    max_contact_force: float | None = None  #: of the best grasp [N]
    total_force: float | None = None  #: of the best grasp [N]
    utilisation: float | None = None  #: of the wrinkling moment, largest of all members
    travel: float | None = None  #: path length of the roller that travels furthest [m]
    rigidity: float | None = None  #: smallest rigidity index along the path, 1 at home
    roller_positions: tuple[float, ...] = ()  #: in the grasp [m]
    violated_requirement: str = ''  #: where none was found, by the closest candidate
    violation_value: float | None = None  #: value of the closest violation
    violation_bound: float | None = None  #: bound of the closest violation
    evaluations: int = 0  #: see `GraspPlan`, as are the next two
    analyses: int = 0  #: number of analyses of contact
    computing_time: float = 0.0  #: of the search [s]
    error: str = ''  #: why there is no answer; empty where there is one


def evaluate(
    places: tuple[int, int],
    description: RobotDescription,
    body: ConvexObject,
    requirements: GraspRequirements,
    seed: int,
) -> SweepResult:
    """
    Search for grasps of an object from the robot's home; what cannot be computed says why.

    :param places: of the robot and the object, for the result.
    :param description: of the robot.
    :param body: the object.
    :param requirements: what a grasp must fulfil.
    :param seed: of the search.
    """
    asked = unanswered(places, description, body, '')
    try:
        plan = plan_grasps(Robot(description).home, body, requirements, seed)
    except IsotrussError as error:
        # One robot that cannot work must not end a sweep over thousands.
        return replace(asked, error=str(error))
    return replace(asked, **_numbers(plan))  # type: ignore[arg-type]


def unanswered(
    places: tuple[int, int], description: RobotDescription, body: ConvexObject, error: str
) -> SweepResult:
    """
    Return a result that has no answer.

    :param places: of the robot and the object, for the result.
    :param description: of the robot.
    :param body: the object.
    :param error: why there is no result.
    """
    x, y, _ = body.pose
    return SweepResult(*places, description.name, x, y, 2.0 * body.arm, error=error)


def _numbers(plan: GraspPlan) -> dict[str, object]:
    numbers: dict[str, object] = {
        'found': len(plan.grasps),
        'evaluations': plan.evaluations,
        'analyses': plan.analyses,
        'computing_time': plan.computing_time,
    }
    numbers |= export_violation(plan.closest_violation)
    if plan.grasps:
        figures = export_figures(plan.grasps[0])
        lists = {name: tuple(figures[name]) for name in ('members', 'roller_positions')}
        numbers |= figures | lists
    return numbers
