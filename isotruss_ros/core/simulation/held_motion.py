# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
How a held object with masses moves to its equilibrium.

Object and modules move in the three shapes into which wrenches on the object deflect them, see
`natural_modes`. In each, with xi how far it moves, eta how far it is strained against where the
rollers lead it, and phi the work of a unit wrench,

    xi'' + 2 zeta omega eta' + omega^2 eta = phi . w,

by implicit Euler steps, which add half of omega times the step to the damping ratio.
"""

from __future__ import annotations

import math

from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.loaded_frame import natural_modes
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.simulation.floor_friction import FloorFriction
import numpy as np

#: Longest step [s].
STEP = 1e-3
#: An object that moves no quicker, under forces that balance to this, rests [m/s], [N].
SLOW, LITTLE = 1e-7, 1e-6


class HeldMotion:
    """
    The motion of a held object, which swings about its equilibrium where it has masses.

    :ivar rests: whether it does not.
    :param floor: on which it rubs.
    """

    def __init__(self, floor: FloorFriction) -> None:
        self._floor = floor
        self.rest()

    def rest(self) -> None:
        """Stand still."""
        self.rests, self._velocity = True, np.zeros(3)

    def swing(self, grip: HeldGrip, led: Array, pull: Array, elapsed: float) -> Array | None:
        """
        Return the wrench (fx, fy, m / arm) that deflects the object after some time [N].

        It is what pulls and rubs at the object, less what accelerates and damps it.

        :param grip: how it is held where the robot is now, under the wrench before.
        :param led: (3,) by how much the rollers moved it, turns times the arm [m].
        :param pull: (3,) what pulls at it [N].
        :param elapsed: [s].
        :return: None where no time passes, or it has no masses.
        """
        modes = natural_modes(grip) if elapsed > 0.0 else None
        if modes is None or grip.response is None:
            self.rest()
            return None
        even = np.array([1.0, 1.0, grip.arm])
        shapes = even[:, None] * grip.response.pose @ modes.wrenches
        count = math.ceil(elapsed / STEP)
        step = elapsed / count
        stiffness = modes.frequencies**2
        damping = 2.0 * grip.config.robot.description.damping_ratio * modes.frequencies
        yields = 1.0 / ((1.0 / step + damping) / step + stiffness)
        led_by, speed = np.linalg.solve(shapes, np.column_stack([led, self._velocity])).T
        led_by = led_by / count
        strain, place = shapes.T @ grip.wrench / stiffness, even * np.array(grip.pose) - led
        for _ in range(count):
            free = shapes.T @ pull - stiffness * strain - (led_by / step - speed) / step
            ahead = place + shapes @ (led_by + yields * free)
            self._floor.hold_back(ahead, shapes * yields @ shapes.T)
            change = yields * (free + shapes.T @ self._floor.wrench)
            speed, strain = (led_by + change) / step, strain + change
            place = place + shapes @ (led_by + change)
            self._floor.settle(place)
        self._velocity, wrench = shapes @ speed, modes.wrenches @ strain
        missing = np.abs(pull + self._floor.wrench - wrench).max()
        self.rests = bool(np.abs(self._velocity).max() < SLOW and missing < LITTLE)
        return wrench
