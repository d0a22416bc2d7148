# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulated rigid object between undeformed tubes, either at rest or rolling in a grip."""

from __future__ import annotations

import math

from isotruss_ros.core.errors import GraspError, IsotrussError
from isotruss_ros.core.holding.settle_grasp import settle_grasp
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.manipulation.grip import Grip, GRIP_SIZES
from isotruss_ros.core.manipulation.rolling_grip import RollingGrip
from isotruss_ros.core.model.convex_object import check_friction, ConvexObject
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.numerics.argument_kinds import check_kinds
import numpy as np


class RigidObject:
    """
    Object that is at rest until friction can hold it, and then rolls in its grip.

    Each time the rollers stop, it is checked whether friction can hold the object. If so, the
    object moves to its equilibrium between the two or three members in contact, and rolls with
    them afterwards. An object that is not held stands still on the ground, and members do not push
    it. A held object is released if a contact leaves its member, or if a member has no contact
    when the rollers stop.

    :param body: the object at its initial pose.
    :param friction: coefficient of friction, used if the object has none of its own.
    :raises GraspError: the coefficient is out of range.
    """

    @check_kinds
    def __init__(self, body: ConvexObject, friction: float) -> None:
        self._body = body
        coefficient = check_friction(friction)
        self._friction = coefficient if body.friction is None else body.friction
        #: Configurations of the last step, and of the last check of the hold; both None at first.
        self._followed: Configuration | None = None
        self._checked: Configuration | None = None
        self._checks_hold = True
        self.rolling: RollingGrip | None = None  #: rolling grip; None while not held

    @classmethod
    def in_grip(cls, rolling: RollingGrip) -> RigidObject:
        """
        Return an object that stays in a grip as long as all members are in contact.

        Friction is not checked. After it has left the grip, the object is not held again.

        :param rolling: initial grip.
        """
        held = cls(rolling.grip.body, rolling.grip.friction)
        held.rolling, held._checks_hold = rolling, False
        return held

    def pose(self, config: Configuration) -> Pose:
        """
        Return the object's pose in a configuration; the angle is in (-pi, pi].

        :param config: configuration of the robot.
        :raises GraspError: the object would leave its grip.
        """
        if self.rolling is not None:
            return self.rolling.moved_to(config).pose
        x, y, angle = self._body.pose
        return Pose(x, y, math.remainder(angle, 2.0 * math.pi))

    def follow(self, config: Configuration) -> None:
        """Remain at rest, or roll in the grip; see `SimulatedObject.follow`."""
        are_rollers_at_rest = self._followed is None or self._followed is config
        self._followed = config
        if self.rolling is not None:
            try:
                self.rolling = self.rolling.moved_to(config)
            except GraspError:
                self._body, self.rolling = self._body.moved_to(self.rolling.pose), None
        if self._checks_hold and are_rollers_at_rest and self._checked is not config:
            self._checked = config
            self._check_hold(config)

    def _check_hold(self, config: Configuration) -> None:
        """Release an object that a member has left; begin to hold one that friction can hold."""
        body = self._body.moved_to(self.pose(config))
        pressing = pressing_members(config, body)
        if self.rolling is not None:
            if not set(self.rolling.grip.members) <= set(pressing):
                self._body, self.rolling = body, None
        elif len(pressing) in GRIP_SIZES:
            try:
                settled = settle_grasp(config, body, self._friction, members=pressing)
                if settled.hold.at_rest:
                    grip = Grip(pressing, body.moved_to(settled.pose), self._friction)
                    self.rolling = RollingGrip.attach(config, grip)
            except IsotrussError:
                return  # contact at the end of a member, or failed computation of forces


def pressing_members(config: Configuration, body: ConvexObject) -> tuple[str, ...]:
    """Return the names of the members that an object indents, the most indented one first."""
    # A tube that is indented by more than its diameter passes above the object.
    tube, depths = config.robot.description.tube_diameter, member_depths(config, body)
    order = np.argsort(-depths, kind='stable')
    return tuple(config.robot.member_names[i] for i in order if 0.0 < depths[i] <= tube)
