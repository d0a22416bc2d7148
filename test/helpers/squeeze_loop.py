# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Twist servo and elastic plant, in step."""

from copy import deepcopy
from functools import cache
import math

from grips import MASSLESS
from isotruss_ros.core import ElasticObject, Pose, RollerFaults, SimulatedRobot, Status, TwistServo
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
import numpy as np

TIMEOUT = 0.2


@cache
def started_plant(config, body, friction, scale):
    """Return a plant that holds an object, and the object, for copies."""
    held = ElasticObject(body, friction, stiffness_scale=scale)
    plant = SimulatedRobot(config, held, RollerFaults())
    plant.advance(0.0)
    return plant, held


class SqueezeLoop:
    """Twist servo that controls the squeeze in an elastic plant `scale` times as stiff."""

    def __init__(
        self,
        config,
        grip,
        force=None,
        more=1.0,
        scale=1.0,
        noise=0.0,
        period=0.02,
        follows=True,
        friction=None,
        servo=None,
        **settings,
    ):
        self.period, self.noise, self.follows, self.now = period, noise, follows, 100.0
        started = started_plant(config, grip.body, friction or grip.friction, scale)
        self.plant, self.object = deepcopy(started)
        self.target = more * self.squeeze / scale if force is None else force
        limits = {'max_utilisation': math.inf} | MASSLESS | settings
        squeeze = SqueezeSettings(self.target, **limits)
        options = {'bounds': None, 'timeout': TIMEOUT, 'squeeze': squeeze} | (servo or {})
        self.servo = TwistServo(config.robot, ServoSettings(grip, period, **options))
        self.reference, self.rng = np.array(self.plant.object_pose), np.random.default_rng(0)
        self.decisions, self.errors, self.sends = [], [], True

    @property
    def squeeze(self):
        """Return the mean normal force in the plant [N]."""
        return self.object.grasp.squeeze

    @property
    def statuses(self):
        return [decision.command.status for decision in self.decisions]

    def cycle(self, twist=(0.0, 0.0, 0.0), elapsed=None, away=(0.0, 0.0, 0.0), **inputs):
        """Return the decision of a cycle; the measured pose is `away` from the true one."""
        elapsed = elapsed or self.period
        state = RollerState(self.plant.roller_positions, self.plant.roller_velocities)
        error = np.add(away, self.noise * self.rng.standard_normal(3))
        measured = {
            'twist': None if twist is None else StampedInput(np.asarray(twist), self.now),
            'rollers': StampedInput(state, self.now),
            'pose': StampedInput(Pose(*np.add(self.plant.object_pose, error)), self.now),
        }
        self.servo.receive(**measured | inputs)
        decision = self.servo.decide(self.now)
        before = np.array(self.plant.object_pose)
        if self.follows and self.sends:
            self.plant.command(decision.command.roller_velocities)
        if self.follows:
            self.plant.advance(elapsed)
        self.now += elapsed
        if twist is not None:
            self.reference = self.reference + elapsed * np.asarray(twist)
        if decision.desired_pose is not None:
            middle = 0.5 * (before + np.array(self.plant.object_pose))
            self.errors.append(np.subtract(decision.desired_pose, middle))
        self.decisions.append(decision)
        return decision

    def run(self, twist, duration):
        """Execute a twist that begins and ends at rest; no cycle may halt."""
        count = round(duration / self.period)
        for k in range(count):
            share = 1.0 - math.cos(2.0 * math.pi * (k + 0.5) / count)
            decision = self.cycle(share * np.array(twist))
            assert decision.command.status < Status.HALT_NO_TWIST, decision.message
            assert self.object.grasp is not None

    def largest_error(self):
        """Return the largest errors of position [m] and angle [rad]."""
        errors = np.array(self.errors)
        return np.hypot(*errors[:, :2].T).max(), np.abs(errors[:, 2]).max()

    def final_error(self):
        """Return the distance of the object from the end of the commanded motion [m]."""
        return math.dist(self.reference[:2], self.plant.object_pose[:2])
