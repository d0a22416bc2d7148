# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the search for grasps finds: grasps, and the path to them in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, overload

from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip, members_at
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.planning.violations import Violation


class ClosedGrip(NamedTuple):
    """
    A grip that presses on the object.

    Its slip margin is zero where the free object would not be held, None where the grip does not
    fulfil the requirements; see `SettledGrasp.slip_margin`.
    """

    config: Configuration  #: configuration of the robot
    body: ConvexObject  #: the object where it lay, or where it went as the grip closed
    analysis: GraspAnalysis  #: of the object held fast
    loads: dict[str, float]  #: see `GraspRequirements.find_loads`
    squeeze: float  #: mean normal force of the grasping members [N]
    slip_margin: float | None  #: of the free object [N], see above


@dataclass(frozen=True, eq=False, repr=False)
class PlannedGrasp(
    Record, headline=('members', 'squeeze', 'slip_margin', 'utilisation', 'roller_positions')
):
    """
    A grasp that fulfils the requirements, and the path to it.

    The path is straight between its rows. An object that is free does not mind a grasp that is
    open, by (10), of the object held fast.
    """

    grip: Grip  #: the members that were closed on the object, and the object where it is then
    members: tuple[str, ...]  #: names `t/j-k` of all members that touch the object
    config: Configuration  #: configuration of the robot in the grasp
    analysis: GraspAnalysis  #: of the grasp
    score: float  #: of the measure asked for; larger is better
    squeeze: float  #: mean normal force of the grasping members on the free object [N]
    slip_margin: float  #: of the free object [N], see `SettledGrasp`; zero where that is not held
    closure_margin: float  #: of the object held fast [N]; negative where that is open
    required_friction: float  #: see `GraspAnalysis.required_friction`
    max_contact_force: float  #: largest sum of one member, of the object held fast or free [N]
    total_force: float  #: sum of the normal forces, likewise [N]
    utilisation: float  #: largest of all members, likewise; above 1 outside of the model
    nonlinearity: float  #: see `GraspAnalysis.nonlinearity` [-]
    travel: float  #: path length of the roller that travels furthest [m]
    rigidity: float  #: the smallest rigidity index along the path, 1 at home
    path: Array  #: (k, r) roller positions from the present ones to the grasp [m]
    touch: int  #: the row of `path` at which all grasping members touch; none does before

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


@dataclass(frozen=True, eq=False, repr=False)
class GraspPlan(
    Record,
    Sequence[PlannedGrasp],
    headline=('best', 'complete', 'closest_violation', 'computing_time'),
):
    """The result of a search; as a sequence, its grasps."""

    grasps: tuple[PlannedGrasp, ...]  #: distinct ones, best first; empty where none was found
    complete: bool  #: whether the search ended by itself, and was not stopped
    closest_violation: Violation | None  #: of the closest candidate, where no grasp was found
    evaluations: int  #: configurations evaluated, by kinematics or statics
    analyses: int  #: of them, how many by statics
    computing_time: float  #: [s]

    @overload
    def __getitem__(self, place: int) -> PlannedGrasp: ...

    @overload
    def __getitem__(self, place: slice) -> tuple[PlannedGrasp, ...]: ...

    def __getitem__(self, place: int | slice) -> PlannedGrasp | tuple[PlannedGrasp, ...]:
        """Return a grasp, or some of them."""
        return self.grasps[place]

    @property
    def best(self) -> tuple[str, ...] | None:
        """Return the members of the best grasp; None where none was found."""
        return self.grasps[0].members if self.grasps else None

    def __len__(self) -> int:
        """Return how many grasps were found."""
        return len(self.grasps)


@dataclass(frozen=True)
class Progress:
    """Progress of a search."""

    evaluations: int  #: configurations evaluated so far
    found: int  #: grasps so far
    best: float | None  #: score of the best of them; None while there is none
    share: float  #: of the candidates of all rounds that were computed, 0 to 1
    time_left: float | None  #: estimate [s]; None while there is none
