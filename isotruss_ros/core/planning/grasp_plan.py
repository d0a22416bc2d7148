# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What the search for grasps finds: grasps, and the path to them in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass

from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip, members_at
from isotruss_ros.core.numerics.arrays import Array


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


class SearchTally:
    """
    What a search has looked at so far.

    :ivar evaluations: configurations that were computed, by kinematics or statics.
    :ivar analyses: of them, how many by `analyze_grasp`.
    :ivar closest: the violation whose value is closest to its bound, the first of such; None while
        there is none.
    """

    def __init__(self) -> None:
        self.evaluations = self.analyses = 0
        self.closest: Violation | None = None

    def record(self, requirement: str, value: float, bound: float, distance: float) -> None:
        """
        Keep a violation if it is the closest one.

        :param requirement: see `Violation`, as for the others.
        :param value: of the candidate.
        :param bound: of the requirement.
        :param distance: of the value from the bound [-].
        """
        if self.closest is None or distance < self.closest.distance:
            self.closest = Violation(requirement, float(value), float(bound), float(distance))

    def add(self, other: SearchTally) -> None:
        """
        Count what another search has looked at, too.

        :param other: its tally.
        """
        self.evaluations += other.evaluations
        self.analyses += other.analyses
        if other.closest is not None:
            self.record(*astuple(other.closest))


@dataclass(frozen=True, eq=False)
class PlannedGrasp:
    """
    A grasp that fulfils the requirements, and the path to it.

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
    def module(self) -> str | None:
        """Return the name `t/j` of the module at which the grip's two members meet, if they do."""
        robot, members = self.config.robot, set(self.grip.members)
        at_module = (name for name in robot.module_names if members == {*members_at(robot, name)})
        return next(at_module, None)

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
