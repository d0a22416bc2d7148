# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Prediction of slip and of collisions along the path of a held object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
import math
from typing import NamedTuple

from isotruss_ros.core.errors import (
    ConfigurationError,
    distinct_numbers,
    GraspError,
    NoMotionError,
    SolverError,
)
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_search import measure_gaps
from isotruss_ros.core.holding.grip_record import GripRecord
from isotruss_ros.core.holding.held_grip import (
    HeldGrip,
    HoldStatus,
    MIN_RELATIVE_MARGIN,
    NotHeldError,
)
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.limit_handling import LimitHandling, LOOP_SOFT_RANK
from isotruss_ros.core.manipulation.limits import default_limits
from isotruss_ros.core.manipulation.rolling_grip import roll_object
from isotruss_ros.core.manipulation.solve_twist import solve_twist
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.model.convex_object import check_friction, ConvexObject
from isotruss_ros.core.model.obstacle import Obstacle
from isotruss_ros.core.model.pose import Pose, pose_difference
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import Array, finite_rows, MAX_MAGNITUDE
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.paths.object_path import ObjectPath
from isotruss_ros.core.paths.path_tracking import (
    FINISHED,
    PathPhase,
    PathTracker,
    speed_share,
    TrackingSettings,
)
from isotruss_ros.core.safety.command_watch import Watch
from isotruss_ros.core.safety.shape_guard import ShapeBounds, ShapeGuard
import numpy as np

#: Length of a step, with rotations times the characteristic radius [m], and its longest time [s].
#: At 20 mm/s on paths of seven random robots and of a disc near a singularity, the predicted share
#: differs by at most 0.005 from the one with steps of 0.03 s. With 0.1 s it differs by 0.004, in
#: twice the time; without a bound, by 0.005. The bound is for slower paths, on which a step would
#: be about as long as the progress timeout.
STEP, MAX_STEP_TIME = 0.005, 0.3
#: Largest number of steps of a path at its full speed, and of its prediction [-]; long paths have
#: longer steps.
MAX_PATH_STEPS, MAX_STEPS = 1000, 4000
#: Time in which a deviation of the squeeze decays [s]. On these paths, a third and three times of
#: it change the share by less than 0.001, and the smallest slip margin by at most 0.1 N.
SQUEEZE_TIME = 0.5
#: Largest turn between two poses of which the direction is plain [rad].
MAX_TURN = 2.0
#: Default speed [m/s] and turn rate [rad/s] of a path, those of the action `follow_object_path`.
SPEED, TURN_RATE = 0.02, 0.2
#: Begin of the reason of an end at which the robot cannot follow the path any further.
OUT_OF_REACH = 'out of reach'
#: Behaviour of the control loop at limits and singular tasks.
LOOP_HANDLING = LimitHandling(True, True, LOOP_SOFT_RANK)
#: Tracking of a path by default.
TRACKING = TrackingSettings()


class Foresight(NamedTuple):
    """Predicted motion of a held object along a path, see `foresee_path`."""

    pose: Pose  #: pose at the end of the predicted motion
    share: float  #: fraction of the path that is reached, 0 to 1
    slip_margin: float  #: smallest slip margin on the path [N]
    why: str  #: reason for an end before the end of the path; otherwise empty
    grips: list[HeldGrip]  #: equilibria along the path, the first one at its start
    #: (k, 2) fraction of the path's duration that is completed, and time since the start [s]. It
    #: rises more slowly than along the path itself where limits or a nearly singular task slow it
    timeline: Array

    @property
    def duration(self) -> float:
        """Return the time of the predicted motion [s]."""
        return float(self.timeline[-1, 1])

    def time_left(self, progress: float) -> float:
        """Return the time from a completed fraction of the path to the end of the motion [s]."""
        fractions, times = self.timeline.T
        reached = min(int(np.searchsorted(fractions, progress)), len(times) - 1)
        return self.duration - float(times[reached])


@check_kinds
@single_threaded
def foresee_grip(
    config: Configuration,
    body: ConvexObject,
    friction: float,
    poses: Array,
    record: GripRecord | None = None,
    speed: float = SPEED,
    turn_rate: float = TURN_RATE,
    settings: TrackingSettings = TRACKING,
    obstacles: Sequence[Obstacle] = (),
) -> Foresight | None:
    """
    Predict the motion of an object in its grip by `foresee_path`; None if no members hold it.

    If there is no `record` of the loop that holds the object, or its motion ends early, the motion
    starts from the equilibrium of `attach_grip`. The path is shifted to the start. None has no
    reason; `settle_grasp` of the same object states it.
    """
    friction = check_friction(friction)
    foresight = None
    grip_sources = [attach_grip] if record is None else [record.restore, attach_grip]
    for find_grip in grip_sources:
        try:
            held = find_grip(config, body)
        except NotHeldError:
            break
        if held.hold(friction) is HoldStatus.HELD:
            motion = poses, speed, turn_rate, settings, obstacles
            foresight = foresee_path(held, friction, *motion)
            if not foresight.why:
                break
    return foresight


@check_kinds
@single_threaded
def foresee_path(
    held: HeldGrip,
    friction: float,
    poses: Array,
    speed: float = SPEED,
    turn_rate: float = TURN_RATE,
    settings: TrackingSettings = TRACKING,
    obstacles: Sequence[Obstacle] = (),
) -> Foresight:
    """
    Predict the motion of a held object along a path from rest to rest, at constant squeeze.

    The path is tracked by `PathTracker`, and the rollers move by `solve_twist` within the limits
    of the control loop. Contacts roll without slip. External loads, the utilisation of the tubes
    and limits on acceleration are not considered. The motion ends if the slip margin becomes less
    than `MIN_RELATIVE_MARGIN` times the squeeze, or if the object does not follow the path, for
    example where rollers would move much faster than it, or where an obstacle is in the way.
    Angles of the poses are not wrapped to one turn.

    :param held: equilibrium at which the motion starts, `settle_grasp(...).equilibrium`.
    :param poses: (n, 3) poses x, y, angle of the path [m, rad]. The path is shifted, so that its
        first pose is that of the equilibrium.
    :param speed: speed of the path, see `ObjectPath` [m/s].
    :param turn_rate: largest angular velocity of the path [rad/s].
    :param obstacles: obstacles at rest.
    """
    friction = check_friction(friction)
    what = 'the poses of the path (x, y, angle) [m, rad]'
    poses = finite_rows(poses, 3, what, GraspError, MAX_MAGNITUDE)
    if not len(poses):
        raise GraspError('the path has no poses: must have one or more')
    # The equilibrium may differ from the first pose.
    shifted = split_turns(poses - poses[0] + np.array(held.pose))
    try:
        path = ObjectPath(shifted, speed, turn_rate)
    except NoMotionError:
        margin, at_rest = held.slip_margin(friction), np.array([[1.0, 0.0]])
        return Foresight(held.pose, 1.0, margin, '', [held], at_rest)
    step_time = min(STEP / max(speed, turn_rate * held.arm), MAX_STEP_TIME)
    step_time = max(step_time, path.duration / MAX_PATH_STEPS)
    guard = guard_steps(held.config.robot, step_time, obstacles)
    return _follow(held, friction, PathTracker(path, settings, step_time), step_time, guard)


def guard_steps(robot: Mechanism, step_time: float, obstacles: Sequence[Obstacle]) -> ShapeGuard:
    """Return the guard of the control loop for steps of a time [s]."""
    bounds = ShapeBounds()
    # The loop bounds the rate of a margin in short cycles; the longer step has the same decay.
    rate = min(bounds.rate, robot.description.braking_rate)
    bounds = replace(bounds, rate=-math.expm1(-rate * step_time) / step_time)
    return ShapeGuard(robot, bounds, obstacles=obstacles)


def split_turns(poses: Array) -> Array:
    """
    Return poses (n, 3) with further ones within large turns, which keep their direction.

    Angles may then be wrapped to one turn, as in messages.
    """
    turns = np.abs(np.diff(poses[:, 2]))
    ends = np.concatenate([[0], np.cumsum(np.ceil(turns / MAX_TURN).clip(1.0))])
    places = np.interp(np.arange(ends[-1] + 1), ends, np.arange(len(poses)))
    return np.column_stack([np.interp(places, np.arange(len(poses)), c) for c in poses.T])


def _follow(
    held: HeldGrip, friction: float, tracker: PathTracker, step_time: float, guard: ShapeGuard
) -> Foresight:
    """Return the motion of a held object whose path is tracked in steps of a time [s]."""
    squeeze = held.squeeze
    grips, least_margin, why = [held], held.slip_margin(friction), ''
    elapsed, command = 0.0, None
    timeline: list[tuple[float, float]] = []
    for number in range(MAX_STEPS):
        scale = 1.0 if command is None else speed_share(command.status, command.scale)
        tracking = tracker.update(held.pose, 0.0, elapsed, scale)
        elapsed = step_time
        timeline.append((tracking.progress, number * step_time))
        if tracking.phase in FINISHED:
            break
        try:
            command = find_command(held, friction, squeeze, tracking.twist, guard, step_time)
            moved = roll_held(held, friction, squeeze, step_time * command.roller_velocities)
        except ConfigurationError as error:
            why = f'{OUT_OF_REACH}: {error}'
            break
        except (GraspError, SolverError) as error:
            if number == 0:
                raise
            moved = str(error)
        if isinstance(moved, str):
            why = moved
            break
        held = moved
        least_margin = min(least_margin, held.slip_margin(friction))
        shift = np.array((1.0, 1.0, held.arm)) * pose_difference(held.pose, grips[-1].pose)
        if np.linalg.norm(shift) >= 0.5 * STEP:
            grips.append(held)
    if held is not grips[-1]:
        grips.append(held)
    if not why and tracking.phase is not PathPhase.REACHED:
        why = f'{OUT_OF_REACH}: {_describe_limits(command)}'
    share = tracking.progress if why else 1.0
    return Foresight(held.pose, share, least_margin, why, grips, np.array(timeline))


def _describe_limits(command: RollerCommand | None) -> str:
    """Return the names of the limits that end a motion with its last command."""
    if command is None:
        return 'no command'
    if command.limiting:
        return f'limits of {", ".join(command.limiting)}'
    if command.reachable_dof < 3:
        return f'the rollers move the object in {command.reachable_dof} of 3 directions'
    return 'the object stays behind the path'


def find_command(
    held: HeldGrip,
    friction: float,
    squeeze: float,
    twist: Array,
    guard: ShapeGuard,
    duration: float,
) -> RollerCommand:
    """Return the command of the control loop for a twist (3,) in a step [s], at a squeeze [N]."""
    opening = (squeeze - held.squeeze) / (held.squeeze_stiffness() * SQUEEZE_TIME)
    return guard_twist(guard, held.config, measure_gaps(held, friction), twist, duration, opening)


def guard_twist(
    guard: ShapeGuard,
    config: Configuration,
    grip: Grip,
    twist: Array,
    duration: float,
    opening: float = 0.0,
) -> RollerCommand:
    """Return the command of the control loop for a twist (3,) in a step [s]; see `solve_twist`."""

    def solve(config: Configuration, grip: Grip) -> tuple[Watch, RollerCommand]:
        watch = guard.watch(config, grip)
        limits = (*default_limits(config.robot), *watch.limits)
        return watch, solve_twist(config, grip, twist, (), limits, LOOP_HANDLING, opening)

    _, command = solve(config, grip)
    if command.scale == 1.0:
        return command
    # Where limits bind, they are linearised at the midpoint of the step, as in the loop. At its
    # start, errors of second order would add up to a smaller clearance or to a stop.
    speeds = command.roller_velocities
    middle = config.moved_to(config.roller_positions + 0.5 * duration * speeds)
    watch, command = solve(middle, roll_object(grip, config, middle))
    return watch.keep(command, speeds, duration)


def roll_held(held: HeldGrip, friction: float, squeeze: float, travel: Array) -> HeldGrip | str:
    """Return the grip after a roller travel (r,) [m], or the reason of a failure."""
    rolled = roll_grip(held, held.config.moved_to(held.config.roller_positions + travel))
    hold = HoldStatus.NO_BALANCE if rolled is None else rolled.hold(friction)
    if hold is not HoldStatus.HELD:
        return hold.value
    margin, bound = rolled.slip_margin(friction), MIN_RELATIVE_MARGIN * squeeze
    if margin < bound:
        reached, needed = distinct_numbers(margin, bound)
        return f'the slip margin is {reached} N; must be at least {needed} N'
    return rolled
