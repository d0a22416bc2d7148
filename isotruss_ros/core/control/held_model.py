# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The model of a held object in the loop: how the robot holds it, and what the measured pose tells.

It rolls with the tubes, so that it follows the configuration. What its travel does beyond the rows
of (19) is learned: it is expected of the next cycle as well.
"""

from __future__ import annotations

import contextlib
from dataclasses import replace
import math
from typing import NamedTuple

from isotruss_ros.core.control.load_estimate import LoadEstimate, POSE_ERROR
from isotruss_ros.core.control.loop_gains import LoopGains
from isotruss_ros.core.control.usage_limits import UsageLimits
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_statics import TubeModel
from isotruss_ros.core.holding.held_grip import (
    HeldGrip,
    HoldStatus,
    LEFT_MARGIN,
    NotHeldError,
    travel_rates,
)
from isotruss_ros.core.holding.roll_grip import roll_contacts, roll_grip, with_pressures
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import find_members, Grip
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.model.pose import Pose, pose_difference
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.section import Pressure
import numpy as np

#: Fewer poses than this do not tell of their noise.
FEWEST = 4
#: Noise until it is known [m].
UNKNOWN_NOISE = 0.0012


class Observation(NamedTuple):
    """
    The measured pose of an object against its model, turns times its arm.

    :ivar apart: (3,) measured pose minus that of the model without a load, but for what it was at
        first [m].
    :ivar unexplained: (3,) what the expected load leaves of it [m].
    :ivar borne: whether the grip bears the load that is most probable.
    :ivar noise: median step of the measured pose from cycle to cycle [m].
    """

    apart: Array
    unexplained: Array
    borne: bool = True
    noise: float = UNKNOWN_NOISE


class HeldModel:
    """
    How the robot holds an object, under the load that follows from its measured pose.

    :ivar grasp: the equilibrium where the robot is.
    :ivar grip: whose rows tell how the object moves, see `_laid_grip`.
    :ivar load: the wrench on the object.
    :ivar pose: (x, y, angle) of the object, with the load that came last [m, rad].
    :ivar squeeze: mean normal force of the members, the same [N].
    :ivar drift: (4,) what the last travel did beyond the rows of (19) and loads: to the pose
        [m/s, rad/s] and to the squeeze [N/s].
    :ivar usage: what commands use of slip margin and tubes.
    :param grasp: the equilibrium near the measured pose, with a `response`.
    :param grip: its object is where it was measured.
    :param load: size of the loads that are expected, see `LoadEstimate` [N].
    """

    def __init__(self, grasp: HeldGrip, grip: Grip, load: float) -> None:
        self._friction, self.load = grip.friction, LoadEstimate(load)
        offset, give = pose_difference(grip.body.pose, grasp.pose), grasp.response.pose
        self.load.offset = self.load.bias = offset
        # What a load explains is no slip.
        left = offset - give @ self.load.most_probable(offset, give, grasp.arm)
        self._even = np.array([1.0, 1.0, grasp.arm])
        self._begun = self._even * (offset, left)
        self._first, self._averaged, self._noise = [offset], 0.0, UNKNOWN_NOISE
        self.drift, self.usage = np.zeros(4), UsageLimits(grasp)
        self._take(grasp, np.zeros(3))

    @property
    def slip_margin(self) -> float:
        """Return the slip margin under the estimated load [N]."""
        return self.grasp.slip_margin(self._friction)

    @property
    def sure_margin(self) -> float:
        """Return the slip margin with the load or without: no load is trusted to help [N]."""
        return self._sure_margin(self.grasp, np.zeros(3))

    @property
    def slope(self) -> float:
        """Return the change of the squeeze as the grip opens, negative [N/m]."""
        return self.grasp.squeeze_stiffness()

    def move_zeros(self, moved: Array) -> bool:
        """
        Correct zeros of the rollers; return whether there is an equilibrium then.

        What is corrected did not roll: the anchors move along, so that the contacts stay.

        :param moved: (r,) by which the positions of the rollers change [m].
        """
        grasp = self.grasp  # type: ignore[has-type]
        config = grasp.config.moved_to(grasp.config.roller_positions + moved)
        travel = travel_rates(config, grasp.contacts.members) @ moved
        anchors = grasp.anchors + grasp.statics.sides * travel
        found = roll_contacts(grasp, config, grasp.contacts, anchors, grasp.angles, grasp.wrench)
        if found is not None:
            self.grasp = replace(found, motion=grasp.motion)
        return found is not None

    def follow(
        self, config: Configuration, elapsed: float, pressures: tuple[float, ...] | None
    ) -> HoldStatus:
        """
        Roll to where the robot is; return whether the object is still held, or why not.

        :param config: where the robot is.
        :param elapsed: since the last call [s].
        :param pressures: (t,) gauge, by tube [Pa]; those of the robot file if None.
        """
        before = with_pressures(self.grasp, pressures)
        grasp = roll_grip(before, config, self.load.wrench * self._even)
        if grasp is None:
            return HoldStatus.NO_BALANCE
        hold = grasp.hold(self._friction)
        if hold is HoldStatus.HELD and grasp.response is None:
            return HoldStatus.UNSTABLE
        if hold is HoldStatus.HELD:
            self._learn(before, grasp, elapsed)
            self._take(grasp, np.zeros(3))
        return hold

    def observe(self, grip: Grip, elapsed: float, gains: LoopGains) -> Observation:
        """
        Take in where the object was measured.

        :param grip: its object is there.
        :param elapsed: since the last call [s].
        :param gains: how quickly the load is estimated.
        """
        grasp, borne = self.grasp, True
        offset = pose_difference(grip.body.pose, grasp.pose)
        apart = offset + grasp.response.pose @ self.load.wrench
        unlike = self._even * (apart, offset) - self._begun
        if self._first:
            self._average(grip, offset, elapsed, gains)
        else:
            loaded, borne = self.load.update(
                offset, grasp.response.pose, grasp.arm, elapsed, gains, self._bears
            )
            self._take(grasp, loaded)
        return Observation(*unlike, borne, self._noise)  # type: ignore[call-arg, arg-type]

    def _bears(self, more: Array) -> bool:
        """Return whether the object is held well under more load (3,) [N]."""
        return self.grasp.slip_margin(self._friction, more) > LEFT_MARGIN * self.grasp.squeeze

    def _sure_margin(self, grasp: HeldGrip, more: Array) -> float:
        """Return the slip margin under more load (3,), or without any where that is less [N]."""
        return min(grasp.slip_margin(self._friction, each) for each in (more, -grasp.wrench))

    def _take(self, grasp: HeldGrip, loaded: Array) -> None:
        """Go on with an equilibrium, and a load (3,) that came since [N]."""
        self.grasp, self.grip = grasp, _laid_grip(grasp, self._friction)
        self.pose = np.array(grasp.pose) + grasp.response.pose @ loaded
        self.squeeze = grasp.squeeze + float(grasp.response.squeeze @ loaded)

    def _learn(self, before: HeldGrip, grasp: HeldGrip, elapsed: float) -> None:
        """Take in what the last travel did beyond the rows of (19) and loads, and to the tubes."""
        travel = grasp.config.roller_positions - before.config.roller_positions
        moved = grip_jacobian(before.config, self.grip) @ travel
        loaded = grasp.wrench - before.wrench
        change = pose_difference(grasp.pose, before.pose)
        pressed = grasp.squeeze - before.squeeze - before.squeeze_stiffness() * moved[3]
        expected = np.append(grasp.response.pose @ loaded, grasp.response.squeeze @ loaded)
        beyond = np.append(change - moved[:3], pressed) - expected
        self.drift = beyond / elapsed if elapsed > 0.0 else np.zeros(4)
        # A load that changed the margin is not to be taken for what the travel did.
        margin = self._sure_margin(grasp, np.zeros(3)) - self._sure_margin(before, loaded)
        self.usage.learn(grasp, margin, travel)

    def _average(self, grip: Grip, offset: Array, elapsed: float, gains: LoopGains) -> None:
        """
        Take in a pose of the first while, in which there is no load; at its end begin with one.

        One noisy pose is not enough to tell it: the object is attached anew to their mean.
        """
        grasp = self.grasp
        self._first.append(offset)
        self._averaged += elapsed
        first = np.array(self._first)
        mean = self.load.offset = self.load.bias = first.mean(axis=0)
        if self._averaged < gains.filter_time:
            return
        self._first.clear()
        if len(first) >= FEWEST:
            # A load moves the object once; noise moves it in each cycle.
            steps = np.abs(np.diff(self._even * first, axis=0))
            self._noise = float(np.median(steps, axis=0).max())
            if self._noise > POSE_ERROR:
                there = grip.body.moved_to(Pose(*(np.array(grasp.pose) + mean)))
                pressure = grasp.tubes.pressure
                with contextlib.suppress(NotHeldError):
                    grasp = attach_model(grasp.config, replace(grip, body=there), pressure)
                moved = pose_difference(self.grasp.pose, grasp.pose)
                mean = mean + moved
                self._begun[0] += self._even * moved
        attached, self.grasp = grasp is not self.grasp, grasp
        self._take(grasp, self.load.begin(mean, grasp.response.pose, grasp.arm, self._bears))
        if attached:
            # What travel does to the tubes is not what the new equilibrium has more.
            self.usage = UsageLimits(grasp)
            self._begun[1] = self._even * self.load.bias


def attach_model(config: Configuration, grip: Grip, pressures: Pressure | None = None) -> HeldGrip:
    """
    Return the equilibrium near the measured pose, with a `response`.

    :param config: where the robot is.
    :param grip: its object is where it was measured.
    :param pressures: (t,) gauge, by tube [Pa]; those of the robot file if None.
    :raises NotHeldError: there is no such equilibrium.
    :raises GraspError: no such members.
    :raises StructureError: see `structure_of`.
    """
    members = find_members(config.robot, grip.members).members
    tubes = TubeModel(pressure=pressures)
    found = attach_grip(config, grip.body, members, tubes=tubes, quick=True)
    if found.response is None:
        raise NotHeldError(HoldStatus.UNSTABLE)
    return found


def _laid_grip(held: HeldGrip, friction: float) -> Grip:
    """
    Return the grip whose rows, see `grip_jacobian`, tell how a held object moves with the rollers.

    Members bend under a face that they press, so that the object is turned against the straight
    ones. On these its face is to lie as well: an object on a corner moves otherwise.

    :param held: how it is held.
    :param friction: coefficient between tubes and object.
    """
    body, contacts = held.body, held.contacts
    for ends in contacts.ends:
        if len(ends) == 1:
            continue
        robot, points = held.config.robot, held.config.points
        nodes = find_members(robot, (robot.member_names[contacts.members[ends[0]]],))
        axis = complex(np.diff(points[nodes.lines[0]])[0])
        normals = np.full(2, 1j * axis / (abs(axis) * body.turn))
        first, last = body.shape.surface_at(contacts.corners[ends], normals)[0] * body.turn
        # The shorter way to where both are parallel, either way around.
        turn = 0.5 * np.angle((axis / (last - first)) ** 2)
        x, y, angle = held.pose
        body = body.moved_to((x, y, math.remainder(angle + turn, 2.0 * math.pi)))
        break
    return Grip(held.member_names, body, friction)
