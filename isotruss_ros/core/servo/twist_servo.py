# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Twist servo: in every cycle, a roller command from the latest inputs, or a halt.

The twist is that of the held object or, without an object, of a joint.

Each cycle starts from the measured state. A measurement is old when it is used: since then the
rollers have followed the commands sent, so the servo predicts where the robot is. Commands from
before the measurement do not count, so motion resumes from any state of robot and object.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import partial
import importlib
from typing import Any

from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.holding.held_grip import HoldStatus
from isotruss_ros.core.inputs import (
    CommandHistory,
    fresh_pressures,
    Input,
    InputError,
    PRESSURE_TIMEOUT,
    require_fresh,
    StampedInput,
)
from isotruss_ros.core.kinematics.configuration import Configuration, ConfigurationTracker
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.acceleration import limit_acceleration, limit_change
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.limit_handling import LimitHandling
from isotruss_ros.core.manipulation.limits import default_limits, Limit, stack_rows
from isotruss_ros.core.manipulation.rolling_grip import roll_object
from isotruss_ros.core.manipulation.solve_joint_velocity import check_joint, solve_joint_velocity
from isotruss_ros.core.manipulation.solve_twist import solve_twist
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.manipulation.task import working_rollers
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.safety.roller_failure import FailureDetector
from isotruss_ros.core.safety.shape_guard import ShapeBounds, ShapeGuard
from isotruss_ros.core.servo.decision import Decision, describe, halt_for, HaltError
from isotruss_ros.core.servo.squeeze_control import SqueezeControl
import numpy as np

#: While no command moves a held object, it is followed this often [s] ...
WATCH_PERIOD = 0.1
#: ... in these states.
AT_REST = (Status.HALT_NO_TWIST, Status.HALT_INVALID_TWIST, Status.HALT_EMERGENCY_STOP)
#: Period of the comparison of measured and commanded travel [s].
DETECTION_PERIOD = 0.02


class TwistServo:
    """
    State of the control loop: its settings and the latest input of each kind.

    :ivar twist: input of (vx, vy, omega) in the robot frame [m/s, rad/s].
    :ivar rollers: input of the measured `RollerState`.
    :ivar pose: input of the measured `Pose` of the object, robot frame.
    :ivar pressures: input of the (t,) gauge pressures of the tubes, with which the squeeze is
        regulated; those of the robot file if None [Pa].
    :ivar pressure_timeout: pressures older than this are not used [s].
    :ivar estimate: input of the `EstimatedTravel` whose offsets the rollers have; None without
        one.
    :ivar stopped: status and reason of a halt that does not depend on inputs; None without one.
    :ivar guard: bounds on the configuration; None for those of the robot file only.
    :ivar limits: of the rollers and the members; those of the robot file to begin with.
    :ivar slide_along_limits: rather than stop at limits of lengths and shapes.
    :ivar max_acceleration: largest change of a roller's speed in a second; that of the robot file
        to begin with. Halts do not obey it [m/s^2].
    :ivar detector: detects rollers that fail; None for no detection.
    :ivar squeeze: regulates how hard the robot squeezes; None keeps the angle of the grip (14).
    :ivar grip: how the object is held, wherever it is: its pose is the measured one.
    :param robot: the robot.
    :param grip: see there.
    :param period: time from cycle to cycle [s].
    :param timeout: inputs older than this stop the rollers [s].
    """

    def __init__(self, robot: Robot, grip: Grip, period: float, timeout: float) -> None:
        self.robot = robot
        self.grip = grip
        self.period = period
        self.timeout = timeout
        self.twist: Input = None
        self.rollers: Input = None
        self.pose: Input = None
        self.pressures: Input = None
        self.pressure_timeout = PRESSURE_TIMEOUT
        self.estimate: Input = None
        self.stopped: tuple[Status, str] | None = None
        self.guard: ShapeGuard | None = ShapeGuard(robot, ShapeBounds())
        self.limits: Sequence[Limit] = default_limits(robot)
        self.slide_along_limits = True
        self.max_acceleration = robot.description.max_acceleration
        self.detector: FailureDetector | None = None
        self.squeeze: SqueezeControl | None = None
        self._joint: str | None = None
        self._failed: frozenset[str] = frozenset()
        self._history = CommandHistory(len(robot.roller_names))
        self._regulated: float | None = None  # the time of the last cycle of the squeeze control
        self._detected: float | None = None  # the time of the rollers that were compared last
        self._tracker = ConfigurationTracker(robot.home)
        # SciPy loads its parts when they are first used: not in a cycle.
        for part in ('scipy.interpolate', 'scipy.optimize'):
            importlib.import_module(part)

    @property
    def failed(self) -> frozenset[str]:
        """Return the failed rollers, named or detected."""
        return self._failed if self.detector is None else self._failed | self.detector.failed

    @failed.setter
    def failed(self, names: Collection[str]) -> None:
        """
        Set the named failed rollers; detected ones persist until `detector.reset`.

        :param names: names of the rollers.
        :raises GraspError: the robot has no such roller.
        """
        working_rollers(self.robot, frozenset(names))
        self._failed = frozenset(names)

    @property
    def joint(self) -> str | None:
        """Return the name of the joint moved by twists; None for the object."""
        return self._joint

    @joint.setter
    def joint(self, name: str | None) -> None:
        """
        Set the joint moved by twists; the rollers halt until the next twist.

        :param name: of the joint, which moves without an object; None for the object.
        :raises GraspError: the robot has no such joint.
        """
        if name == self._joint:
            return
        if name is not None:
            check_joint(self.robot, name)
        self._joint, self.twist = name, None
        if self.squeeze is not None:
            self.squeeze.acknowledge()

    @single_threaded
    def decide(self, now: float) -> Decision:
        """
        Return the roller command for the cycle that begins now.

        Never raises for an input: a fault becomes a halt with a status and a message.

        :param now: time on the clock of the inputs [s].
        """
        self._history.discard_old(now, self.timeout + 2.0 * self.period)
        self._detect()
        twist, failed, squeeze = np.zeros(3), self.failed, self.squeeze
        inputs: dict[str, Any] = {'twist': self.twist, 'joint_states': self.rollers}
        if self._joint is None:
            inputs['object_pose'] = self.pose
        try:
            if self.stopped is not None:
                raise HaltError(*self.stopped)
            given, rollers, *pose = require_fresh(now, self.timeout, **inputs)
            twist = np.asarray(given.value)
            command = self._solve(twist, rollers, pose, now, failed)
            told = '' if command.status is Status.OK else describe(command, self._joint is None)
            message = '; '.join(filter(None, (told, squeeze and squeeze.note())))
        except IsotrussError as error:
            status, message = halt_for(error), str(error)
            if isinstance(error, InputError) and error.name != 'twist':  # which comes first
                twist = np.asarray(self.twist.value)  # type: ignore[union-attr]
            if squeeze is not None and status is Status.HALT_NO_GRASP:
                squeeze.lose()
            elif squeeze is not None:
                self._watch(squeeze, status, now)
            stopped = np.zeros(len(self.robot.roller_names))
            command = RollerCommand(stopped, np.zeros(3), 0.0, status)
        self._history.record(now, command.roller_velocities)
        names = tuple(name for name in self.robot.roller_names if name in failed)
        decision = Decision(command, twist, message, names)
        if squeeze is None or squeeze.grasp is None:
            return decision
        return replace(
            decision,
            frequency=squeeze.frequency or 0.0,
            pose_gain=squeeze.gains.pose,
            squeeze=squeeze.squeeze,
            pose_delay=squeeze.belief.delay,
        )

    def command(self, velocities: Array, now: float) -> Array:
        """
        Return given roller velocities (r,), limited, instead of those for a twist [m/s].

        They count for the prediction of the next commands and for the detection of failures.

        :param velocities: (r,) that are asked for; zeros stop the rollers at once [m/s].
        :param now: time on the clock of the inputs [s].
        """
        self._history.discard_old(now, self.timeout + 2.0 * self.period)
        self._detect()
        last = np.zeros(len(velocities)) if self._history.last is None else self._history.last
        if velocities.any():
            velocities = limit_change(velocities, last, self._largest_change(now))
        self._history.record(now, velocities)
        if self.squeeze is not None:
            self.squeeze.acknowledge()
        return velocities

    def _detect(self) -> None:
        """Compare the commanded roller travel with the measured one."""
        if self.detector is None or not isinstance(self.rollers, StampedInput):
            return
        state, time = self.rollers.value, self.rollers.time
        before = self._detected
        if before is not None and 0.0 <= time - before < DETECTION_PERIOD:
            return
        commanded = np.zeros(len(state.positions))
        if before is not None and time > before:
            commanded = self._history.travel(before, time, commanded) / (time - before)
        self._detected = time
        # Zeros that are corrected are no travel.
        self.detector.update(state.positions - state.offsets, time, commanded)

    def _solve(
        self,
        twist: Array,
        rollers: StampedInput,
        pose: Sequence[StampedInput],
        now: float,
        failed: frozenset[str],
    ) -> RollerCommand:
        """
        Solve for the configuration at the midpoint of the command's cycle.

        A command for the measured configuration, which is older, would have a first-order error.
        """
        config, grip, last = self._predict(rollers, pose, now, failed)
        watch = None if self.guard is None else self.guard.watch(config, grip)
        limits = self.limits if watch is None else (*self.limits, *watch.limits)
        handling = LimitHandling(self.slide_along_limits, self.period)

        def solve(grip: Grip, twist: Array, opening_rate: float = 0.0) -> RollerCommand:
            return solve_twist(config, grip, twist, failed, limits, handling, opening_rate)

        if grip is None:
            command = self._solve_joint(config, twist, failed, limits, handling)
        elif self.squeeze is None:
            command = solve(grip, twist)
        else:
            hold = self._follow(self.squeeze, config, grip, rollers, pose[0], now)
            command = self._regulate(self.squeeze, hold, twist, solve)
        asked = command
        if command.status < Status.HALT_NO_TWIST:
            change = self._largest_change(now)
            command = limit_acceleration(command, last, change, lambda: stack_rows(config, limits))
        if watch is not None:
            command = watch.keep(command, last, self.period)
        if grip is not None and self.squeeze is not None:
            missing = asked.achieved_twist - command.achieved_twist
            self.squeeze.advance(twist, asked, missing)
        return command

    @property
    def _touching(self) -> Grip:
        """Return the grip, with the contacts of the held object's model where there is one."""
        belief = None if self.squeeze is None else self.squeeze.belief
        return self.grip if belief is None else belief.grip

    def _largest_change(self, now: float) -> float:
        """Return the largest change of a roller's speed since the last command [m/s]."""
        # Timers are early now and then; late cycles have held their command for longer.
        return self.max_acceleration * max(self._history.elapsed(now, 0.0), self.period)

    def _solve_joint(
        self,
        config: Configuration,
        twist: Array,
        failed: frozenset[str],
        limits: Sequence[Limit],
        handling: LimitHandling,
    ) -> RollerCommand:
        """Solve for the velocity of the joint."""
        if twist[2] != 0.0:
            raise HaltError(
                Status.HALT_INVALID_TWIST,
                f'twist with {twist[2]:.4g} rad/s: a joint has no orientation; must be 0',
            )
        velocities = {self._joint: twist[:2]}
        found = solve_joint_velocity(config, velocities, failed, limits, handling)
        return replace(found, achieved_twist=np.append(found.achieved_twist, 0.0))

    def _predict(
        self,
        rollers: StampedInput,
        pose: Sequence[StampedInput],
        now: float,
        failed: frozenset[str],
    ) -> tuple[Configuration, Grip | None, Array]:
        """Return predicted robot and object at the midpoint of the cycle, and the last command."""
        still = np.array([name in failed for name in self.robot.roller_names])
        before, travel, last = self._history.expected_travel(
            rollers, (pose or [rollers])[0].time, now, 0.5 * self.period, still
        )
        measured, config = self._tracker.predict(rollers.value.positions, travel)
        if not pose:
            return config, None, last
        # From where it was measured on, the object rolls in its contacts.
        start = measured.predict(before) if before.any() else measured
        grip = roll_object(self._touching.moved_to(pose[0].value), start, config)
        return config, grip, last

    def _watch(self, squeeze: SqueezeControl, status: Status, now: float) -> None:
        """Update the belief of a resting object periodically; drop it without valid inputs."""
        before = self._regulated
        if before is not None and 0.0 <= now - before < WATCH_PERIOD:
            squeeze.rest()
            return
        self._regulated = now
        try:
            if status not in AT_REST or self._joint is not None:
                raise HaltError(status, 'where the object is is not known')
            inputs: dict[str, Any] = {'joint_states': self.rollers, 'object_pose': self.pose}
            rollers, pose = require_fresh(now, self.timeout, **inputs)
            config, grip, _ = self._predict(rollers, [pose], now, self.failed)
            self._regulated, known = before, squeeze.fault
            self._follow(squeeze, config, grip, rollers, pose, now)
            if known is None and squeeze.fault is not None:  # somebody took it away
                squeeze.acknowledge()
            squeeze.rest()
        except IsotrussError:
            squeeze.reset()

    def _follow(
        self,
        squeeze: SqueezeControl,
        config: Configuration,
        grip: Grip,
        rollers: StampedInput,
        pose: StampedInput,
        now: float,
    ) -> HoldStatus:
        """Propagate the belief of the held object to the midpoint of the cycle."""
        estimate = self.estimate
        covariance = estimate.value.covariance if isinstance(estimate, StampedInput) else None
        squeeze.take_offsets(rollers.value.offsets, covariance)
        squeeze.take_pressures(fresh_pressures(now, self.pressure_timeout, self.pressures))
        # A loop that is late holds its commands for longer than its period.
        before, self._regulated = self._regulated, now
        elapsed = 0.0 if before is None else min(now - before, self.timeout)
        sample = pose.value, now + 0.5 * self.period - pose.time
        return squeeze.follow(config, self.grip.moved_to(grip.body.pose), elapsed, sample)

    def _regulate(
        self,
        squeeze: SqueezeControl,
        hold: HoldStatus,
        twist: Array,
        solve: Callable[..., RollerCommand],
    ) -> RollerCommand:
        """Solve with regulation of the squeeze, by the belief of the held object."""
        if squeeze.grasp is None or (hold is not HoldStatus.HELD and squeeze.fault is None):
            why = f'the object is not held: {hold.value}'
            raise HaltError(Status.HALT_NOT_HELD, '; '.join(filter(None, (why, squeeze.note()))))
        return squeeze.solve(twist, self.period, partial(solve, squeeze.belief.grip))
