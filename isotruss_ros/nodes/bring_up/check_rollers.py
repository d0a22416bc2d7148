# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Node `check_rollers`, which moves one roller at a time and checks the motion of the joints.

The node ends at the first roller with a wrong sign, scale or assignment, without moving another
roller.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from pathlib import Path

from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.calibration.robot_files import write_checked_rollers
from isotruss_ros.calibration.roller_check import judge_roller, MAX_TRAVEL_ERROR
from isotruss_ros.core import load_robot
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.nodes.bring_up.joint_markers import (
    AVERAGING_TIME,
    JointMarkers,
    MARKER_DEVIATION,
)
from isotruss_ros.nodes.framework import common_parameters as common
from isotruss_ros.nodes.framework.commands import RollerCommands
from isotruss_ros.nodes.framework.parameters import FixedSpec, ROBOT, Spec
from isotruss_ros.nodes.framework.runner import StoppableNode
from isotruss_ros.nodes.framework.topics import LATCHED
import numpy as np
from std_msgs.msg import Bool

SPECS = (
    ROBOT,
    common.RATE,
    Spec('travel', 0.02, 'Travel of each roller [m]', (0.005, 0.05)),
    Spec('speed', 0.01, 'Speed of each roller [m/s]', (0.001, 0.05)),
    Spec(
        'settle_time',
        1.0,
        'Pause after each motion, in which the robot comes to rest [s]',
        (0.0, 30.0),
    ),
    MARKER_DEVIATION,
    FixedSpec(
        'output', '', 'Robot file to which the names of checked rollers are written; empty: none'
    ),
)


class CheckRollers(StoppableNode):
    """
    Node that moves each roller of a robot without an object forth and back.

    :ivar faultless: names of the rollers that were checked and have no fault.
    """

    node_name = 'check_rollers'
    specs = SPECS

    def start(self) -> None:
        """Create the subscriptions, and wait for the joint markers."""
        self._robot = load_robot(self.values.robot)
        self.faultless: list[str] = []
        self._commands = RollerCommands(self, len(self._robot.roller_names))
        self._commands.subscribe()
        self._markers = JointMarkers(self, self._robot)
        self.create_subscription(Bool, 'emergency_stop', self._receive_stop, LATCHED)
        self._velocities = np.zeros(len(self._robot.roller_names))
        self._course = self._check_all()
        self._due = self.now() + AVERAGING_TIME + self.values.settle_time
        self.create_steady_timer(1.0 / self.values.rate, self._cycle)

    def stop(self) -> None:
        """Command zero velocities to all rollers."""
        self._commands.stop()

    def _receive_stop(self, message: Bool) -> None:
        if message.data:
            raise MeasurementError('the last message of emergency_stop is true; must be false')

    def _cycle(self) -> None:
        """Publish the current velocities, and continue the check after each of its pauses."""
        others = self._commands.find_others()
        if others is not None:
            raise MeasurementError(others)
        if self.now() >= self._due:
            wait = next(self._course, None)
            if wait is None:
                self._finish()
                return
            self._due = self.now() + wait
        self._commands.publish(self._velocities)

    def _check_all(self) -> Generator[float, None, None]:
        """Check the rollers one by one; yield the length of each pause [s]."""
        travel, speed = self.values.travel, self.values.speed
        rest = self.values.settle_time + AVERAGING_TIME
        for number, name in enumerate(self._robot.roller_names):
            before = self._markers.measure(self.now()).posture
            for direction in (1.0, -1.0):
                self._velocities[number] = direction * speed
                yield travel / speed
                self._velocities[number] = 0.0
                yield rest
                if direction > 0.0:
                    after = self._markers.measure(self.now()).posture
            both = sorted(set(before.joints) & set(after.joints))
            moved = {
                joint: tuple(np.subtract(after.joints[joint], before.joints[joint]).tolist())
                for joint in both
            }
            turned = after.roller_positions - before.roller_positions
            middle = self._robot.configuration(before.roller_positions + 0.5 * turned)
            why = judge_roller(middle, name, travel, moved, self.values.marker_deviation)
            why = why or _judge_encoders(self._robot.roller_names, number, travel, turned)
            if why:
                raise MeasurementError(f'roller {name}: {why}')
            self.get_logger().info(f'roller {name}: no fault')
            self.faultless.append(name)

    def _finish(self) -> None:
        """Write the names of the checked rollers to the robot file, and end the node."""
        if self.values.output:
            write_checked_rollers(self._robot, Path(self.values.output), self.faultless)
        self.done = True


def _judge_encoders(names: Sequence[str], number: int, travel: float, turned: Array) -> str:
    """Return a sentence with the fault of the encoders after one roller moved, or ''."""
    expected = np.zeros(len(names))
    expected[number] = travel
    off = np.abs(turned - expected)
    worst = int(off.argmax())
    if off[worst] <= MAX_TRAVEL_ERROR * travel:
        return ''
    return (
        f'the encoder of {names[worst]} counted {1e3 * turned[worst]:+.1f} mm in place of '
        f'{1e3 * expected[worst]:+.1f} mm'
    )
