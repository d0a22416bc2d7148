# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Twist servo and its inputs."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
import importlib
from typing import Any

from isotruss_ros.core.errors import ArgumentError, GraspError, IsotrussError, quote
from isotruss_ros.core.inputs import Input, LatestInputs, RejectedInput, StampedInput
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.manipulation.task import working_rollers
from isotruss_ros.core.model.convex_object import EXTERNAL_WRENCH
from isotruss_ros.core.model.obstacle import MAX_OBSTACLES, Obstacle
from isotruss_ros.core.model.topology import check_names
from isotruss_ros.core.numerics.argument_kinds import check_kind, check_kinds
from isotruss_ros.core.numerics.arrays import Array, covariance_matrix, finite_array, MAX_LOAD
from isotruss_ros.core.servo.decision import Decision
from isotruss_ros.core.servo.servo_memory import ServoMemory, ServoSetup
from isotruss_ros.core.servo.servo_settings import ServoSettings
from isotruss_ros.core.servo.servo_step import step, step_command
from isotruss_ros.core.servo.squeeze_control import SqueezeControl
from isotruss_ros.core.statics.tube_stiffness import tube_pressures

# Check of the numbers of a servo's inputs.

#: Kind of the value of an input that is not a list of numbers.
VALUE_KINDS = {'rollers': 'RollerState', 'estimate': 'EstimatedTravel'}


def check_input(robot: Robot, name: str, given: Input) -> Input:
    """
    Return an input of a servo, or a rejection with the reason if its numbers are invalid.

    Time, twist, pose, external wrench, roller state and roller offsets must be finite numbers of
    the required count, and a covariance must be positive semidefinite; see `tube_pressures`.
    """
    if name == 'halt':
        _check_halt(given)
        return given
    if name == 'failed':
        return given
    if not isinstance(given, StampedInput):
        check_kind(name, given, 'StampedInput', 'RejectedInput', 'None')
        return given
    if name in VALUE_KINDS:
        check_kind(f'{name}.value', given.value, VALUE_KINDS[name])
    words, value = name.replace('_', ' '), given.value
    rollers = len(robot.roller_names)
    try:
        finite_array([given.time], 1, f'time of {words} [s]', GraspError)
        if name in ('twist', 'pose'):
            finite_array(value, 3, words, GraspError)
        elif name == 'wrench':
            finite_array(value, 3, EXTERNAL_WRENCH, GraspError, MAX_LOAD)
        elif name == 'obstacles':
            _check_obstacles(value)
        elif name == 'pressures':
            tube_pressures(robot.description, value)
        elif name == 'rollers':
            for field, numbers in value._asdict().items():
                if field == 'offsets' and isinstance(numbers, float):  # of all rollers
                    numbers = [numbers] * rollers
                finite_array(numbers, rollers, f'{field} of {words}', GraspError)
        elif name == 'estimate':
            finite_array(value.offsets, rollers, 'estimated roller offsets [m]', GraspError)
            what = 'covariance of roller offsets [m^2]'
            covariance_matrix(value.covariance, rollers, what, GraspError)
    except IsotrussError as error:
        return RejectedInput(str(error))
    return given


def _check_halt(given: Any) -> None:
    """Raise ArgumentError unless a halt of the client is None, or a status and its reason."""
    match given:
        case None | (Status(), str()):
            return
    raise ArgumentError(f'halt: {given!r}: must be None, or a status and its reason')


def _check_obstacles(obstacles: Sequence[Obstacle]) -> None:
    """Raise GraspError unless moving obstacles are few, with stamps and different names."""
    check_kind('obstacles', obstacles, 'Sequence[Obstacle]')
    if len(obstacles) > MAX_OBSTACLES:
        words = f'{len(obstacles)} moving obstacles; must be at most {MAX_OBSTACLES}'
        raise GraspError(words)
    names = [obstacle.name for obstacle in obstacles]
    for number, obstacle in enumerate(obstacles):
        words = f'moving obstacle {quote(obstacle.name)}'
        if obstacle.stamp is None:
            raise GraspError(f'{words}: has no stamp; must be the time of its pose [s]')
        finite_array([obstacle.stamp], 1, f'stamp of {words} [s]', GraspError)
        if obstacle.name in names[:number]:
            raise GraspError(f'{words}: is given twice; names must differ')


# Twist servo, which computes a roller command or a halt from the latest inputs in every cycle.
#
# The twist is the desired velocity of the held object or, without an object, of a joint. What a
# cycle computes is in `servo_step`.


class TwistServo:
    """
    Control loop from twists to roller commands: settings, latest inputs and memory.

    :ivar inputs: latest inputs, replaced by `receive`.
    :ivar memory: what is remembered from cycle to cycle, replaced in each cycle.
    :param robot: the robot.
    :param settings: settings, see `ServoSettings`.
    :param inputs: inputs that the client replaces itself; None: inputs of this servo only.
    :raises GraspError: the robot has no such joint.
    """

    @check_kinds
    def __init__(
        self, robot: Robot, settings: ServoSettings, inputs: LatestInputs | None = None
    ) -> None:
        _check_joint(robot, settings)
        self.robot, self.inputs = robot, inputs or LatestInputs()
        self._setup = ServoSetup.of(robot, settings)
        self.memory = ServoMemory.of(robot, settings)
        # SciPy loads these parts at their first use, which must not be in a cycle.
        for part in ('scipy.interpolate', 'scipy.optimize'):
            importlib.import_module(part)

    @property
    def settings(self) -> ServoSettings:
        """Return the current settings, replaced by `apply`."""
        return self._setup.settings

    @property
    def squeeze(self) -> SqueezeControl | None:
        """Return the squeeze control; None if the opening angle is held constant instead."""
        return self.memory.squeeze

    @property
    def failed(self) -> frozenset[str]:
        """Return the names of failed rollers, which the client declared or which were detected."""
        return self.inputs.failed | self.memory.detector.failed

    def apply(self, settings: ServoSettings) -> None:
        """
        Replace the settings of the servo from the next cycle on.

        If the joint changes, the last twist is discarded. The squeeze control goes on unless it
        has a fault.

        :param settings: new settings.
        :raises GraspError: the robot has no such joint; then the old settings remain.
        """
        _check_joint(self.robot, settings)
        is_new_motion = settings.joint != self.settings.joint
        if is_new_motion:
            self.inputs.twist = None
        self.memory = self.memory.adapted(settings, is_new_motion)
        self._setup = ServoSetup.of(self.robot, settings)

    def receive(self, **inputs: Any) -> None:
        """
        Store new values of some inputs of the servo.

        Invalid numbers are replaced by a rejection, which halts the rollers; see `check_input`.

        :param inputs: new values; the keywords are the fields of `LatestInputs`.
        :raises ArgumentError: an input is of another kind than `LatestInputs` states.
        :raises GraspError: there is no such input, or the robot has no roller named as failed.
            After an error no input is replaced.
        """
        if unknown := inputs.keys() - set(LatestInputs.__slots__):
            known = ', '.join(LatestInputs.__slots__)
            raise GraspError(f'inputs {", ".join(sorted(unknown))}: must be from {known}')
        if 'failed' in inputs:
            check_kind('failed', inputs['failed'], 'Collection[str]')
            inputs['failed'] = frozenset(inputs['failed'])
            working_rollers(self.robot.topology, inputs['failed'])
        checked = [check_input(self.robot, *item) for item in inputs.items()]
        for name, value in zip(inputs, checked, strict=True):
            setattr(self.inputs, name, value)

    def decide(self, now: float) -> Decision:
        """
        Return the roller command for the cycle that begins now.

        A fault of an input raises no error; it results in a halt with a status and a message.

        :param now: current time on the clock of the inputs [s].
        """
        self.memory, decision = step(self._setup, self.memory, self.inputs, now)
        return decision

    def command(self, velocities: Array, now: float) -> Array:
        """
        Return the desired roller velocities (r,), limited by the largest acceleration [m/s].

        It is called instead of `decide` in a cycle in which the client commands roller velocities
        directly. The result is recorded for the prediction and for the detection of failures.

        :param velocities: (r,) desired velocities [m/s]; zeros stop the rollers at once.
        :param now: current time on the clock of the inputs [s].
        """
        velocities = self.robot.check_rollers(velocities, 'roller velocities [m/s]')
        self.memory, limited = step_command(self._setup, self.memory, self.inputs, velocities, now)
        return limited

    def acknowledge(self) -> None:
        """Clear the fault of the grip; the control starts anew from the measured pose."""
        if self.squeeze is not None:
            self.memory = replace(self.memory, squeeze=self.squeeze.acknowledged())

    def reset_failures(self, names: Collection[str] | None = None) -> None:
        """
        Regard some or all rollers with detected failures as working again.

        :param names: names of these rollers; None: all rollers. The comparison of measured with
            commanded travel restarts for all.
        :raises GraspError: the robot has no such roller.
        """
        self.memory = replace(self.memory, detector=self.memory.detector.reset(names))

    def take_failures(self, other: TwistServo) -> None:
        """
        Take the detected failures of a previous servo, as far as the robot has these rollers.

        :param other: the previous servo.
        """
        failed = other.memory.detector.failed & frozenset(self.robot.roller_names)
        self.memory = replace(self.memory, detector=replace(self.memory.detector, failed=failed))


def _check_joint(robot: Robot, settings: ServoSettings) -> None:
    """Raise GraspError if the settings name a joint that the robot does not have."""
    if settings.joint is not None:
        check_names('joint', [settings.joint], robot.topology.joint_names, robot.name)
