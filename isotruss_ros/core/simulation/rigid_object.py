# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulated rigid object that rolls in a grip of undeformed tubes."""

from __future__ import annotations

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.rolling_grip import RollingGrip
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.numerics.argument_kinds import check_kinds


class RigidObject:
    """
    Object that rolls in its grip until a contact leaves its member, and then stands still.

    Nothing is computed of forces and friction; `ElasticObject` is held by them, and is released
    when the grip opens.

    :ivar rolling: rolling grip; None after the object has left it.
    :param rolling: initial grip.
    """

    @check_kinds
    def __init__(self, rolling: RollingGrip) -> None:
        self.rolling: RollingGrip | None = rolling
        self._pose = rolling.pose

    def pose(self, config: Configuration) -> Pose:
        """
        Return the object's pose in a configuration; the angle is in (-pi, pi].

        :param config: configuration of the robot.
        :raises GraspError: the object would leave its grip.
        """
        return self._pose if self.rolling is None else self.rolling.moved_to(config).pose

    def follow(self, config: Configuration) -> None:
        """Roll in the grip, or stand still; see `SimulatedObject.follow`."""
        if self.rolling is None:
            return
        try:
            self.rolling = self.rolling.moved_to(config)
            self._pose = self.rolling.pose
        except GraspError:
            self.rolling = None
