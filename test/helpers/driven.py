# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot that moves what it holds under the twist servo, in step with it."""

from dataclasses import replace

from isotruss_ros.core import TwistServo
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.servo.servo_settings import ServoSettings
import numpy as np
from walks import rolled


class Driven:
    """A robot under the twist servo; its sensors are prompt and exact."""

    def __init__(self, held, period=0.01, **settings):
        robot = held.config.robot
        self.held, self.period, self.now = held, period, 0.0
        self.last = self.velocities = np.zeros(len(robot.roller_names))
        self.change = 0.0
        self.servo = TwistServo(robot, ServoSettings(held.grip, period, timeout=1.0, **settings))

    def step(self, twist, period=None):
        """Go on for one cycle, which may have a period of its own; return the command."""
        period = period or self.period
        self.servo.apply(replace(self.servo.settings, period=period))
        return self.step_late(twist, period)

    def step_late(self, twist, period, follows_late=False):
        """
        Go on for one cycle after a time; the servo assumes its nominal period.

        The rollers may follow the command before the present one.
        """
        self.now += period
        state = RollerState(self.held.config.roller_positions, self.velocities)
        self.servo.receive(
            twist=StampedInput(np.asarray(twist), self.now),
            rollers=StampedInput(state, self.now),
            pose=StampedInput(self.held.pose, self.now),
        )
        command = self.servo.decide(self.now).command
        self.change = np.abs(command.roller_velocities - self.velocities).max()
        self.velocities = self.last if follows_late else command.roller_velocities
        self.last = command.roller_velocities
        self.held = rolled(self.held, period * self.velocities)
        return command
