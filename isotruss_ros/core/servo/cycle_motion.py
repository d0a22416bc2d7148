# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Motion in one cycle: the state predicted at its midpoint, and the command for this state."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

from isotruss_ros.core.inputs import StampedInput
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.acceleration import limit_acceleration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.limit_handling import LimitHandling, LOOP_SOFT_RANK
from isotruss_ros.core.manipulation.limits import Limit, stack_rows
from isotruss_ros.core.manipulation.rolling_grip import roll_object
from isotruss_ros.core.manipulation.solve_twist import solve_joint_velocity, solve_twist
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.model.obstacle import Obstacle
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.records import replace
from isotruss_ros.core.servo.decision import HaltError
from isotruss_ros.core.servo.obstacle_evasion import evade
from isotruss_ros.core.servo.servo_memory import ServoMemory, ServoSetup
from isotruss_ros.core.servo.squeeze_control import SqueezeControl
import numpy as np


class PredictedState(NamedTuple):
    """State predicted at the midpoint of a cycle."""

    config: Configuration  #: configuration of the robot
    grip: Grip | None  #: grip of the object; None if twists move a joint
    speeds: Array  #: (r,) speeds of the rollers by the last command [m/s]


def predict(
    setup: ServoSetup,
    memory: ServoMemory,
    failed: frozenset[str],
    rollers: StampedInput,
    pose: StampedInput | None,
    now: float,
) -> PredictedState:
    """Return configuration and grip predicted at mid-cycle."""
    is_failed = np.array([name in failed for name in setup.robot.roller_names])
    stamp, lead, history = (pose or rollers).time, 0.5 * setup.settings.period, memory.history
    to_pose, travel, last = history.expected_travel(rollers, stamp, now, lead, is_failed)
    measured = memory.config
    config = measured.predict(travel)
    if pose is None:
        return PredictedState(config, None, last)
    belief = None if memory.squeeze is None else memory.squeeze.tracker.belief
    if belief is not None:
        return PredictedState(config, belief.cache.grip, last)
    # The object rolls from its measured pose, at the configuration of that time.
    start = measured.predict(to_pose) if to_pose.any() else measured
    grip = roll_object(setup.settings.grip.moved_to(pose.value), start, config)
    return PredictedState(config, grip, last)


def solve(
    setup: ServoSetup,
    memory: ServoMemory,
    predicted: PredictedState,
    failed: frozenset[str],
    twist: Array,
    now: float,
    moving: Sequence[Obstacle] = (),
) -> tuple[SqueezeControl | None, RollerCommand, str]:
    """
    Return the command for the state predicted at the cycle's midpoint, and a note on obstacles.

    The poses of `moving` obstacles are those when the next command follows.
    """
    settings, squeeze, (config, contacts, last_speeds) = setup.settings, memory.squeeze, predicted
    # The twist moves the `contacts` of the equilibrium without load; the limits are those of the
    # object at its estimated pose (`grip`).
    grip = contacts
    if contacts is None:
        squeeze = None
    if squeeze is not None:
        belief = squeeze.tracker.belief
        contacts = belief.cache.grip
        grip = contacts.moved_to(belief.pose)

    # Command within the limits on roller speeds.
    watch = None if setup.guard is None else setup.guard.watch(config, grip, moving)
    limits = setup.limits if watch is None else (*setup.limits, *watch.limits)
    handling = LimitHandling(settings.slide_along_limits, True, LOOP_SOFT_RANK)

    def solve(twist: Array, opening_rate: float = 0.0) -> RollerCommand:
        return solve_twist(config, contacts, twist, failed, limits, handling, opening_rate)

    if grip is None:
        desired = _solve_joint(settings.joint, config, twist, failed, limits, handling)
    elif squeeze is None:
        desired = solve(twist)
    else:
        wanted = settings.squeeze, twist, settings.period, solve
        squeeze, desired, correction = squeeze.command(*wanted)

    # Command within the limits on acceleration and, in discrete time, on the barriers.
    command, note = desired, ''
    if watch is not None:
        command, note = evade(desired, watch, limits, failed)
    if command.status < Status.HALT_NO_TWIST:
        last_step, elapsed = memory.history.step, time_since_command(setup, memory, now)
        largest = setup.robot.description.max_acceleration * elapsed
        arm = None if grip is None else grip.body.arm
        object_change = settings.max_object_acceleration * elapsed
        velocity = memory.velocity if memory.velocity.any() else None  # unknown at first
        rows = partial(stack_rows, config, limits)
        command = limit_acceleration(
            command, last_speeds, last_step, largest, rows, arm, object_change, velocity
        )
    if watch is not None:
        command = watch.keep(command, last_speeds, time_since_command(setup, memory, now))
    if squeeze is not None:
        missing = desired.achieved_twist - command.achieved_twist
        squeeze = squeeze.advanced(twist, desired, correction, missing)
    return squeeze or memory.squeeze, command, note


def time_since_command(setup: ServoSetup, memory: ServoMemory, now: float) -> float:
    """Return the time in which velocities may change since the last command [s]."""
    # A cycle may be early; a late cycle may change its command by more.
    return max(memory.history.elapsed(now), setup.settings.period)


def _solve_joint(
    joint: str,
    config: Configuration,
    twist: Array,
    failed: frozenset[str],
    limits: Sequence[Limit],
    handling: LimitHandling,
) -> RollerCommand:
    """Return the roller command for a desired velocity of the joint."""
    if twist[2] != 0.0:
        words = f'twist with {twist[2]:.4g} rad/s: a joint has no orientation; must be 0'
        raise HaltError(Status.HALT_INVALID_TWIST, words)
    command = solve_joint_velocity(config, {joint: twist[:2]}, failed, limits, handling)
    return replace(command, achieved_twist=np.append(command.achieved_twist, 0.0))
