# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What the search for grasps finds: grasps, the path to them in time, and a summary in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isotruss_ros.core.grasping.analysis import GraspAnalysis
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grasp import Grasp
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.numerics.arrays import Array
import numpy as np


@dataclass(frozen=True, eq=False)
class Violation:
    """
    The requirement that a grasp candidate violates.

    :ivar requirement: its name.
    :ivar value: that of the candidate.
    :ivar bound: that of the requirement.
    :ivar distance: of the value from the bound, without unit, to compare candidates by.
    """

    requirement: str
    value: float
    bound: float
    distance: float


@dataclass(frozen=True, eq=False)
class PlannedGrasp:
    """
    A grasp that fulfils the requirements, and the path to it.

    :ivar grasp: the module whose two members hold the object, and the object, where that is a
        cylinder; None of a convex object.
    :ivar grip: the members that were closed on the object, and the object where it is then.
    :ivar members: names `t/j-k` of all members that touch the object.
    :ivar config: configuration of the robot in the grasp.
    :ivar analysis: of the grasp.
    :ivar score: of the measure asked for; larger is better.
    :ivar squeeze: mean normal force of the grasping members on the free object [N].
    :ivar slip_margin: see `SettledGrasp.slip_margin`: of the free object; zero where that would
        not be held [N].
    :ivar closure_margin: see `GraspAnalysis.closure_margin`: of the object held fast; negative
        where that is open, which an object that is free does not mind [N].
    :ivar required_friction: see `GraspAnalysis.required_friction`.
    :ivar max_contact_force: largest sum of the normal forces of one member, of the object held
        fast or free [N].
    :ivar total_force: sum of the normal forces, likewise [N].
    :ivar utilisation: largest of all members, likewise, see `SettledGrasp.utilisation`; above 1
        all numbers are outside of the model.
    :ivar travel: path length of the roller that travels furthest [m].
    :ivar rigidity: the smallest rigidity index along the path, 1 at home.
    :ivar path: (k, r) roller positions from the present ones to the grasp, straight between [m].
    :ivar touch: the row of `path` at which all grasping members touch; none does before.
    """

    grasp: Grasp | None
    grip: Grip
    members: tuple[str, ...]
    config: Configuration
    analysis: GraspAnalysis
    score: float
    squeeze: float
    slip_margin: float
    closure_margin: float
    required_friction: float
    max_contact_force: float
    total_force: float
    utilisation: float
    travel: float
    rigidity: float
    path: Array
    touch: int

    @property
    def outside_model(self) -> bool:
        """Return whether a tube wrinkles, so that no number of the grasp counts."""
        return self.utilisation > 1.0

    @property
    def roller_positions(self) -> Array:
        """Return the roller positions in the grasp, (r,) [m]."""
        return self.path[-1]


@dataclass(frozen=True, eq=False)
class GraspPlan(Sequence[PlannedGrasp]):
    """
    The result of a search; as a sequence, its grasps.

    :ivar grasps: distinct ones, best first; empty where none was found.
    :ivar complete: whether the search ended by itself, and was not stopped.
    :ivar closest_violation: where none was found: the violation of the closest candidate.
    :ivar evaluations: configurations evaluated, by kinematics or statics.
    :ivar analyses: of them, how many by statics.
    :ivar computing_time: [s].
    """

    grasps: tuple[PlannedGrasp, ...]
    complete: bool
    closest_violation: Violation | None
    evaluations: int
    analyses: int
    computing_time: float

    def __getitem__(self, place: int | slice) -> PlannedGrasp | tuple[PlannedGrasp, ...]:
        """Return a grasp, or some of them."""
        return self.grasps[place]

    def __len__(self) -> int:
        """Return how many grasps were found."""
        return len(self.grasps)


@dataclass(frozen=True)
class Progress:
    """
    Progress of a search.

    :ivar evaluations: configurations evaluated so far.
    :ivar found: grasps so far.
    :ivar best: score of the best of them; None while there is none.
    :ivar share: of the candidates of all rounds that were computed, 0 to 1.
    :ivar time_left: estimate [s]; None while there is none.
    """

    evaluations: int
    found: int
    best: float | None
    share: float
    time_left: float | None


#: Of the largest speed, near the object: a member that touches first, since its rollers lag less
#: than others, pushes the object along.
NEAR_SHARE = 0.25


def path_times(path: Array, max_speed: float, near: Array, min_duration: float = 0.01) -> Array:
    """
    Return when each waypoint is reached, straight between them.

    :param path: (k, r) roller positions [m].
    :param max_speed: of any roller [m/s].
    :param near: (k - 1,) pieces that are driven at `NEAR_SHARE` of the speed.
    :param min_duration: of each piece, so that times increase [s].
    :return: (k,) times from the start, the first 0 [s].
    """
    speeds = np.where(near, NEAR_SHARE * max_speed, max_speed)
    longest = np.abs(np.diff(path, axis=0)).max(axis=1, initial=0.0)
    return np.append(0.0, np.cumsum(np.maximum(longest / speeds, min_duration)))


#: By the name of a requirement: value of the closest candidate, and bound.
SENTENCES = {
    'free': 'the robot touches the object already: the gap between them is {value:.4g} m',
    'enclosed': 'no loop of the robot that may grip goes around the object',
    'members': '{value:.0f} of the {bound:.0f} members asked for are seen from within the object',
    'opposed': 'forces of the members, within their friction cones, balance at no angle near',
    'reach': 'a member stays {value:.4g} m short of the object',
    'opening': 'the members open by {value:.3g} rad; must be at most {bound:.3g}',
    'facing': 'members stay {value:.3g} rad from where friction holds the object between them',
    'rigidity': 'along the path the rigidity index falls to {value:.3g}; must be {bound:.3g}',
    'self_clearance': 'along the path the clearance of the robot from itself is {value:.4g} m',
    'object_clearance': 'a part that must not touch comes within {value:.4g} m of the object',
    'held': 'no pose near the object balances the forces of the members',
    'squeeze': 'limits end the closing at {value:.4g} N of each member; must be {bound:.4g} N',
    'in_place': 'the rollers cannot close and leave the object in place: it moves {value:.4g} m',
    'grip': '{value:.0f} members press on an object held fast there; must be those of the grip',
    'min_slip_margin': 'the slip margin is {value:.4g} N, and must be {bound:.4g} N',
    'force_closure': 'it takes a friction coefficient of {value:.4g}, there is {bound:.4g}',
    'min_margin': 'the closure margin is {value:.4g} N, and must be {bound:.4g} N',
    'max_contact_force': 'one member presses with {value:.4g} N; must be at most {bound:.4g} N',
    'max_total_force': 'all members press with {value:.4g} N; must be at most {bound:.4g} N',
    'max_utilisation': 'a tube bears {value:.3g} of its wrinkling moment; at most {bound:.3g}',
    'path': 'there is no path from the touch to the grasp',
}


def violation_in_words(violation: Violation | None) -> str:
    """
    Return a violation in words.

    :param violation: that of the closest candidate; None if there was none.
    """
    if violation is None:
        return 'there was no grasp candidate'
    if violation.requirement not in SENTENCES:
        return f'the closest grasp candidate cannot be computed: {violation.requirement}'
    if violation.requirement == 'force_closure' and violation.value == 0.0:
        return 'force_closure: the members do not press on the object'
    sentence = SENTENCES[violation.requirement].format(
        value=violation.value, bound=violation.bound
    )
    return f'{violation.requirement}: {sentence}'


def grasp_in_words(grasp: PlannedGrasp) -> str:
    """
    Return members and forces of a grasp in words, and whether they are outside of the model.

    :param grasp: the grasp.
    """
    outside = '; a tube wrinkles, these numbers are outside of the model'
    where = '' if grasp.grasp is None else f'at {grasp.grasp.module} '
    return (
        f'{where}between {", ".join(grasp.members)}: presses with '
        f'{grasp.squeeze:.3g} N each, slips at {grasp.slip_margin:.3g} N, closure margin held '
        f'fast {1e3 * grasp.closure_margin:.3g} mN, tubes bear {grasp.utilisation:.2g} of their '
        f'wrinkling moment{outside if grasp.outside_model else ""}'
    )


def plan_in_words(plan: GraspPlan) -> str:
    """
    Return a plan in words: the best grasp, or the closest violation.

    If tubes wrinkle in any of the grasps it says so.

    :param plan: the plan.
    """
    if not plan.grasps:
        violation = violation_in_words(plan.closest_violation)
        return f'no grasp found in {plan.evaluations} evaluations; {violation}'
    count = len(plan.grasps)
    found = 'one grasp' if count == 1 else f'{count} grasps, the best'
    wrinkled = sum(grasp.outside_model for grasp in plan.grasps[1:])
    others = f'; so it is in {wrinkled} of the others'
    if not plan.grasps[0].outside_model:
        others = f'; in {wrinkled} of the others a tube wrinkles: outside of the model'
    return f'{found} {grasp_in_words(plan.grasps[0])}{others if wrinkled else ""}'
