# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The squeeze control and the elastic plant, in step."""

import math

from grips import MASSLESS
from isotruss_ros.core import (
    ElasticObject,
    HoldStatus,
    Pose,
    RollerFaults,
    SimulatedRobot,
    solve_twist,
)
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.servo.squeeze_control import SqueezeControl, SqueezeSettings
import numpy as np


class SqueezeLoop:
    """
    A controller and a plant, in step.

    :ivar errors: of the place of the object in each cycle [m]; `turned` of its angle [rad].
    """

    def __init__(
        self,
        config,
        grip,
        force=None,
        more=1.0,
        scale=1.0,
        noise=0.0,
        period=0.02,
        **settings,
    ):
        """
        Put the object between the members.

        :param force: to squeeze with [N]; so many times `more` as it is squeezed if None.
        :param scale: stiffness of the plant over that of the model.
        :param noise: standard deviation of the poses [m, rad].
        """
        self.grip, self.period = grip, period
        self.object = ElasticObject(grip.body, grip.friction, stiffness_scale=scale)
        self.plant = SimulatedRobot(config, self.object, RollerFaults())
        self.plant.advance(0.0)
        self.target = more * self.squeeze / scale if force is None else force
        settings = {'max_utilisation': math.inf} | MASSLESS | settings
        self.control = SqueezeControl(SqueezeSettings(self.target, **settings))
        self.noise, self.rng = noise, np.random.default_rng(0)
        self.reference = np.array(self.plant.object_pose)
        self.statuses, self.errors, self.turned = [], [], []
        #: Covariance of the zeros by an estimator before each cycle; None without one.
        self.told = None

    def error(self):
        """Return how far the object is from its reference: x, y [m], angle [rad]."""
        error = self.reference - np.array(self.plant.object_pose)
        error[2] = math.remainder(error[2], 2.0 * math.pi)
        return error

    def run(self, twist, duration):
        """Follow a twist that begins and ends at rest."""
        count = round(duration / self.period)
        for k in range(count):
            wanted = (1.0 - np.cos(2.0 * np.pi * (k + 0.5) / count)) * np.array(twist)
            config = self.plant.config
            pose = Pose(*self.plant.object_pose + self.noise * self.rng.standard_normal(3))

            def solve(twist, opening_rate, config=config):
                held = self.control.belief.cache.grip
                return solve_twist(config, held, twist, opening_rate=opening_rate)

            if self.told is not None:
                self.control.take_offsets(np.zeros(6), self.told())
            grip = self.grip.moved_to(pose)
            assert self.control.follow(config, grip, self.period) is HoldStatus.HELD
            command = self.control.solve(wanted, self.period, solve)
            self.control.advance(wanted, command)
            self.statuses.append(command.status)
            self.plant.command(command.roller_velocities)
            self.plant.advance(self.period)
            self.reference = self.reference + self.period * wanted
            assert isinstance(self.object.grasp, HeldGrip)
            x, y, turned = self.error()
            self.errors.append(math.hypot(x, y))
            self.turned.append(abs(turned))

    @property
    def squeeze(self):
        """Return the mean normal force in the plant [N]."""
        return self.object.grasp.squeeze
