# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulated object between elastic tubes, in static equilibrium."""

from __future__ import annotations

import math

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus, NotHeldError
from isotruss_ros.core.holding.held_shape import held_joints
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.depths import member_depths, push_out
from isotruss_ros.core.model.convex_object import check_friction, ConvexObject, EXTERNAL_WRENCH
from isotruss_ros.core.model.pose import check_range, Pose
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import Array, finite_array, MAX_LOAD, MAX_MAGNITUDE
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.tolerances import ROUNDING
import numpy as np
from numpy.typing import ArrayLike


class ElasticObject:
    """
    Object that is held by friction between two or three members, or stands on the ground.

    Members in contact push a standing object, and the ground carries its external loads. With
    force closure the object is held: contacts roll without slip, and the pose follows from
    configuration and external wrench, without inertia. If friction becomes insufficient or no
    equilibrium exists, the object is lost: the members push it out of the grip, and it stands on
    the ground again.

    :ivar grasp: equilibrium of the held object; None while the object is not held.
    :ivar dropped: reason why the grip lost the object; None if the object is held or was never
        held.
    :param body: the object at its initial pose.
    :param friction: coefficient of friction between tube and object in this plant, not negative.
    :param stiffness_scale: ratio of the tubes' stiffness in this plant to the modelled one,
        positive [-].
    :raises GraspError: friction or stiffness is invalid.
    """

    @check_kinds
    def __init__(self, body: ConvexObject, friction: float, stiffness_scale: float = 1.0) -> None:
        limits = 1.0 / MAX_MAGNITUDE, MAX_MAGNITUDE
        self._scale = check_range(stiffness_scale, 'stiffness scale', '', *limits)
        self._friction = check_friction(friction)
        angle = math.remainder(body.pose.angle, 2.0 * math.pi)
        self._body = body.moved_to(body.pose._replace(angle=angle))  # pose while not held
        self.grasp: HeldGrip | None = None
        self._wrench = np.zeros(3)
        #: Configuration in the last step; None at first and after a change of the wrench.
        self._followed: Configuration | None = None
        self.dropped: HoldStatus | None = None

    @property
    def external_wrench(self) -> Array:
        """Return the wrench (fx, fy, m) about the origin of the object's frame [N, N m]."""
        return self._wrench

    @external_wrench.setter
    def external_wrench(self, wrench: ArrayLike) -> None:
        """
        Set the external wrench (fx, fy, m) on the object [N, N m], used from the next step on.

        :raises GraspError: the wrench is not three finite numbers within range.
        """
        self._wrench = finite_array(wrench, 3, EXTERNAL_WRENCH, GraspError, MAX_LOAD)
        self._followed = None

    @property
    def slip_margin(self) -> float:
        """Return the smallest additional wrench at which a held object slips, else zero [N]."""
        return 0.0 if self.grasp is None else self.grasp.slip_margin(self._friction)

    def joints(self, config: Configuration) -> Array:
        """
        Return the joint positions, (j, 2) in `Topology.joint_names` order [m].

        :param config: configuration of the robot in the last step.
        """
        if self.grasp is None:
            return config.nodes[: len(config.robot.topology.joint_names)]
        return held_joints(self.grasp)

    def pose(self, config: Configuration) -> Pose:
        """Return the object's pose after the last step; see `SimulatedObject.pose`."""
        return self._body.pose if self.grasp is None else self.grasp.pose

    @single_threaded
    def follow(self, config: Configuration) -> None:
        """Move the object with the robot; see `SimulatedObject.follow`."""
        if config is self._followed:
            return
        previous, self._followed = self._followed, config
        if self.grasp is None:
            self._touch(previous, config)
        if self.grasp is not None:
            self._roll(self.grasp, config)
        if self.grasp is None:
            self._body = push_out(config, self._body)

    def _touch(self, previous: Configuration | None, config: Configuration) -> None:
        """Hold the object at its first contact with two members, or else in `config`."""
        if not self._is_pressed(config):
            return
        # Bisection of the share of the motion after which two members are in contact.
        first_contact = config
        if previous is not None:
            start, end = previous.roller_positions, config.roller_positions
            low, high = 0.0, 1.0
            for _ in range(6):
                share = 0.5 * (low + high)
                trial = previous.moved_to(start + share * (end - start))
                if self._is_pressed(trial):
                    high, first_contact = share, trial
                else:
                    low = share

        for trial in (first_contact, config):
            try:
                grasp = attach_grip(trial, self._body, None, self._wrench, stiffness=self._scale)
            except NotHeldError:
                continue
            if grasp.hold(self._friction) is HoldStatus.HELD:
                self.grasp, self.dropped = grasp, None
                return

    def _is_pressed(self, config: Configuration) -> bool:
        """Return whether two members overlap the object; one member alone only pushes it."""
        return bool(np.sort(member_depths(config, self._body))[-2] > ROUNDING)

    def _roll(self, grasp: HeldGrip, config: Configuration) -> None:
        """
        Roll the object to a configuration under the external wrench.

        A substep in which contact is lost is halved; if contact is still lost in the smallest
        substep, the object is lost.
        """
        start, end = grasp.config.roller_positions, config.roller_positions
        start_wrench = grasp.wrench * (1.0, 1.0, grasp.arm)
        share, substep = 0.0, 1.0  # share of the motion that is done, and of the next substep
        while share < 1.0:
            # Rollers and wrench change linearly.
            next_share = min(1.0, share + substep)
            positions = start + next_share * (end - start)
            target = config if next_share == 1.0 else grasp.config.moved_to(positions)
            wrench = start_wrench + next_share * (self._wrench - start_wrench)
            rolled = roll_grip(grasp, target, wrench)
            hold = HoldStatus.NO_BALANCE if rolled is None else rolled.hold(self._friction)
            if rolled is not None and hold is HoldStatus.HELD:
                grasp, share = rolled, next_share
                continue
            substep = 0.5 * substep
            if substep < 1.0 / 64.0:
                self._body = self._body.moved_to(grasp.pose)
                self.grasp, self.dropped = None, hold
                return
        self.grasp = grasp
