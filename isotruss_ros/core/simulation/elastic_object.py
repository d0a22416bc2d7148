# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A simulated object between elastic tubes, quasi-static: in the equilibrium of all forces."""

from __future__ import annotations

import math

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_statics import TubeModel
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus, NotHeldError
from isotruss_ros.core.holding.loaded_frame import held_joints
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.depths import member_depths, OVERLAP_TOLERANCE, push_out
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.numerics.arrays import Array, finite_array
from isotruss_ros.core.numerics.blas_threads import single_threaded
import numpy as np
from numpy.typing import ArrayLike

#: A change of configuration is divided into this many parts at most to find where a contact slips.
MAX_PARTS = 64
#: The first touch on the way to a configuration is found to this power of a half of the way.
TOUCH_HALVINGS = 6


class ElasticObject:
    """
    An object that two members hold by friction, or three, or that lies on the ground.

    While it lies, members that touch it push it along; the ground carries loads. From the moment
    two members press on it so that friction holds it, it is held: contacts stick, it rolls with
    the tubes, and its pose follows from configuration and external wrench, without inertia.
    Where the friction that the balance needs is more than there is, or no equilibrium exists, it
    is dropped: it slips out of the grip as far as the members push it, and lies there.

    :ivar dropped: why it was dropped last; None while it is held or never was.
    :param body: the object, where it lies.
    :param friction: coefficient between tube and object in this plant, not negative.
    :param stiffness_scale: stiffness of this plant against that of the model, positive.
    :raises GraspError: friction or stiffness are not usable.
    """

    def __init__(self, body: ConvexObject, friction: float, stiffness_scale: float = 1.0) -> None:
        given = [friction, stiffness_scale]
        mu, scale = finite_array(given, 2, 'friction, stiffness', GraspError)
        if mu < 0.0 or scale <= 0.0:
            raise GraspError(
                f'friction {friction!r} must not be negative, stiffness scale '
                f'{stiffness_scale!r} must be positive'
            )
        self._friction, self._scale = float(mu), float(scale)
        angle = math.remainder(body.pose.angle, 2.0 * math.pi)
        self._body = body.moved_to(body.pose._replace(angle=angle))  # where it lies
        self._grasp: HeldGrip | None = None
        self._wrench = np.zeros(3)
        self._pulled_anew = False
        self._followed: Configuration | None = None
        self.dropped: HoldStatus | None = None

    @property
    def grasp(self) -> HeldGrip | None:
        """Return how it is held; None while it lies."""
        return self._grasp

    @property
    def external_wrench(self) -> Array:
        """Return what pulls at it: (fx, fy, m) about its centre [N, N m]."""
        return self._wrench

    @external_wrench.setter
    def external_wrench(self, wrench: ArrayLike) -> None:
        """
        Pull at it, from the next step on.

        :raises GraspError: not three finite numbers.
        """
        self._wrench = finite_array(wrench, 3, 'the external wrench (fx, fy, m)', GraspError)
        self._pulled_anew = True

    @property
    def slip_margin(self) -> float:
        """Return the smallest extra wrench at which a contact slips [N]; zero while it lies."""
        return 0.0 if self._grasp is None else self._grasp.slip_margin(self._friction)

    def joints(self, config: Configuration) -> Array:
        """
        Return where the joints are, (j, 2) in `Topology.joint_names` order [m].

        :param config: configuration of the robot, in the last step.
        """
        if self._grasp is None:
            return config.nodes[: len(config.robot.topology.joint_names)]
        return held_joints(self._grasp)

    def pose(self, config: Configuration) -> Pose:
        """Return its pose after the last step; see `SimulatedObject.pose`."""
        return self._body.pose if self._grasp is None else self._grasp.pose

    @single_threaded
    def follow(self, config: Configuration) -> None:
        """Go with the robot to a configuration; see `SimulatedObject.follow`."""
        if config is self._followed and not self._pulled_anew:
            return
        before, self._followed, self._pulled_anew = self._followed, config, False
        if self._grasp is None:
            self._touch(before, config)
        if self._grasp is not None:
            self._roll(self._grasp, config)
        if self._grasp is None:
            self._body = push_out(config, self._body)

    def come_to_rest(self, config: Configuration) -> None:
        """Take no note of it; see `SimulatedObject.come_to_rest`."""

    def _touch(self, before: Configuration | None, config: Configuration) -> None:
        """Be held from the moment on at which two members press so that friction holds."""
        if not self._pressed(config):
            return
        first = config if before is None else self._first_touch(before, config)
        for there in (first, config):
            try:
                found = attach_grip(there, self._body, None, self._wrench, TubeModel(self._scale))
            except NotHeldError:
                continue
            if found.hold(self._friction) is HoldStatus.HELD:
                self._grasp, self.dropped = found, None
                return

    def _first_touch(self, before: Configuration, config: Configuration) -> Configuration:
        """Return about the first configuration on the way in which two members press."""
        start, end, touch = before.roller_positions, config.roller_positions, config
        low, high = 0.0, 1.0
        for _ in range(TOUCH_HALVINGS):
            middle = 0.5 * (low + high)
            there = before.moved_to(start + middle * (end - start))
            if self._pressed(there):
                high, touch = middle, there
            else:
                low = middle
        return touch

    def _pressed(self, config: Configuration) -> bool:
        """Return whether two members press on the object where it lies, deeper than they push."""
        return bool(np.sort(member_depths(config, self._body))[-2] > OVERLAP_TOLERANCE)

    def _roll(self, before: HeldGrip, config: Configuration) -> None:
        """
        Roll to a configuration under the external wrench.

        In smaller and smaller parts where the contacts let go; it is dropped where they do in the
        smallest.
        """
        wrench, pulled = self._wrench / (1.0, 1.0, before.arm), before.wrench
        start, end = before.config.roller_positions, config.roller_positions
        even = np.array([1.0, 1.0, before.arm])
        done, part = 0.0, 1.0
        while done < 1.0:
            share = min(1.0, done + part)
            there = config
            if share < 1.0:
                there = before.config.moved_to(start + share * (end - start))
            found = roll_grip(before, there, even * (pulled + share * (wrench - pulled)))
            hold = HoldStatus.NO_BALANCE if found is None else found.hold(self._friction)
            if found is not None and hold is HoldStatus.HELD:
                before, done = found, share
                continue
            part = 0.5 * part
            if part < 1.0 / MAX_PARTS:
                self._body = self._body.moved_to(before.pose)
                self._grasp, self.dropped = None, hold
                return
        self._grasp = before
