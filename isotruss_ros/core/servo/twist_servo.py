# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Twist servo, which computes a roller command or a halt from the latest inputs in every cycle.

The twist is the desired velocity of the held object or, without an object, of a joint. What a
cycle computes is in `servo_step`.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
import importlib
from typing import Any

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.inputs import LatestInputs
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.task import working_rollers
from isotruss_ros.core.model.topology import check_names
from isotruss_ros.core.numerics.argument_kinds import check_kind, check_kinds
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.servo.check_input import check_input
from isotruss_ros.core.servo.decision import Decision
from isotruss_ros.core.servo.servo_memory import ServoMemory, ServoSetup
from isotruss_ros.core.servo.servo_settings import ServoSettings
from isotruss_ros.core.servo.servo_step import step, step_command
from isotruss_ros.core.servo.squeeze_control import SqueezeControl


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
