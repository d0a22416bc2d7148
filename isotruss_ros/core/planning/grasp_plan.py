# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Result of the grasp search: grasps with the paths to the grasps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, overload

from isotruss_ros.core.chance.probability import Chance
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip, members_at
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.planning.violations import Violation


class ClosedGrip(NamedTuple):
    """Grip reached by closing; the slip margin is None if the grip violates requirements."""

    equilibrium: HeldGrip  #: equilibrium of the object after closing, without external wrench
    slip_margin: float | None  #: slip margin of the object [N]
    chance: Chance | None = None  #: chance that the object is held; None: no uncertainty given


@dataclass(frozen=True, eq=False, repr=False)
class PlannedGrasp(
    Record, headline=('members', 'squeeze', 'slip_margin', 'utilisation', 'roller_positions')
):
    """Grasp that fulfils the requirements, with a path of the rollers, linear between its rows."""

    grip: Grip  #: grasping members, and the object at its pose after closing
    members: tuple[str, ...]  #: names `t/j-k` of the members in contact with the object
    config: Configuration  #: configuration of the robot in the grasp
    #: equilibrium of the object, without external wrench
    equilibrium: HeldGrip = field(repr=False)
    score: float  #: score by the required criterion; larger is better
    squeeze: float  #: mean normal force of the grasping members [N]
    slip_margin: float  #: slip margin under the required wrench [N]
    required_friction: float  #: smallest coefficient of friction without slip [-]
    max_contact_force: float  #: largest normal force of a member [N]
    total_force: float  #: sum of the normal forces of the members [N]
    utilisation: float  #: largest utilisation of a member [-]; the model holds below 1
    nonlinearity: float  #: nonlinearity of the contact forces, see `SettledGrasp` [-]
    travel: float  #: largest travel of a roller along the path [m]
    rigidity: float  #: smallest rigidity index along the path, 1 at home [-]
    path: Array  #: (k, r) roller positions from the current positions to the grasp [m]
    touch: int  #: index of the first row of `path` with all grasping members in contact
    #: chance that the object is held, also along the path `carry`; None: no uncertainty given
    chance: Chance | None = field(default=None, repr=False)

    @property
    def module(self) -> str | None:
        """Return the name `t/j` of the module at which two grasping members meet, if any."""
        robot, members = self.config.robot, set(self.grip.members)
        at_module = (name for name in robot.module_names if members == {*members_at(robot, name)})
        return next(at_module, None)

    @property
    def outside_model(self) -> bool:
        """Return whether a tube wrinkles, which makes all results invalid."""
        return self.utilisation > 1.0

    @property
    def roller_positions(self) -> Array:
        """Return the roller positions of the grasp, (r,) [m]."""
        return self.path[-1]


@dataclass(frozen=True, eq=False, repr=False)
class GraspPlan(
    Record,
    Sequence[PlannedGrasp],
    headline=('best', 'complete', 'closest_violation', 'computing_time'),
):
    """
    Result of a grasp search, usable as a sequence of the grasps.

    :ivar grasps: distinct grasps, best first.
    :ivar complete: whether the search was completed; false if it was stopped.
    :ivar closest_violation: requirement violated by the candidate closest to an admissible grasp;
        None if there is a grasp.
    :ivar evaluations: number of evaluated configurations.
    :ivar analyses: number of static analyses.
    :ivar computing_time: computing time [s].
    """

    grasps: tuple[PlannedGrasp, ...]
    complete: bool
    closest_violation: Violation | None
    evaluations: int
    analyses: int
    computing_time: float

    @overload
    def __getitem__(self, place: int) -> PlannedGrasp: ...

    @overload
    def __getitem__(self, place: slice) -> tuple[PlannedGrasp, ...]: ...

    def __getitem__(self, place: int | slice) -> PlannedGrasp | tuple[PlannedGrasp, ...]:
        """Return the grasp at an index, or the grasps of a slice."""
        return self.grasps[place]

    @property
    def best(self) -> tuple[str, ...] | None:
        """Return the grasping members of the best grasp; None if no grasp was found."""
        return self.grasps[0].members if self.grasps else None

    def __len__(self) -> int:
        """Return the number of grasps."""
        return len(self.grasps)


@dataclass(frozen=True)
class Progress:
    """Counts that describe the progress of a grasp search."""

    evaluations: int  #: number of evaluated configurations so far
    found: int  #: number of grasps so far
    best: float | None  #: score of the best grasp; None if no grasp was found
    share: float  #: fraction of the candidates computed, in all rounds begun so far, 0 to 1
    time_left: float | None  #: estimated remaining time [s]; None without an estimate
