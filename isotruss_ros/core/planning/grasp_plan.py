# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Result of the grasp search: grasps with paths, as plain data, as timed paths, and as text."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple, overload

from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip, members_at
from isotruss_ros.core.model.description import RobotDescription
from isotruss_ros.core.model.parameter_deviations import Chance
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.planning.violations import Violation, violation_in_words
import numpy as np

#: Roller speed near the object relative to the largest speed [-]. With unequal lags at high speed
#: one member would touch first and push the object.
NEAR_SPEED_SHARE = 0.25


class ClosedGrip(NamedTuple):
    """Grip reached by closing; the slip margin is None if the grip violates requirements."""

    equilibrium: HeldGrip  #: equilibrium of the object after closing, without external wrench
    slip_margin: float | None  #: slip margin of the object [N]
    chance: Chance | None = None  #: chance that the object is held; None: no uncertainty given


@dataclass(frozen=True, eq=False, repr=False)
class PlannedGrasp(
    Record, headline=('members', 'squeeze', 'slip_margin', 'utilisation', 'roller_positions')
):
    """Grasp that fulfils the requirements, with the path of the rollers to the grasp."""

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
    travel: float  #: largest travel of a roller along the path [m]
    rigidity: float  #: smallest rigidity index along the path, 1 at home [-]
    path: Array  #: (k, r) waypoints of the rollers to the grasp, joined by straight lines [m]
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
    def nonlinearity(self) -> float:
        """Return the nonlinearity of the contact forces, see `SettledGrasp` [-]."""
        return self.equilibrium.nonlinearity

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


def export_figures(grasp: PlannedGrasp) -> dict[str, Any]:
    """
    Return the data of a grasp as a dictionary: module, members, roller positions, scores.

    The module is empty if the members meet at none; the chance needs an uncertainty.
    """
    float_names = [field.name for field in fields(grasp) if field.type == 'float']
    chance = {} if grasp.chance is None else {'chance': grasp.chance.probability}
    return {
        'module': grasp.module or '',
        'members': list(grasp.members),
        'roller_positions': grasp.roller_positions.tolist(),
        **{name: getattr(grasp, name) for name in (*float_names, 'nonlinearity')},
        **chance,
    }


def export_path(grasp: PlannedGrasp) -> dict[str, Any]:
    """
    Return `path` (k, r) [m], `times` (k,) [s] and `touch` of a grasp as a dictionary.

    The rollers move at their largest speed, but near the row `touch` at `NEAR_SPEED_SHARE` of it.
    """
    near = np.arange(len(grasp.path) - 1) >= grasp.touch - 2
    times = path_times(grasp.path, grasp.config.robot.description, near)
    return {'path': grasp.path.tolist(), 'times': times.tolist(), 'touch': grasp.touch}


def path_times(path: Array, limits: RobotDescription, near: Array) -> Array:
    """Return the times (k,) of a path's waypoints (k, r), slower on segments `near` the object."""
    # Durations of the segments at the largest speed [s]; positive, so that times increase.
    speeds = np.where(near, NEAR_SPEED_SHARE * limits.max_speed, limits.max_speed)
    steps = np.diff(path, axis=0)
    longest = np.abs(steps).max(axis=1, initial=0.0)
    durations = np.maximum(longest / speeds, 0.01)
    # Longer durations where the jumps of velocity need more time, from rest to rest.
    while len(steps):
        velocities = np.pad(steps / durations[:, None], ((1, 1), (0, 0)))
        jumps = np.abs(np.diff(velocities, axis=0)).max(axis=1)
        # A segment contains half of the blends at both of its ends, see `RollerTrajectory`.
        required = 0.5 * (jumps[1:] + jumps[:-1]) / limits.max_acceleration
        if (required <= durations).all():
            break
        # The factor ends the iteration on segments too short for the acceleration.
        durations = np.maximum(durations, 1.01 * np.sqrt(durations * required))
    return np.append(0.0, np.cumsum(durations))


def plan_in_words(plan: GraspPlan) -> str:
    """Return a text with the best grasp, or with the violation nearest to an admissible grasp."""
    if not plan.grasps:
        violation = violation_in_words(plan.closest_violation)
        return f'no grasp found in {plan.evaluations} evaluations; {violation}'
    best = plan[0]
    count = 'one grasp' if len(plan) == 1 else f'{len(plan)} grasps, the best'
    where = '' if best.module is None else f'at {best.module} '
    text = (
        f'{count} {where}between {", ".join(best.members)}: presses with {best.squeeze:.3g} N '
        f'each, slips at {best.slip_margin:.3g} N, largest utilisation {best.utilisation:.2g}, '
        f'forces {100.0 * best.nonlinearity:.2g} % above linear tubes'
    )
    if best.outside_model:
        text += '; a tube wrinkles, these numbers are outside of the model'
    if best.chance is not None:
        largest = list(best.chance.shares.items())[:2]
        shares = ', '.join(f'{name} {100.0 * share:.0f} %' for name, share in largest)
        text += (
            f'; held with a chance of {best.chance.probability:.3g} ({best.chance.method}), '
            f'otherwise most probably {best.chance.limit} ({shares})'
        )
    wrinkled = sum(grasp.outside_model for grasp in plan[1:])
    if wrinkled and best.outside_model:
        text += f'; a tube wrinkles in {wrinkled} of the others too'
    elif wrinkled:
        text += f'; in {wrinkled} of the others a tube wrinkles: outside of the model'
    return text
