# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

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
from isotruss_ros.core.holding.joint_loads import LoadedParts
from isotruss_ros.core.holding.loaded_frame import natural_modes
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.simulation.floor_friction import FloorFriction
import numpy as np

#: Longest step [s].
STEP = 1e-3
#: An object that moves no quicker, under forces that balance to this, rests [m/s], [N].
SLOW, LITTLE = 1e-7, 1e-6


def has_masses(grip: HeldGrip) -> bool:
    """
    Tell whether the masses of object and modules are known.

    :param grip: how the object is held.
    """
    module = grip.config.robot.description.module
    return grip.body.mass is not None and module.mass is not None


class HeldMotion:
    """
    The motion of a held object with masses, which swings about its equilibrium.

    :ivar rests: whether it does not.
    :param floor: on which object and joints rub.
    """

    def __init__(self, floor: FloorFriction) -> None:
        self._floor = floor
        self.rest()

    def rest(self) -> None:
        """Stand still."""
        self.rests, self._velocity = True, np.zeros(3)

    def swing(
        self, grip: HeldGrip, rubbing: LoadedParts, led: Array, pull: Array, elapsed: float
    ) -> Array | None:
        """
        Let time pass for the floor, and return the wrench that deflects the object then, (3,) [N].

        It is what pulls and rubs at the object, less what accelerates and damps it.

        :param grip: how it is held where the robot is now, under the loads before.
        :param rubbing: what rubs on the floor there.
        :param led: (n,) by how much the rollers moved that, see `LoadedParts` [m].
        :param pull: (3,) what pulls at the object, (fx, fy, m / arm) [N].
        :param elapsed: positive [s].
        :return: None where the equilibrium is indifferent.
        """
        modes = natural_modes(grip)
        if modes is None:
            self.rest()
            return None
        floor, compliance = self._floor, rubbing.compliance
        moving = compliance[:, :3] @ modes.wrenches
        shapes = moving[:3]
        # Joints give by their own friction beyond what the object's motion moves them by.
        beyond = compliance - moving @ np.linalg.solve(shapes, compliance[:3])
        count = math.ceil(elapsed / STEP)
        step = elapsed / count
        stiffness = modes.frequencies**2
        damping = 2.0 * grip.config.robot.description.damping_ratio * modes.frequencies
        yields = 1.0 / ((1.0 / step + damping) / step + stiffness)
        by_floor = moving * yields @ moving.T + beyond
        rates = np.linalg.solve(shapes, np.column_stack([led[:3], self._velocity])).T
        led_by, speed = rates[0] / count, rates[1]
        borne = floor.loads.copy()
        borne[:3] = grip.wrench
        strain, places = moving.T @ borne / stiffness, rubbing.places - led
        for _ in range(count):
            free = shapes.T @ pull - stiffness * strain - (led_by / step - speed) / step
            places = places + led / count - beyond @ floor.loads
            if floor.rubs:
                floor.hold_back(places + moving @ (yields * free), by_floor)
            change = yields * (free + moving.T @ floor.loads)
            speed, strain = (led_by + change) / step, strain + change
            places = places + moving @ change + beyond @ floor.loads
            if floor.rubs:
                floor.settle(places)
        self._velocity = shapes @ speed
        by_joints = np.linalg.solve(compliance[:3, :3], compliance[:3, 3:] @ floor.loads[3:])
        wrench = modes.wrenches @ strain - by_joints
        missing = np.abs(pull + floor.loads[:3] - wrench).max()
        self.rests = bool(np.abs(self._velocity).max() < SLOW and missing < LITTLE)
        return wrench
