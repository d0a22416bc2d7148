"""A simulated object between elastic tubes: it is where the equilibrium of all forces puts it."""

from __future__ import annotations

import math

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.grasping.held_members import Hold, member_depths
from isotruss_ros.core.grasping.rolling_grasp import RollingGrasp
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.objects import Cylinder, Pose
from isotruss_ros.core.numerics.arrays import Array, finite_array
import numpy as np
from numpy.typing import ArrayLike

#: A change of configuration is divided into this many parts at most to find where a contact slips.
MAX_PARTS = 64


class ElasticObject:
    """
    An object that two members hold by friction, or that lies on the ground.

    While the contacts stick it rolls with the tubes, and its pose is a function of configuration
    and external wrench. Where the friction that the balance needs is more than there is, or no
    equilibrium exists, it is dropped: it lies where it was held last, until two members press on
    it so that friction holds it. The ground carries what lies, and nothing of what is held.

    :ivar dropped: why it was dropped last; None while it is held or never was.
    :param cylinder: the object, where it lies.
    :param friction: coefficient between tube and object in this plant, not negative.
    :param angle: its orientation in the robot frame [rad].
    :param stiffness_scale: stiffness of this plant against that of the model, positive.
    :raises GraspError: friction or stiffness are not usable.
    """

    def __init__(
        self,
        cylinder: Cylinder,
        friction: float,
        angle: float = 0.0,
        stiffness_scale: float = 1.0,
    ) -> None:
        mu, scale = finite_array([friction, stiffness_scale], 2, 'friction, stiffness', GraspError)
        if mu < 0.0 or scale <= 0.0:
            raise GraspError(
                f'friction {friction!r} and stiffness scale {stiffness_scale!r}: '
                'must not be negative, and the latter not zero'
            )
        self._diameter, self._friction, self._scale = cylinder.diameter, float(mu), float(scale)
        self._lies = Pose(*cylinder.center, math.remainder(angle, 2.0 * math.pi))
        self._grasp: RollingGrasp | None = None
        self._wrench = np.zeros(3)
        self._pulled_anew = False
        self._followed: Configuration | None = None
        self.dropped: Hold | None = None

    @property
    def grasp(self) -> RollingGrasp | None:
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

    def pose(self, config: Configuration) -> Pose:
        """
        Return its pose after the last step; the angle is in (-pi, pi].

        :param config: configuration of the robot.
        """
        return self._lies if self._grasp is None else self._grasp.pose

    def follow(self, config: Configuration) -> None:
        """
        Go with the robot to a configuration.

        :param config: where the robot is now.
        """
        if config is self._followed and not self._pulled_anew:
            return
        self._followed, self._pulled_anew = config, False
        if self._grasp is None:
            self._try_to_hold(config)
        else:
            self._roll(self._grasp, config)

    def come_to_rest(self, config: Configuration) -> None:
        """
        Stay as it is: it is in equilibrium in every step.

        :param config: configuration of the robot.
        """

    def _try_to_hold(self, config: Configuration) -> None:
        """Be held where two members press on it, in balance within the friction that there is."""
        lying = Cylinder(self._lies[:2], self._diameter)
        if np.sort(member_depths(config, lying))[-2] <= 0.0:
            return
        found = RollingGrasp.attach(config, lying, self._lies.angle, self._wrench, self._scale)
        if isinstance(found, RollingGrasp) and found.hold(self._friction) is Hold.HELD:
            self._grasp, self.dropped = found, None

    def _roll(self, before: RollingGrasp, config: Configuration) -> None:
        """Roll to a configuration, in smaller and smaller parts where the contacts let go."""
        start, end = before.config.roller_positions, config.roller_positions
        pulled, wrench = before.wrench * (1.0, 1.0, before.statics.radius), self._wrench
        done, part = 0.0, 1.0
        why = Hold.NO_BALANCE
        while done < 1.0:
            share = min(1.0, done + part)
            there = config
            if share < 1.0:
                there = before.config.moved_to(start + share * (end - start))
            found = before.moved_to(there, pulled + share * (wrench - pulled))
            hold = Hold.NO_BALANCE if found is None else found.hold(self._friction)
            if found is not None and hold is Hold.HELD:
                before, done = found, share
                self._grasp = found
                continue
            why, part = hold, 0.5 * part
            if part < 1.0 / MAX_PARTS:
                self._lies, self._grasp, self.dropped = before.pose, None, why
                return
