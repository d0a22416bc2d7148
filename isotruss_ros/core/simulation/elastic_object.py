# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A simulated object between elastic tubes: it is where the equilibrium of all forces puts it."""

from __future__ import annotations

import math

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_statics import TubeModel
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus, NotHeldError
from isotruss_ros.core.holding.joint_loads import LoadedParts
from isotruss_ros.core.holding.loaded_frame import held_joints
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.depths import member_depths, push_out, TOLERANCE
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.numerics.arrays import Array, finite_array
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.simulation.floor_friction import FloorFriction
from isotruss_ros.core.simulation.held_motion import has_masses, HeldMotion
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
    the tubes, and its pose follows from configuration, external wrench and the floor's friction.
    Where the friction that the balance needs is more than there is, or no equilibrium exists, it
    is dropped: it slips out of the grip as far as the members push it, and lies there.

    :ivar dropped: why it was dropped last; None while it is held or never was.
    :param body: the object, where it lies.
    :param friction: coefficient between tube and object in this plant, not negative.
    :param stiffness_scale: stiffness of this plant against that of the model, positive.
    :param ground_friction: wrench up to which the floor holds a held object in its place, moments
        over its arm, not negative [N].
    :param module_friction: force up to which it holds each joint with its modules, while they hold
        the object, not negative [N].
    :raises GraspError: friction or stiffness are not usable.
    """

    def __init__(
        self,
        body: ConvexObject,
        friction: float,
        stiffness_scale: float = 1.0,
        ground_friction: float = 0.0,
        module_friction: float = 0.0,
    ) -> None:
        given = [friction, stiffness_scale, ground_friction, module_friction]
        mu, scale, ground, module = finite_array(given, 4, 'friction, stiffness', GraspError)
        if min(mu, ground, module) < 0.0 or scale <= 0.0:
            raise GraspError(
                f'friction {friction!r}, stiffness scale {stiffness_scale!r} and friction of the '
                f'ground {ground_friction!r} under the object and {module_friction!r} under the '
                'modules: must not be negative, and the second not zero'
            )
        self._floor = FloorFriction((float(ground), float(module)), body.arm)
        self._motion = HeldMotion(self._floor)
        self._rubbing: LoadedParts | None = None
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
        grasp, rubbing = self._grasp, self._rubbing
        if grasp is None:
            return config.nodes[: len(config.robot.topology.joint_names)]
        if rubbing is None or rubbing.by_contacts is None:
            return held_joints(grasp)
        return rubbing.places[3:].reshape(-1, 2)

    def pose(self, config: Configuration) -> Pose:
        """Return its pose after the last step; see `SimulatedObject.pose`."""
        return self._body.pose if self._grasp is None else self._grasp.pose

    @single_threaded
    def follow(self, config: Configuration, elapsed: float = 0.0) -> None:
        """Go with the robot to a configuration; see `SimulatedObject.follow`."""
        stays = config is self._followed and not self._pulled_anew
        if stays and (self._motion.rests or elapsed == 0.0):
            return
        before, self._followed, self._pulled_anew = self._followed, config, False
        if self._grasp is None:
            self._touch(before, config)
        if self._grasp is not None:
            self._move(self._grasp, config, elapsed)
        if self._grasp is None:
            self._stand_still()
            self._body = push_out(config, self._body)

    def come_to_rest(self, config: Configuration) -> None:
        """Take no note of it; see `SimulatedObject.come_to_rest`."""

    def _move(self, before: HeldGrip, config: Configuration, elapsed: float) -> None:
        """Be led by the members, and swing or give by what pulls and rubs."""
        pull, floor, rubbing = self._wrench / (1.0, 1.0, before.arm), self._floor, self._rubbing
        swings = elapsed > 0.0 and has_masses(before)
        if before.response is None or not (swings or floor.rubs):
            self._stand_still()
            self._roll(before, config, pull)
            return
        if rubbing is None:
            rubbing = LoadedParts.find(before, floor.joints_rub)
            floor.stand(rubbing.places)
        led = self._roll(before, config, before.wrench)
        if led is None or led.response is None:
            return
        there = LoadedParts.find(led, floor.joints_rub, floor.loads)
        wrench = None
        if swings:
            moved = there.places - rubbing.places
            moved[2] = math.remainder(moved[2], 2.0 * math.pi * before.arm)
            wrench = self._motion.swing(led, there, moved, pull, elapsed)
        # A fixed point that a few steps find.
        for _ in range(MAX_PARTS):
            borne = pull + floor.loads[:3] if wrench is None else wrench
            led = self._roll(there.load(led, floor.loads), config, borne)
            if led is None or led.response is None:
                return
            self._rubbing = there = LoadedParts.find(led, floor.joints_rub, floor.loads)
            free = there.places - there.compliance @ floor.loads
            if wrench is not None or not floor.hold_back(free, there.compliance):
                break
        floor.settle(there.places)

    def _stand_still(self) -> None:
        """Forget how it moves and where it rubs."""
        self._floor.let_go()
        self._motion.rest()
        self._rubbing = None

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
        return bool(np.sort(member_depths(config, self._body))[-2] > TOLERANCE)

    def _roll(self, before: HeldGrip, config: Configuration, wrench: Array) -> HeldGrip | None:
        """
        Roll to a configuration and a wrench (fx, fy, m / arm) and return how it is held there.

        In smaller and smaller parts where the contacts let go; it is dropped, None, where they do
        in the smallest.
        """
        if before is self._grasp and before.config is config and (wrench == before.wrench).all():
            return before
        start, end = before.config.roller_positions, config.roller_positions
        even = np.array([1.0, 1.0, before.arm])
        pulled = before.wrench
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
                return None
        self._grasp = before
        return before
