# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Twist servo, which computes a roller command or a halt from the latest inputs in every cycle.

The twist is the desired velocity of the held object or, without an object, of a joint.

Each cycle starts from the last measured state. The rollers have followed the commands since this
measurement, so the servo predicts the current state from these commands. Commands before the
measurement have no influence, so motion can resume from any state of robot and object.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
import math
from typing import Any

from isotruss_ros.core.errors import ConfigurationError, IsotrussError
from isotruss_ros.core.holding.held_grip import HoldStatus
from isotruss_ros.core.inputs import (
    fresh_pressures,
    InputError,
    require_fresh,
    StampedInput,
    Timeline,
)
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.acceleration import limit_acceleration, limit_change
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.limit_handling import LimitHandling, LOOP_SOFT_RANK
from isotruss_ros.core.manipulation.limits import Limit, stack_rows
from isotruss_ros.core.manipulation.rolling_grip import roll_object
from isotruss_ros.core.manipulation.solve_twist import solve_joint_velocity, solve_twist
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.numerics.arrays import Array, finite_array
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.work_limit import limited_work
from isotruss_ros.core.servo.decision import Decision, describe, halt_for, HaltError
from isotruss_ros.core.servo.servo_state import ServoState
from isotruss_ros.core.servo.squeeze_control import SqueezeControl
import numpy as np

#: Period of the updates of the estimated grip while the object is at rest [s].
WATCH_PERIOD = 0.1
#: Statuses in which the object is at rest.
AT_REST = (Status.HALT_NO_TWIST, Status.HALT_INVALID_TWIST, Status.HALT_EMERGENCY_STOP)
#: Largest work of a cycle, see `work_limit` [-]. In 4,800 cycles with random grips, no search took
#: more than 60 steps of Newton's method. One start in ten takes a third of this bound; three times
#: of it is more than any of these cycles did without a bound (138).
MAX_CYCLE_WORK = 64
#: Period of the comparison of measured with commanded travel [s].
DETECTION_PERIOD = 0.02


class TwistServo(ServoState):
    """
    Control loop from twists to roller commands: settings, latest inputs and state.

    :ivar settings: current settings, replaced by `apply`.
    :ivar inputs: latest inputs, replaced by `receive`.
    :ivar detector: detector of failed rollers.
    :ivar squeeze: squeeze control; None if the opening angle is held constant instead.
    :param robot: the robot.
    :param settings: settings, see `ServoSettings`.
    :param inputs: inputs that the client replaces itself; None: inputs of this servo only.
    :raises GraspError: the robot has no such joint.
    """

    @property
    def failed(self) -> frozenset[str]:
        """Return the names of failed rollers, which the client declared or which were detected."""
        return self.inputs.failed | self.detector.failed

    @single_threaded
    @limited_work(MAX_CYCLE_WORK)
    def decide(self, now: float) -> Decision:
        """
        Return the roller command for the cycle that begins now.

        A fault of an input raises no error; it results in a halt with a status and a message.

        :param now: current time on the clock of the inputs [s].
        """
        settings, received, squeeze = self.settings, self.inputs, self.squeeze
        self._begin_cycle(now)
        twist, failed, is_solved = np.zeros(3), self.failed, False
        inputs: dict[str, Any] = {'twist': received.twist, 'joint_states': received.rollers}
        if settings.joint is None:
            inputs['object_pose'] = received.pose
        try:
            if received.halt is not None:
                raise HaltError(*received.halt)
            stamped_twist, rollers, *pose = require_fresh(now, settings.timeout, **inputs)
            twist = np.asarray(stamped_twist.value)
            if pose:
                positions, arm = rollers.value.positions, settings.grip.body.arm
                repeated = self._repeated_pose.updated(pose[0], positions, now, settings.timeout)
                self._repeated_pose = repeated
                repeated.check(settings.timeout, arm)
            command = self._solve(twist, rollers, pose[0] if pose else None, now)
            self._repeated_pose = replace(self._repeated_pose, velocity=command.achieved_twist)
            ok = command.status is Status.OK
            message, is_solved = '' if ok else describe(command, settings.joint is None), True
        except IsotrussError as error:
            command, message = self._halt(halt_for(error), now), str(error)
            # The twist is checked first, so a fault of another input leaves it valid.
            if isinstance(error, InputError) and error.name != 'twist':
                twist = np.asarray(received.twist.value)  # type: ignore[union-attr]
        self._history = self._history.recorded(now, command.roller_velocities)
        names = tuple(name for name in self.robot.roller_names if name in failed)
        if squeeze is None or squeeze.belief is None:
            return Decision(command, twist, message, names)
        force = squeeze.belief.squeeze, squeeze.belief.squeeze_deviation
        if is_solved:
            message = '; '.join(filter(None, (message, squeeze.note(force))))
        return Decision(
            command,
            twist,
            message,
            names,
            squeeze.frequency or 0.0,
            squeeze.gain,
            force,
            squeeze.belief.state.delay,
            None if squeeze.reference is None else Pose(*squeeze.reference.tolist()),
        )

    def _halt(self, status: Status, now: float) -> RollerCommand:
        """Return the command that stops the rollers, and update the belief of the grip."""
        if self.squeeze is not None and status is Status.HALT_NO_GRASP:
            self.squeeze.lose()
        elif self.squeeze is not None:
            self._watch(self.squeeze, status, now)
        return RollerCommand(np.zeros(len(self.robot.roller_names)), np.zeros(3), 0.0, status)

    def command(self, velocities: Array, now: float) -> Array:
        """
        Return the desired roller velocities (r,), limited by the largest acceleration [m/s].

        It is called instead of `decide` in a cycle in which the client commands roller velocities
        directly. The result is recorded for the prediction and for the detection of failures.

        :param velocities: (r,) desired velocities [m/s]; zeros stop the rollers at once.
        :param now: current time on the clock of the inputs [s].
        """
        velocities = self.robot.check_rollers(velocities, 'roller velocities [m/s]')
        self._begin_cycle(now)
        last = np.zeros(len(velocities)) if self._history.last is None else self._history.last
        if velocities.any():
            velocities = limit_change(velocities, last, self._largest_change(now))
        self._history = self._history.recorded(now, velocities)
        if self.squeeze is not None:
            self.squeeze.acknowledge()
        return velocities

    def _begin_cycle(self, now: float) -> None:
        """Discard old commands, and update the failed rollers by commands and measured travel."""
        finite_array([now], 1, 'time of the cycle [s]', ConfigurationError)
        self._history = self._history.recent(now, self.settings.timeout)
        rollers = self.inputs.rollers
        if not isinstance(rollers, StampedInput):
            return
        elapsed = rollers.time - self._detection_time
        if 0.0 <= elapsed < DETECTION_PERIOD:
            return
        speeds = np.zeros(len(self.robot.roller_names))
        if elapsed > 0.0:
            speeds = self._history.travel(self._detection_time, rollers.time, speeds) / elapsed
        self._detection_time = rollers.time
        # A correction of an offset is not travel of a roller.
        self.detector.update(rollers.value.positions - rollers.value.offsets, rollers.time, speeds)

    def _solve(
        self, twist: Array, rollers: StampedInput, pose: StampedInput | None, now: float
    ) -> RollerCommand:
        """Return the command for the configuration predicted at the cycle's midpoint."""
        config, predicted, last_speeds = self._predict(rollers, pose, now)
        squeeze = None if predicted is None else self.squeeze
        # The twist moves the `contacts` of the equilibrium without load; the limits are those of
        # the object at its estimated pose (`grip`).
        contacts = grip = predicted
        if squeeze is not None:
            hold = self._follow(squeeze, config, predicted, (rollers, pose), now, gripped=True)
            if squeeze.belief is None:
                reasons = f'the object is not held: {hold.value}', squeeze.note()
                raise HaltError(Status.HALT_NOT_HELD, '; '.join(filter(None, reasons)))
            contacts = squeeze.belief.cache.grip
            grip = contacts.moved_to(squeeze.belief.pose)

        # Command within the limits on roller speeds.
        watch = None if self._guard is None else self._guard.watch(config, grip)
        period = self.settings.period
        limits = self._limits if watch is None else (*self._limits, *watch.limits)
        handling = LimitHandling(self.settings.slide_along_limits, True, LOOP_SOFT_RANK)

        def solve(twist: Array, opening_rate: float = 0.0) -> RollerCommand:
            options = self.failed, limits, handling, opening_rate
            return solve_twist(config, contacts, twist, *options)

        if grip is None:
            desired = self._solve_joint(config, twist, limits, handling)
        else:
            desired = solve(twist) if squeeze is None else squeeze.solve(twist, period, solve)

        # Command within the limits on acceleration and, in discrete time, on the barriers.
        command = desired
        if desired.status < Status.HALT_NO_TWIST:
            last_step, largest = self._history.step, self._largest_change(now)
            arm = None if grip is None else grip.body.arm
            rows = partial(stack_rows, config, limits)
            command = limit_acceleration(desired, last_speeds, last_step, largest, rows, arm)
        if watch is not None:
            command = watch.keep(command, last_speeds, period)
        if squeeze is not None:
            squeeze.advance(twist, desired, desired.achieved_twist - command.achieved_twist)
        return command

    def _largest_change(self, now: float) -> float:
        """Return the largest change of a roller's velocity since the last command [m/s]."""
        # A cycle may be early; a late cycle may change its command by more.
        elapsed = max(self._history.elapsed(now), self.settings.period)
        return self.robot.description.max_acceleration * elapsed

    def _solve_joint(
        self, config: Configuration, twist: Array, limits: Sequence[Limit], handling: LimitHandling
    ) -> RollerCommand:
        """Return the roller command for a desired velocity of the joint."""
        if twist[2] != 0.0:
            words = f'twist with {twist[2]:.4g} rad/s: a joint has no orientation; must be 0'
            raise HaltError(Status.HALT_INVALID_TWIST, words)
        velocities = {self.settings.joint: twist[:2]}
        command = solve_joint_velocity(config, velocities, self.failed, limits, handling)
        return replace(command, achieved_twist=np.append(command.achieved_twist, 0.0))

    def _predict(
        self, rollers: StampedInput, pose: StampedInput | None, now: float
    ) -> tuple[Configuration, Grip | None, Array]:
        """Return configuration and grip predicted at mid-cycle, and the last speeds [m/s]."""
        failed = self.failed
        is_failed = np.array([name in failed for name in self.robot.roller_names])
        stamp, lead = (pose or rollers).time, 0.5 * self.settings.period
        to_pose, travel, last = self._history.expected_travel(rollers, stamp, now, lead, is_failed)
        measured = self._tracker.configuration(rollers.value.positions)
        config = measured.predict(travel)
        if pose is None:
            return config, None, last
        if self.squeeze is not None and self.squeeze.belief is not None:
            return config, self.squeeze.belief.cache.grip, last
        # The object rolls from its measured pose, at the configuration of that time.
        start = measured.predict(to_pose) if to_pose.any() else measured
        grip = roll_object(self.settings.grip.moved_to(pose.value), start, config)
        return config, grip, last

    def _watch(self, squeeze: SqueezeControl, status: Status, now: float) -> None:
        """Update the belief of the grip while the object rests; discard it on invalid inputs."""
        squeeze.rest()
        if self._regulated is not None and 0.0 <= now - self._regulated < WATCH_PERIOD:
            return
        try:
            if status not in AT_REST or self.settings.joint is not None:
                raise HaltError(status, 'the pose of the object is unknown')
            inputs, timeout = self.inputs, self.settings.timeout
            rollers, pose = require_fresh(
                now, timeout, joint_states=inputs.rollers, object_pose=inputs.pose
            )
            config, grip, _ = self._predict(rollers, pose, now)
            had_fault = squeeze.fault is not None
            self._follow(squeeze, config, grip, (rollers, pose), now)
            if squeeze.fault is not None and not had_fault:  # the object was removed at rest
                squeeze.acknowledge()
        except IsotrussError:
            squeeze.reset()

    def _follow(
        self,
        squeeze: SqueezeControl,
        config: Configuration,
        grip: Grip,
        inputs: Sequence[StampedInput],
        now: float,
        gripped: bool = False,
    ) -> HoldStatus:
        """Propagate the belief to mid-cycle by inputs (rollers, pose); return the hold status."""
        (rollers, pose), settings = inputs, self.settings
        estimate, pressures = self.inputs.estimate, self.inputs.pressures
        covariance, stamp = None, math.nan
        if isinstance(estimate, StampedInput):
            covariance, stamp = estimate.value.covariance, estimate.time
        squeeze.take_offsets(rollers.value.offsets, covariance, stamp)
        squeeze.take_pressures(fresh_pressures(now, settings.pressure_timeout, pressures))
        # In a late loop, commands are valid for longer than the period.
        before, self._regulated = self._regulated, now
        elapsed = 0.0 if before is None else min(now - before, settings.timeout)
        # The sample is the last pose up to the time of the rollers; later poses are stored until
        # the travel up to them is measured.
        if squeeze.belief is None:
            self._poses = Timeline()
        self._poses = self._poses.added(pose.time, pose).since(rollers.time)
        pose_time, measured_pose = self._poses.first
        mid_cycle = now + 0.5 * settings.period
        sample = measured_pose, mid_cycle - pose_time
        readings = rollers.value.positions, mid_cycle - rollers.time
        return squeeze.follow(config, grip, elapsed, sample, gripped, readings)
