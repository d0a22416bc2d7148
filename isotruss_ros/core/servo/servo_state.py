# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings, latest inputs and state of a servo from cycle to cycle."""

from __future__ import annotations

import importlib
import math
from typing import Any

from isotruss_ros.core.errors import GraspError, IsotrussError
from isotruss_ros.core.inputs import (
    CommandHistory,
    Input,
    LatestInputs,
    RejectedInput,
    StampedInput,
    Timeline,
)
from isotruss_ros.core.kinematics.configuration import ConfigurationTracker
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.limits import default_limits
from isotruss_ros.core.manipulation.task import working_rollers
from isotruss_ros.core.model.convex_object import EXTERNAL_WRENCH
from isotruss_ros.core.model.topology import check_names
from isotruss_ros.core.numerics.argument_kinds import check_kind, check_kinds
from isotruss_ros.core.numerics.arrays import covariance_matrix, finite_array, MAX_LOAD
from isotruss_ros.core.safety.roller_failure import FailureDetector
from isotruss_ros.core.safety.shape_guard import ShapeGuard
from isotruss_ros.core.servo.repeated_pose import RepeatedPose
from isotruss_ros.core.servo.servo_settings import ServoSettings
from isotruss_ros.core.servo.squeeze_control import SqueezeControl
from isotruss_ros.core.statics.section import tube_pressures
import numpy as np

#: Kind of the value of an input that is not a list of numbers.
VALUE_KINDS = {'rollers': 'RollerState', 'estimate': 'EstimatedTravel'}


class ServoState:
    """
    Settings, latest inputs and state of a servo.

    The attributes and parameters are those of `TwistServo`.
    """

    @check_kinds
    def __init__(
        self, robot: Robot, settings: ServoSettings, inputs: LatestInputs | None = None
    ) -> None:
        self.robot, self.settings, self.inputs = robot, settings, inputs or LatestInputs()
        self.detector = FailureDetector(robot.roller_names, settings.failure_time)
        self.squeeze: SqueezeControl | None = None
        self._history = CommandHistory(len(robot.roller_names))
        self._tracker = ConfigurationTracker(robot.home)
        self._detection_time = math.nan  # time of the roller state that was compared last [s]
        self._regulated: float | None = None  # time of the last cycle of the squeeze control
        self._repeated_pose = RepeatedPose()
        self._poses = Timeline()  # last pose up to the time of the rollers, and the later ones
        self.apply(settings)
        # SciPy loads these parts at their first use, which must not be in a cycle.
        for part in ('scipy.interpolate', 'scipy.optimize'):
            importlib.import_module(part)

    def apply(self, settings: ServoSettings) -> None:
        """
        Replace the settings of the servo from the next cycle on.

        If the joint changes, the last twist is discarded. The squeeze control goes on unless it
        has a fault.

        :param settings: new settings.
        :raises GraspError: the robot has no such joint; then the old settings remain.
        """
        if settings.joint is not None:
            joints = self.robot.topology.joint_names
            check_names('joint', [settings.joint], joints, self.robot.name)
        if settings.joint != self.settings.joint:
            self.inputs.twist = None
            if self.squeeze is not None:
                self.squeeze.acknowledge()
        self.detector.failure_time = settings.failure_time
        if settings.squeeze is None:
            self.squeeze = None
        elif self.squeeze is None or self.squeeze.fault is not None:
            self.squeeze = SqueezeControl(settings.squeeze)
        else:
            self.squeeze.settings = settings.squeeze
        self._limits = (*default_limits(self.robot), *settings.limits)
        bounds, barriers = settings.bounds, settings.barriers
        self._guard = None if bounds is None else ShapeGuard(self.robot, bounds, barriers)
        self.settings = settings

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


def check_input(robot: Robot, name: str, given: Input) -> Input:
    """
    Return an input of a servo, or a rejection with the reason if its numbers are invalid.

    Time, twist, pose, external wrench, roller state and roller offsets must be finite numbers of
    the required count, and a covariance must be positive semidefinite; see `tube_pressures`.
    """
    if name in ('failed', 'halt'):
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
        elif name == 'pressures':
            tube_pressures(robot.description, value)
        elif name == 'rollers':
            for field, numbers in value._asdict().items():
                if field != 'offsets' or np.ndim(numbers):  # offsets may be the number 0
                    finite_array(numbers, rollers, f'{field} of {words}', GraspError)
        elif name == 'estimate':
            finite_array(value.offsets, rollers, 'estimated roller offsets [m]', GraspError)
            what = 'covariance of roller offsets [m^2]'
            covariance_matrix(value.covariance, rollers, what, GraspError)
    except IsotrussError as error:
        return RejectedInput(str(error))
    return given
