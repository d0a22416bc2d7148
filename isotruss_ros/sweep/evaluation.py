"""One robot and one object: what a worker of the cluster computes, and sends back."""

from __future__ import annotations

from dataclasses import dataclass, replace

from isotruss_ros.core import Cylinder, GraspPlan, GraspRequirements, IsotrussError, plan_grasps
from isotruss_ros.core.description import RobotDescription
from isotruss_ros.core.robot import Robot


@dataclass(frozen=True)
class SweepResult:
    """
    What became of one robot and one object; numbers only, so that thousands are light.

    :ivar robot: its place among the robots.
    :ivar item: the place of the object among the objects.
    :ivar name: of the robot.
    :ivar found: how many distinct grasps; what follows is of the best, see `PlannedGrasp`.
    :ivar roller_positions: in the grasp [m].
    :ivar missed: where none was found, what the nearest candidate misses.
    :ivar evaluations: see `GraspPlan`, as are the next two.
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
    closure_margin: float | None = None
    required_friction: float | None = None
    max_contact_force: float | None = None
    total_force: float | None = None
    travel: float | None = None
    rigidity: float | None = None
    roller_positions: tuple[float, ...] = ()
    missed: str = ''
    missed_value: float | None = None
    missed_bound: float | None = None
    evaluations: int = 0
    analyses: int = 0
    computing_time: float = 0.0
    error: str = ''


def evaluate(
    places: tuple[int, int],
    description: RobotDescription,
    cylinder: Cylinder,
    requirements: GraspRequirements,
    seed: int,
) -> SweepResult:
    """
    Search for grasps of an object from the robot's home; what cannot be computed says why.

    :param places: of the robot and the object, for the result.
    """
    asked = unanswered(places, description, cylinder, '')
    try:
        plan = plan_grasps(Robot(description).home, cylinder, requirements, seed)
    except IsotrussError as error:
        # One robot that cannot work must not end a sweep over thousands.
        return replace(asked, error=str(error))
    return replace(asked, **_numbers(plan))


def unanswered(
    places: tuple[int, int], description: RobotDescription, cylinder: Cylinder, error: str
) -> SweepResult:
    """Return a result that has no answer."""
    return SweepResult(*places, description.name, *cylinder.center, cylinder.diameter, error=error)


def _numbers(plan: GraspPlan) -> dict[str, object]:
    numbers: dict[str, object] = {
        'found': len(plan.grasps),
        'evaluations': plan.evaluations,
        'analyses': plan.analyses,
        'computing_time': plan.computing_time,
    }
    miss = plan.nearest_miss
    if miss is not None:
        numbers |= {
            'missed': miss.requirement,
            'missed_value': float(miss.value),
            'missed_bound': float(miss.bound),
        }
    if plan.grasps:
        best = plan.grasps[0]
        numbers |= {
            'module': best.grasp.module,
            'members': best.members,
            'score': best.score,
            'closure_margin': best.closure_margin,
            'required_friction': best.required_friction,
            'max_contact_force': best.max_contact_force,
            'total_force': best.total_force,
            'travel': best.travel,
            'rigidity': best.rigidity,
            'roller_positions': tuple(best.roller_positions.tolist()),
        }
    return numbers
