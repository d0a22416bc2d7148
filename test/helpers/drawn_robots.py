# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots whose zeros, slips, loads and measurements are drawn as an estimator expects them."""

from dataclasses import replace

from carries import FRICTION, make_robot, place
from isotruss_ros.core import place_between, Pose
from isotruss_ros.core.control.state_estimate import EstimatorSettings
from isotruss_ros.core.control.state_estimator import StateEstimator
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.loaded_frame import held_joints
from isotruss_ros.core.holding.roll_grip import roll_contacts
from isotruss_ros.core.manipulation.grip import Grip
import numpy as np

ROBOT = make_robot()
NAMES = ROBOT.topology.joint_names
#: Three joints that determine all zeros.
THREE = ('Q', 'R', 'Z')
PERIOD, MARKER, POSE = 0.05, 1e-3, np.array([1e-3, 1e-3, np.radians(0.5)])
#: The model is that of the robot: nothing but what is drawn is wrong.
EXACT = EstimatorSettings(
    zeros=5e-3, encoders=0.0, stiffness=0.0, joint_error=0.0, pose_error=0.0, squeeze_error=0.0
)


class DrawnRobot:
    """
    A robot in the model itself, and the estimator that is told of it.

    :ivar offsets: (r,) the true ones [m].
    :ivar readings: (r,) of the encoders [m].
    :ivar grip: how the object is held; None without one.
    """

    def __init__(self, seed=0, held=False, settings=EXACT, speed=0.03, random_slip=True):
        """
        Draw zeros, speeds and load.

        :param held: whether the robot holds a disc.
        :param speed: of the rollers, at most [m/s].
        :param random_slip: whether rollers slip as is expected of them.
        """
        self.rng = rng = np.random.default_rng(seed)
        self.settings, self.random_slip = settings, random_slip
        self.offsets, self.readings = settings.zeros * rng.normal(size=6), np.zeros(6)
        self.config, self.grip, self.time = ROBOT.home.moved_to(self.offsets), None, 0.0
        self.speeds, self.wrench = speed * rng.uniform(-1.0, 1.0, 6), np.zeros(3)
        self.estimator = StateEstimator(ROBOT, settings)
        if held:
            body, members = place(ROBOT, 'disc 0.2 m', 0.5)
            there = place_between(self.config, members, body.shape, indentation=0.01).body
            self.wrench = settings.load * rng.normal(size=3)
            found = attach_grip(self.config, there)
            self.grip = self._roll(found)
            self.estimator.grip = Grip(members, replace(there, friction=FRICTION), FRICTION)
        self.estimator.take_encoders(0.0, self.readings)

    def _roll(self, grip):
        return roll_contacts(
            grip, self.config, grip.contacts, grip.anchors, grip.angles, self.wrench
        )

    def move(self, step=None):
        """Turn the rollers (r,) [m]; as drawn, to and fro, if None."""
        given, self.time = self.settings, self.time + PERIOD
        if step is None:
            step = self.speeds * np.cos(2.0 * np.pi * self.time / 3.0) * PERIOD
        self.readings = self.readings + step
        if self.random_slip:
            variance = given.slip**2 * 0.1 * np.abs(step) + given.drift**2 * PERIOD
            self.offsets = self.offsets + np.sqrt(variance) * self.rng.normal(size=6)
        self.config = self.config.moved_to(self.readings + self.offsets)
        if self.grip is not None:
            left = np.exp(-PERIOD / given.load_time)
            drawn = given.load * np.sqrt(1.0 - left**2) * self.rng.normal(size=3)
            self.wrench = left * self.wrench + drawn
            self.grip = self._roll(self.grip)
        self.estimator.take_encoders(self.time, self.readings)

    @property
    def joints(self):
        """Return where the joints are, (j, 2) [m]."""
        return self.config.nodes[: len(NAMES)] if self.grip is None else held_joints(self.grip)

    def markers(self, names=THREE):
        """Return measured joints by name [m]."""
        joints = self.joints
        return {
            name: tuple(joints[NAMES.index(name)] + MARKER * self.rng.normal(size=2))
            for name in names
        }

    def tell(self, names=THREE, dropouts=0.3):
        """Tell the estimator pose and markers as they are now."""
        if self.grip is not None:
            measured = Pose(*(np.array(self.grip.pose) + POSE * self.rng.normal(size=3)))
            self.estimator.take_pose(self.time, measured, POSE)
        if names and self.rng.random() > dropouts:
            self.estimator.take_markers(self.time, self.markers(names), MARKER)

    def run(self, duration, names=THREE):
        """Move and tell for a while; return what is estimated then."""
        for _ in range(round(duration / PERIOD)):
            self.move()
            self.tell(names)
        return self.estimator.estimate()

    def surprise(self, estimate):
        """Return the square of the error of the offsets over their deviations [-]."""
        error = estimate.offsets - self.offsets
        return error @ np.linalg.solve(estimate.offset_covariance, error)
