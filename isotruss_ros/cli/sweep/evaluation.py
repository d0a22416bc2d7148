# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""One robot and one object: what a worker of the cluster computes, and sends back."""

from __future__ import annotations

from dataclasses import dataclass, replace

from isotruss_ros.core import ConvexObject, GraspRequirements, IsotrussError, plan_grasps
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.description import RobotDescription
from isotruss_ros.core.planning.describe_plan import export_figures, export_violation
from isotruss_ros.core.planning.grasp_plan import GraspPlan


@dataclass(frozen=True)
class SweepResult:
    """
    What became of one robot and one object; numbers only, so that thousands are light.

    :ivar robot: its place among the robots.
    :ivar item: the place of the object among the objects.
    :ivar name: of the robot.
    :ivar x: of the object's centre in the robot frame [m].
    :ivar y: of the object's centre in the robot frame [m].
    :ivar diameter: of the object, of one that is no disc the mean width [m].
    :ivar found: how many distinct grasps; what follows is of the best, see `PlannedGrasp`.
    :ivar module: at which the members of the best grasp meet; empty without one.
    :ivar members: members in contact in the best grasp.
    :ivar score: of the best grasp, by the measure.
    :ivar squeeze: of the best grasp [N].
    :ivar slip_margin: of the best grasp [N].
    :ivar closure_margin: of the best grasp [N].
    :ivar required_friction: of the best grasp.
    :ivar max_contact_force: of the best grasp [N].
    :ivar total_force: of the best grasp [N].
    :ivar utilisation: of the wrinkling moment, the largest of the members of the best grasp.
    :ivar travel: of the best grasp, path length of the roller that travels furthest [m].
    :ivar rigidity: smallest rigidity index along the path to the best grasp, 1 at home.
    :ivar roller_positions: in the grasp [m].
    :ivar violated_requirement: where none was found, by the closest candidate.
    :ivar violation_value: value of the closest violation.
    :ivar violation_bound: bound of the closest violation.
    :ivar evaluations: see `GraspPlan`, as are the next two.
    :ivar analyses: number of analyses of contact.
    :ivar computing_time: of the search [s].
    :ivar error: why there is no answer; empty where there is one.
    """

    robot: int
    item: int
    name: str
    x: float
    y: float
    diameter: float
    found: int = 0
    module: str = ''
    members: tuple[str, ...] = ()
    score: float | None = None
    squeeze: float | None = None
    slip_margin: float | None = None
    closure_margin: float | None = None
    required_friction: float | None = None
    max_contact_force: float | None = None
    total_force: float | None = None
    utilisation: float | None = None
    travel: float | None = None
    rigidity: float | None = None
    roller_positions: tuple[float, ...] = ()
    violated_requirement: str = ''
    violation_value: float | None = None
    violation_bound: float | None = None
    evaluations: int = 0
    analyses: int = 0
    computing_time: float = 0.0
    error: str = ''


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
    return replace(asked, **_numbers(plan))


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
