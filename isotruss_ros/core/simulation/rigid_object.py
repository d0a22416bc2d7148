# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A simulated rigid object that lies or rolls in a grip, in the model without deformation."""

from __future__ import annotations

import math

from isotruss_ros.core.errors import GraspError, IsotrussError
from isotruss_ros.core.holding.settle_grasp import settle_grasp
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.manipulation.grip import Grip, MOST
from isotruss_ros.core.manipulation.rolling_grip import RollingGrip
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.pose import Pose
import numpy as np


class RigidObject:
    """
    An object that lies where it is, and rolls in a grip once friction can hold it there.

    Whether it does is looked at whenever the rollers have come to rest: then the object moves to
    its equilibrium between the two members, or three, that press on it, and rolls with them from
    there on. While it lies, the ground holds it: the model knows no pushing. It lies again where a
    contact leaves its member, and where a member does not press any more when the rollers rest.

    :ivar rolling: the grip; None while the object lies.
    :param body: the object, where it lies.
    :param friction: coefficient between tube and object; one of its own counts instead.
    """

    def __init__(self, body: ConvexObject, friction: float) -> None:
        self._body = body
        self._friction = friction if body.friction is None else body.friction
        self._looks = True
        self.rolling: RollingGrip | None = None

    @classmethod
    def in_grip(cls, rolling: RollingGrip) -> RigidObject:
        """
        Return an object that stays in a grip as long as all of its members touch it.

        Nobody looks whether friction holds it: once it has left the grip it lies for good.

        :param rolling: the grip to begin with.
        """
        found = cls(rolling.grip.body, rolling.grip.friction)
        found.rolling, found._looks = rolling, False
        return found

    @property
    def members(self) -> tuple[str, ...]:
        """Return the members that hold it; none while it lies."""
        return () if self.rolling is None else self.rolling.grip.members

    def pose(self, config: Configuration) -> Pose:
        """
        Return its pose in a configuration; the angle is in (-pi, pi].

        :param config: configuration of the robot.
        :raises GraspError: the object would leave its grip on the way there.
        """
        if self.rolling is not None:
            return self._rolled(self.rolling, config).pose
        x, y, angle = self._body.pose
        return Pose(x, y, math.remainder(angle, 2.0 * math.pi))

    def follow(self, config: Configuration) -> None:
        """Stay where it is, or roll in the grip; see `SimulatedObject.follow`."""
        if self.rolling is None:
            return
        try:
            self.rolling = self._rolled(self.rolling, config)
        except GraspError:
            self._body, self.rolling = self._body.moved_to(self.rolling.pose), None

    def come_to_rest(self, config: Configuration) -> None:
        """Find out whether the object is held; see `SimulatedObject.come_to_rest`."""
        if not self._looks:
            return
        body = self._body.moved_to(self.pose(config))
        names = pressing_members(config, body)
        if self.rolling is not None:
            if not set(self.members) <= set(names):
                self._body, self.rolling = body, None
        elif 2 <= len(names) <= MOST:
            self._try_to_hold(config, body, names)

    def _try_to_hold(
        self, config: Configuration, body: ConvexObject, names: tuple[str, ...]
    ) -> None:
        """Be held where friction holds between the members that press."""
        try:
            settled = settle_grasp(config, body, self._friction, members=names)
            if settled.hold.at_rest:
                grip = Grip(names, body.moved_to(settled.pose), self._friction)
                self.rolling = RollingGrip.attach(config, grip)
        except IsotrussError:
            return  # a member presses with its end, or the forces cannot be computed

    @staticmethod
    def _rolled(rolling: RollingGrip, config: Configuration) -> RollingGrip:
        return rolling if config is rolling.config else rolling.moved_to(config)


def pressing_members(config: Configuration, body: ConvexObject) -> tuple[str, ...]:
    """
    Return the names of the members whose straight tubes an object indents, the deepest first.

    Left out are tubes that it indents by more than they are thick: these lie on it.

    :param config: configuration of the robot.
    :param body: the object in its place.
    """
    tube, depths = config.robot.description.tube_diameter, member_depths(config, body)
    order = np.argsort(-depths, kind='stable')
    return tuple(config.robot.member_names[i] for i in order if 0.0 < depths[i] <= tube)
