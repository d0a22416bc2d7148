# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Twist servo that describes each of its cycles as a text."""

from __future__ import annotations

from collections.abc import Callable, Collection
import functools
import importlib.metadata
from pathlib import Path
from typing import Any

from isotruss_ros.core.inputs import LatestInputs
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.recording.recorded_cycle import describe_cycle, describe_setup
from isotruss_ros.core.servo.decision import Decision
from isotruss_ros.core.servo.servo_settings import ServoSettings
from isotruss_ros.core.servo.twist_servo import TwistServo
import numpy as np

#: Packages whose versions a record names.
PACKAGES = ('isotruss_ros', 'numpy', 'scipy')


class RecordedServo(TwistServo):
    """
    Twist servo whose last cycle can be described as a text, the record of the cycle.

    Calls that change the memory between two cycles belong to the record of the second one.

    :ivar describe: function that returns the record of the last cycle, before another input is
        received. Its argument `reported` is the decision that the client reports.
    """

    def __init__(self, robot: Robot, settings: ServoSettings, inputs: LatestInputs) -> None:
        super().__init__(robot, settings, inputs)
        self.describe: Callable[..., str] = str
        self._number = 0
        self._calls: list[tuple[str, Any]] = []
        self._origin = _read_text(robot.description.source), find_versions()
        self._described = describe_setup(settings, *self._origin)

    def decide(self, now: float) -> Decision:
        """Return the decision of a cycle, and record it."""
        detected = self.memory.detector.failed
        decision = super().decide(now)
        self._end_cycle(decision, now=now, commanded=None, detected=detected)
        return decision

    def command(self, velocities: Array, now: float) -> Array:
        """Return limited velocities of a cycle, and record them."""
        detected = self.memory.detector.failed
        limited = super().command(velocities, now)
        commanded = np.array(velocities, dtype=float)
        self._end_cycle(as_decision(limited), now=now, commanded=commanded, detected=detected)
        return limited

    def apply(self, settings: ServoSettings) -> None:
        """Replace the settings, and record that they were applied."""
        super().apply(settings)
        self._described = describe_setup(settings, *self._origin)
        self._calls.append(('apply', None))

    def acknowledge(self) -> None:
        """Clear the fault of the grip, and record this."""
        super().acknowledge()
        self._calls.append(('acknowledge', None))

    def reset_failures(self, names: Collection[str] | None = None) -> None:
        """Regard rollers with detected failures as working again, and record this."""
        super().reset_failures(names)
        self._calls.append(('reset_failures', None if names is None else sorted(names)))

    def take_failures(self, other: TwistServo) -> None:
        """Take the detected failures of a previous servo, and record them."""
        super().take_failures(other)
        self._calls.append(('take_failures', self.memory.detector.failed))

    def _end_cycle(self, decision: Decision, **others: Any) -> None:
        others |= {'number': self._number, 'calls': self._calls}
        self.describe = functools.partial(
            describe_cycle, self._described, self.inputs, decision, **others
        )
        self._number, self._calls = self._number + 1, []


def as_decision(velocities: Array) -> Decision:
    """Return the decision of a cycle whose roller velocities (r,) the client commands [m/s]."""
    command = RollerCommand(velocities, np.zeros(3), 1.0, Status.FOLLOWING_TRAJECTORY)
    return Decision(command, np.zeros(3), '')


@functools.cache
def find_versions() -> dict[str, str]:
    """Return the versions of the packages that decide."""
    versions = {}
    for name in PACKAGES:
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:  # imported from a folder
            versions[name] = 'unknown'
    return versions


def _read_text(source: str) -> str:
    """Return the content of a robot file; empty if it cannot be read any more."""
    try:
        return Path(source).read_text(encoding='utf-8')
    except OSError:
        return ''
