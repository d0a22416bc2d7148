# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Cycle of the twist servo: from its memory and the latest inputs to a new memory and a decision.

Each cycle starts from the last measured state. The rollers have followed the commands since this
measurement, so the servo predicts the current state from these commands. Commands before the
measurement have no influence, so motion can resume from any state of robot and object.
"""

from __future__ import annotations

from typing import Any

from isotruss_ros.core.errors import ConfigurationError, IsotrussError
from isotruss_ros.core.holding.held_grip import HoldStatus
from isotruss_ros.core.inputs import (
    fresh_pressures,
    has_ended,
    InputError,
    LatestInputs,
    require_fresh,
    StampedInput,
    Timeline,
)
from isotruss_ros.core.manipulation.acceleration import limit_change
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.numerics.arrays import Array, finite_array
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.records import replace
from isotruss_ros.core.numerics.work_limit import limited_work
from isotruss_ros.core.servo.cycle_motion import predict, PredictedState, solve, time_since_command
from isotruss_ros.core.servo.decision import Decision, describe, halt_for, HaltError
from isotruss_ros.core.servo.obstacle_evasion import require_obstacles
from isotruss_ros.core.servo.servo_memory import ServoMemory, ServoSetup
from isotruss_ros.core.servo.servo_settings import ServoSettings
from isotruss_ros.core.servo.squeeze_control import SqueezeControl
import numpy as np

#: Period of the updates of the estimated grip while the object is at rest [s].
WATCH_PERIOD = 0.1
#: Statuses in which the object is at rest.
AT_REST = (
    Status.HALT_NO_TWIST,
    Status.HALT_INVALID_TWIST,
    Status.HALT_EMERGENCY_STOP,
    Status.HALT_STALE_OBSTACLES,
    Status.HALT_INVALID_OBSTACLES,
    Status.HALT_OBSTACLE,
)
#: Largest work of a cycle, see `work_limit` [-]. In 4,800 cycles with random grips, no search took
#: more than 60 steps of Newton's method. One start in ten takes a third of this bound; three times
#: of it is more than any of these cycles did without a bound (138).
MAX_CYCLE_WORK = 64
#: Period of the comparison of measured with commanded travel [s].
DETECTION_PERIOD = 0.02


@single_threaded
@limited_work(MAX_CYCLE_WORK)
def step(
    setup: ServoSetup, memory: ServoMemory, inputs: LatestInputs, now: float
) -> tuple[ServoMemory, Decision]:
    """Return the memory after the cycle that begins now, and what `TwistServo.decide` returns."""
    settings, names = setup.settings, setup.robot.roller_names
    memory = begin_cycle(memory, inputs, settings, now)
    failed = inputs.failed | memory.detector.failed
    twist, is_solved = np.zeros(3), False
    required: dict[str, Any] = {'twist': inputs.twist, 'joint_states': inputs.rollers}
    if settings.joint is None:
        required['object_pose'] = inputs.pose
    try:
        if inputs.halt is not None:
            raise HaltError(*inputs.halt)
        stamped_twist, rollers, *poses = require_fresh(now, settings.timeout, **required)
        twist = np.asarray(stamped_twist.value)
        pose = poses[0] if poses else None
        memory = measure(memory, rollers, now, settings.timeout, pose)
        if pose is not None:
            memory.repeated_pose.check(settings.timeout, settings.grip.body.arm)
        predicted = predict(setup, memory, failed, rollers, pose, now)
        if memory.squeeze is not None and predicted.grip is not None:
            memory, hold = follow(memory, inputs, settings, predicted, rollers, pose, now, True)
            if isinstance(hold, IsotrussError):
                raise hold
            if memory.squeeze.tracker.belief is None:
                reasons = f'the object is not held: {hold.value}', memory.squeeze.note()
                raise HaltError(Status.HALT_NOT_HELD, '; '.join(filter(None, reasons)))
        obstacles = require_obstacles(inputs.obstacles, memory.obstacles, settings, now)
        tracks = replace(memory.obstacles.updated(obstacles), are_stale=False)
        memory = replace(memory, obstacles=tracks)
        # The next command follows after the period, or as late as this one.
        moving = tracks.predict(now + time_since_command(setup, memory, now))
        squeeze, command, note = solve(setup, memory, predicted, failed, twist, now, moving)
        ok = command.status is Status.OK
        message, is_solved = '' if ok else describe(command, settings.joint is None), True
        message = '; '.join(filter(None, (message, note)))
    except IsotrussError as error:
        status, message = halt_for(error), str(error)
        if status is Status.HALT_NO_TWIST and has_ended(now, settings.timeout, inputs.twist):
            message = 'nothing is commanded: the twists have ended'
        if status is Status.HALT_STALE_OBSTACLES:
            memory = replace(memory, obstacles=replace(memory.obstacles, are_stale=True))
        memory = halt(setup, memory, inputs, status, now)
        squeeze = memory.squeeze
        command = RollerCommand(np.zeros(len(names)), np.zeros(3), 0.0, status)
        # The twist is checked first, so a fault of another input leaves it valid.
        if isinstance(error, InputError) and error.name != 'twist':
            twist = np.asarray(inputs.twist.value)  # type: ignore[union-attr]
    history = memory.history.recorded(now, command.roller_velocities)
    memory = replace(memory, history=history, squeeze=squeeze, velocity=command.achieved_twist)
    listed = tuple(name for name in names if name in failed)
    return memory, _decide(squeeze, command, twist, message, listed, is_solved)


def _decide(
    squeeze: SqueezeControl | None,
    command: RollerCommand,
    twist: Array,
    message: str,
    failed: tuple[str, ...],
    is_solved: bool,
) -> Decision:
    """Return the decision of a cycle with a command and a message."""
    belief = None if squeeze is None else squeeze.tracker.belief
    if belief is None:
        return Decision(command, twist, message, failed)
    force = belief.squeeze, belief.squeeze_deviation
    if is_solved:
        message = '; '.join(filter(None, (message, squeeze.note(force))))
    return Decision(
        command,
        twist,
        message,
        failed,
        squeeze.frequency or 0.0,
        squeeze.gain,
        force,
        belief.state.delay,
        None if squeeze.reference is None else Pose(*squeeze.reference.tolist()),
    )


def step_command(
    setup: ServoSetup, memory: ServoMemory, inputs: LatestInputs, velocities: Array, now: float
) -> tuple[ServoMemory, Array]:
    """Return the memory after a cycle of `TwistServo.command`, and the limited velocities (r,)."""
    memory = begin_cycle(memory, inputs, setup.settings, now)
    last = np.zeros(len(velocities)) if memory.history.last is None else memory.history.last
    if velocities.any():
        elapsed = time_since_command(setup, memory, now)
        largest = setup.robot.description.max_acceleration * elapsed
        velocities = limit_change(velocities, last, largest)
    squeeze = None if memory.squeeze is None else memory.squeeze.acknowledged()
    history, unknown = memory.history.recorded(now, velocities), np.zeros(3)
    return replace(memory, history=history, squeeze=squeeze, velocity=unknown), velocities


def begin_cycle(
    memory: ServoMemory, inputs: LatestInputs, settings: ServoSettings, now: float
) -> ServoMemory:
    """Discard old commands, and update the failed rollers by commands and measured travel."""
    finite_array([now], 1, 'time of the cycle [s]', ConfigurationError)
    history, rollers = memory.history.recent(now, settings.timeout), inputs.rollers
    if not isinstance(rollers, StampedInput):
        return replace(memory, history=history)
    elapsed = rollers.time - memory.detected_at
    if 0.0 <= elapsed < DETECTION_PERIOD:
        return replace(memory, history=history)
    speeds = np.zeros(history.count)
    if elapsed > 0.0:
        speeds = history.travel(memory.detected_at, rollers.time, speeds) / elapsed
    # A correction of an offset is not travel of a roller.
    travel = rollers.value.positions - rollers.value.offsets
    detector = memory.detector.updated(travel, rollers.time, speeds)
    return replace(memory, history=history, detector=detector, detected_at=rollers.time)


def measure(
    memory: ServoMemory,
    rollers: StampedInput,
    now: float,
    timeout: float,
    pose: StampedInput | None = None,
) -> ServoMemory:
    """Update the measured configuration, which continues that of the last cycle, and the pose."""
    positions, config, repeated = rollers.value.positions, memory.config, memory.repeated_pose
    if pose is not None:
        repeated = repeated.updated(pose, positions, memory.velocity, now, timeout)
    if not np.array_equal(positions, config.roller_positions):
        try:
            config = config.moved_to(positions)
        except ConfigurationError:
            config = config.robot.home.moved_to(positions)
    return replace(memory, config=config, repeated_pose=repeated)


def follow(
    memory: ServoMemory,
    inputs: LatestInputs,
    settings: ServoSettings,
    predicted: PredictedState,
    rollers: StampedInput,
    pose: StampedInput,
    now: float,
    gripped: bool = False,
) -> tuple[ServoMemory, HoldStatus | IsotrussError]:
    """Propagate the belief to mid-cycle by the inputs; return the hold status."""
    # Offsets and pressures in the model of the grip.
    covariance, stamp = None, None
    if isinstance(inputs.estimate, StampedInput):
        covariance, stamp = inputs.estimate.value.covariance, inputs.estimate.time
    tracker = memory.squeeze.tracker.with_offsets(rollers.value.offsets, covariance, stamp)
    pressures = fresh_pressures(now, settings.pressure_timeout, inputs.pressures)
    squeeze = replace(memory.squeeze, tracker=tracker.with_pressures(pressures))
    # In a late loop, commands are valid for longer than the period.
    before = memory.followed_at
    elapsed = 0.0 if before is None else min(now - before, settings.timeout)
    # The sample is the last pose up to the time of the rollers; later poses are stored until the
    # travel up to them is measured.
    poses = Timeline() if tracker.belief is None else memory.poses
    poses = poses.added(pose.time, pose).since(rollers.time)
    pose_time, measured_pose = poses.first
    mid_cycle = now + 0.5 * settings.period
    sample = measured_pose, mid_cycle - pose_time
    readings = rollers.value.positions, mid_cycle - rollers.time
    squeeze, hold = squeeze.followed(
        settings.squeeze, *predicted[:2], elapsed, sample, gripped, readings
    )
    return replace(memory, squeeze=squeeze, followed_at=now, poses=poses), hold


def halt(
    setup: ServoSetup, memory: ServoMemory, inputs: LatestInputs, status: Status, now: float
) -> ServoMemory:
    """Update the tracked grip while the object rests; discard it on invalid inputs."""
    if memory.squeeze is None:
        return memory
    if status is Status.HALT_NO_GRASP:
        return replace(memory, squeeze=memory.squeeze.lost())
    memory = replace(memory, squeeze=memory.squeeze.at_rest())
    if memory.followed_at is not None and 0.0 <= now - memory.followed_at < WATCH_PERIOD:
        return memory
    settings, failed = setup.settings, inputs.failed | memory.detector.failed
    try:
        if status not in AT_REST or settings.joint is not None:
            raise HaltError(status, 'the pose of the object is unknown')
        rollers, pose = require_fresh(
            now, settings.timeout, joint_states=inputs.rollers, object_pose=inputs.pose
        )
        memory = measure(memory, rollers, now, settings.timeout)
        predicted = predict(setup, memory, failed, rollers, pose, now)
        had_fault = memory.squeeze.fault is not None
        memory, hold = follow(memory, inputs, settings, predicted, rollers, pose, now)
        if isinstance(hold, IsotrussError):
            raise hold
        if memory.squeeze.fault is not None and not had_fault:  # the object was removed at rest
            memory = replace(memory, squeeze=memory.squeeze.acknowledged())
    except IsotrussError:
        memory = replace(memory, squeeze=memory.squeeze.restarted())
    return memory
