"""
Closing the robot's sides on an object: small steps of the rollers, each a quadratic program.

    minimize    1/2 |g + (dg/dphi) u - target|^2 + 1/2 w (opening too wide)^2 + 1/2 r |u - pull|^2
    subject to  limits, and gaps of all that is not to touch,  |u| <= longest step

Every step is admissible, so the steps are a way there as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isotruss_ros.core.clearance import bodies
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.errors import ConfigurationError, SolverError
from isotruss_ros.core.grasp_analysis import Cylinder
from isotruss_ros.core.limits import Limit
from isotruss_ros.core.object_gaps import object_gaps, ObjectGaps
from isotruss_ros.core.program import installed_solvers
from isotruss_ros.core.shape_margins import shape_margins
from isotruss_ros.core.shape_rigidity import Modes, shape_rigidity
import numpy as np
from numpy.typing import NDArray
import qpsolvers

Array = NDArray[np.float64]

#: Longest step of a roller, and of a gap, against the mean length of members at home.
LONGEST_STEP, LONGEST_CLOSING = 0.035, 0.027
#: What is not to touch keeps this distance, against the diameter of the tube.
CLEARANCE = 0.1
#: Parts of the robot that are nearer than this are watched, and do not come closer than that,
#: against the mean length of members at home.
NEAR, CLEAR = 0.15, 0.01
#: The least rigid ways to move that are watched.
MODES = 2
#: In one step a bound is approached by this share of the distance at most.
APPROACH = 0.5
#: Cost of the rollers' motion against that of the gaps.
MOTION_COST = 1e-4
#: A gap of 1 m counts as much as a radian of opening times this [m].
OPENING_ARM = 0.3
#: A touching side may go beyond its target by this, against the diameter of the tube; twice the
#: sag between the ends of a step is less.
OVERSHOOT = 0.015
GAP_ROUNDING = 1e-12  # [m]
#: A step that leads too near to trouble is halved this often.
MAX_HALVINGS = 5


@dataclass(frozen=True, eq=False)
class Closing:
    """
    What is to close on what, under which bounds.

    :ivar cylinder: the object, which stands still.
    :ivar module: the grip module.
    :ivar sides: the members that are to touch: the two at the module, and perhaps others.
    :ivar opening: largest angle between the two sides [rad].
    :ivar limits: of the rollers; a step is their motion in a unit of time.
    :ivar min_rigidity: see `shape_rigidity`.
    :ivar pull: (r,) roller positions toward which what is left free is drawn; where the robot
        is if None [m].
    """

    cylinder: Cylinder
    module: int
    sides: tuple[int, ...]
    opening: float
    limits: tuple[Limit, ...]
    min_rigidity: float
    pull: Array | None = None

    def bound(self, requirement: str) -> float:
        """Return what a step needs of a requirement that blocks it."""
        return {'rigidity': self.min_rigidity, 'opening': self.opening}.get(requirement, 0.0)


@dataclass(frozen=True, eq=False)
class Step:
    """
    One step.

    :ivar config: where it ends; where it began if there was no way.
    :ivar gaps: there.
    :ivar looked_at: configurations that were computed for it.
    :ivar share: of the longest step that the next one may well take.
    :ivar blocked: what would be missed beyond: a requirement's name and its value; None if the
        step was made.
    """

    config: Configuration
    gaps: ObjectGaps
    looked_at: int
    share: float
    blocked: tuple[str, float] | None = None


def scale(config: Configuration) -> float:
    """Return the mean length of the members at home [m], by which steps are measured."""
    return float(config.robot.home.member_lengths.mean())


def step(
    config: Configuration,
    gaps: ObjectGaps,
    closing: Closing,
    targets: Sequence[float],
    share: float = 1.0,
) -> Step:
    """
    Bring the gaps of the touching sides nearer to their targets.

    :param gaps: those in `config`.
    :param targets: one for each of `closing.sides` [m].
    :param share: of the longest step; `Step.share` of the step before is a good choice.
    :raises SolverError: the program was not solved.
    """
    move = _program(config, gaps, closing, np.asarray(targets), share)
    before = shape_margins(config)
    least = min(closing.min_rigidity, before.rigidity)
    room = min(0.0, before.clearance)
    floors = _floors(config, gaps, closing, np.asarray(targets))
    blocked = ('reach', float((gaps.members[list(closing.sides)] - targets).max()))
    for halving in range(MAX_HALVINGS):
        try:
            moved = config.moved_to(config.roller_positions + 0.5**halving * move)
        except ConfigurationError:
            blocked = ('rigidity', 0.0)
            continue
        margins, there = shape_margins(moved), object_gaps(moved, closing.cylinder)
        low = np.concatenate([there.members, there.modules]) - floors
        if margins.rigidity < least:
            blocked = ('rigidity', margins.rigidity)
        elif margins.clearance < room:
            blocked = ('self_clearance', margins.clearance)
        elif low.min() < 0.0:
            blocked = ('object_clearance', float((low + floors)[low.argmin()]))
        else:
            larger = 2.0 * share if halving == 0 else share * 0.5**halving
            return Step(moved, there, halving + 1, min(1.0, larger))
    return Step(config, gaps, MAX_HALVINGS, share, blocked)


def _floors(config: Configuration, gaps: ObjectGaps, closing: Closing, targets: Array) -> Array:
    """Return the gaps (2m,) that a step must leave: its program knows the first order only."""
    diameter = config.robot.description.tube_diameter
    present = np.concatenate([gaps.members, gaps.modules])
    floors = np.full(len(present), 0.5 * CLEARANCE * diameter)
    floors[list(closing.sides)] = targets - OVERSHOOT * diameter
    return np.minimum(floors, present - GAP_ROUNDING)


def _program(
    config: Configuration, gaps: ObjectGaps, closing: Closing, targets: Array, share: float
) -> Array:
    """Return the motion of the rollers (r,) of one step [m]."""
    m, r = config.robot.layout.n_modules, len(config.roller_positions)
    sides = np.array(closing.sides)
    by_members, by_modules, by_openings = np.split(gaps.by_rollers, 3)
    size = share * scale(config)
    wanted = np.clip(targets - gaps.members[sides], -LONGEST_CLOSING * size, None)
    too_wide = gaps.openings[closing.module] - closing.opening
    rows, aims = [by_members[sides]], [wanted]
    if too_wide > 0.0:
        rows.append(OPENING_ARM * by_openings[[closing.module]])
        aims.append(OPENING_ARM * np.array([-min(too_wide, 0.1)]))
    matrix, aim = np.vstack(rows), np.concatenate(aims)
    longest = LONGEST_STEP * size
    pull = np.zeros(r)
    if closing.pull is not None:
        pull = np.clip(closing.pull - config.roller_positions, -longest, longest)

    clearance = CLEARANCE * config.robot.description.tube_diameter
    others = np.setdiff1d(np.arange(m), sides)
    bounded = [by_members[others], by_members[sides], by_modules]
    lower = [
        np.minimum(0.0, APPROACH * (clearance - gaps.members[others])),
        np.minimum(0.0, targets - gaps.members[sides]),
        np.minimum(0.0, APPROACH * (clearance - gaps.modules)),
    ]
    upper = [np.full(len(part), np.inf) for part in lower]
    if too_wide <= 0.0:
        bounded.append(by_openings[[closing.module]])
        lower.append(np.array([-np.inf]))
        upper.append(np.array([-too_wide]))
    shape_rows, shape_lower = _shape_rows(config, closing)
    bounded.append(shape_rows)
    lower.append(shape_lower)
    upper.append(np.full(len(shape_lower), np.inf))
    for limit in closing.limits:
        part = limit.rows(config)
        bounded.append(part.matrix)
        lower.append(part.lower)
        upper.append(part.upper)
    inequality, low, high = np.vstack(bounded), np.concatenate(lower), np.concatenate(upper)
    finite_low, finite_high = np.isfinite(low), np.isfinite(high)
    for solver in installed_solvers():
        found = qpsolvers.solve_qp(
            matrix.T @ matrix + MOTION_COST * np.eye(r),
            -matrix.T @ aim - MOTION_COST * pull,
            np.vstack([inequality[finite_high], -inequality[finite_low]]),
            np.concatenate([high[finite_high], -low[finite_low]]),
            lb=np.full(r, -longest),
            ub=np.full(r, longest),
            solver=solver,
        )
        if found is not None:
            return found
    raise SolverError(
        f'{", ".join(installed_solvers())} found no step of the rollers; '
        'the configuration is probably next to a singular one'
    )


def _shape_rows(config: Configuration, closing: Closing) -> tuple[Array, Array]:
    """Return rows that keep the shape rigid and apart from itself, and their lower bounds."""
    robot = config.robot
    measure, parts = shape_rigidity(robot), bodies(robot)
    modes = measure.modes(config)
    few = Modes(modes.values[:MODES], modes.rows[:, :MODES], modes.nodes[:, :MODES])
    distances = parts.distances(config)
    near = np.flatnonzero(distances < NEAR * scale(config))
    rows = np.vstack([measure.gradients(config, few), parts.gradients(config, near)])
    left = np.concatenate(
        [few.values - closing.min_rigidity, distances[near] - CLEAR * scale(config)]
    )
    return config.module_rows(rows)[:, robot.layout.driven], np.minimum(0.0, -APPROACH * left)
