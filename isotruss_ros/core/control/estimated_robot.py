# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The robot and what it holds in an estimated state, and how both change with that."""

from __future__ import annotations

from dataclasses import replace
import math

from isotruss_ros.core.control.belief import Expectation
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_statics import TubeModel
from isotruss_ros.core.holding.held_gradient import held_gradient
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus
from isotruss_ros.core.holding.loaded_frame import held_joints
from isotruss_ros.core.holding.member_bow import bend_members
from isotruss_ros.core.holding.roll_grip import roll_contacts, roll_grip
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grip import find_members, Grip
from isotruss_ros.core.model.convex_object import segment_gaps
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.safety.distances import collision_model
import numpy as np

#: Derivatives of a held object serve for this travel of any roller [m].
KEPT = 3e-3

#: A depth at which members surely press [m], and the least of them when they press alike [-].
PRESSED, LEAST = 5e-3, 0.1


class EstimatedRobot:
    """
    The model of an estimated state x = (dphi, w, s, A).

    These are the offsets of the r rollers [m], the wrench (fx, fy, m / arm) on the held object
    [N], the stiffness against the model's [-], and the anchors of the k contacts [m]; without an
    object there are none of these.

    :ivar rollers: places of the offsets in the state.
    :ivar wrench: places of the wrench.
    :ivar stiffness: place of the stiffness.
    :ivar anchors: places of the anchors.
    :ivar held: how the object is held; None where it is not.
    :ivar state: (n,) in which the model was evaluated last.
    :ivar readings: (r,) of the encoders then [m].
    :ivar expected: where the joints are then (x0, y0, x1, y1, ...), and behind them the pose of
        the held object [m, rad].
    :ivar squeeze_rates: (n,) derivatives of the squeeze.
    :ivar tubes: with which an object is attached.
    :param robot: the robot.
    """

    def __init__(self, robot: Robot) -> None:
        count = len(robot.roller_names)
        self.robot, self.held = robot, None
        self.rollers, self.wrench = slice(0, count), slice(count, count + 3)
        self.stiffness, self.anchors = count + 3, slice(count + 4, None)
        self.state, self.readings = np.eye(1, count + 4, self.stiffness)[0], np.zeros(count)
        self.squeeze_rates, self.tubes = np.zeros(count + 4), TubeModel()
        self._differentiated: HeldGrip | None = None  # whose derivatives are expected
        self._config, self._joints = robot.home, 2 * len(robot.topology.joint_names)
        self.evaluate(self.readings, self.state)

    def evaluate(self, readings: Array, state: Array, follow: bool = False) -> None:
        """
        Find what is expected in a state.

        :param readings: (r,) of the encoders [m].
        :param state: (n,).
        :param follow: whether the rollers have gone there, so that ends of faces lift and lie
            down: then `held.anchors` are those there are now; else contacts stay those there are.
        :raises ConfigurationError: there is no such configuration.
        :raises GraspError: no equilibrium holds the object.
        """
        held, travel = self.held, readings + state[self.rollers]
        if held is None:
            config = self._config = self._config.moved_to(travel)
            rates = np.zeros((self._joints, len(state)))
            rates[:, self.rollers] = config.node_jacobian[: self._joints]
            self.expected = Expectation(config.nodes.ravel()[: self._joints], rates)
            self.readings, self.state = readings, state
            return
        # Members are as bent as they were last.
        bent = bend_members(held)
        config = held.config.moved_to(travel).shorten(bent.shorter)
        held = replace(held, statics=replace(held.statics, given=bent.given))
        anchors, wrench = state[self.anchors], state[self.wrench]
        if follow:
            wrench = wrench * (1.0, 1.0, held.arm)
            rolled = roll_grip(replace(held, anchors=anchors), config, wrench)
            if rolled is not None and rolled.hold(math.inf) is not HoldStatus.HELD:
                rolled = None
        else:
            rolled = roll_contacts(held, config, held.contacts, anchors, held.angles, wrench)
        if rolled is None:
            raise GraspError('no equilibrium holds the object in the estimated state')
        self._take(rolled, readings, np.append(state[: self.stiffness + 1], rolled.anchors))

    def attach(self, grip: Grip, readings: Array, state: Array) -> bool:
        """
        Begin to hold an object where it was measured.

        :param grip: the object there, and the members that would hold it.
        :param readings: (r,) of the encoders [m].
        :param state: (n,) without anchors.
        :return: whether the model can hold it.
        :raises ConfigurationError: there is no such configuration.
        :raises GraspError: the robot has no such members, or the equilibrium is indifferent.
        """
        members = find_members(self.robot, grip.members).members
        config = self._config.moved_to(readings + state[self.rollers])
        found = attach_grip(config, grip.body, members, tubes=self.tubes, quick=True)
        if isinstance(found, HoldStatus) or found.hold(math.inf) is not HoldStatus.HELD:
            return False
        self._take(found, readings, np.append(state, found.anchors))
        return True

    def take_pressures(self, pressures: tuple[float, ...] | None) -> None:
        """
        Model the tubes with other pressures from the next evaluation on.

        :param pressures: (t,) gauge, by tube [Pa]; None for those of the robot file.
        """
        if pressures == self.tubes.pressure:
            return
        self.tubes, self._differentiated = self.tubes._replace(pressure=pressures), None
        if self.held is not None:
            self.held = self.held.with_pressures(pressures)

    def release(self) -> None:
        """Hold nothing."""
        if self.held is not None:
            self.held, self._config = None, self.held.config
            self._differentiated = None

    def _take(self, held: HeldGrip, readings: Array, state: Array) -> None:
        """Go on with an equilibrium; derivatives are kept for a short way."""
        at, pose = held.config.roller_positions, held.state.unknowns[:3]
        known = self._differentiated
        near = known is not None and known.contacts is held.contacts
        if near and np.abs(at - known.config.roller_positions).max() < KEPT:
            places, rates = held_joints(held).ravel(), self.expected.rates
        else:
            found, self._differentiated = held_gradient(held), held
            places, rates = found.places, np.vstack([found.joints, found.pose])
            self.squeeze_rates = found.normal_forces.mean(axis=0)
        self.held = held
        self.expected = Expectation(np.concatenate([places, pose]), rates)
        self.readings, self.state = readings, state

    def depths(self, grip: Grip) -> tuple[Array, Array, Array]:
        """
        Return how deep an object is in the members where the model was evaluated, holding nothing.

        :param grip: with the object where it was measured.
        :return: (m,) [m], with derivatives by the state (m, n) and by the pose (m, 3).
        :raises GraspError: the robot has no such members.
        """
        config, body, parts = self._config, grip.body, collision_model(self.robot)
        members = find_members(self.robot, grip.members).members
        start, end = parts.part_ends(config, members)
        near = segment_gaps(body, start, end)
        rows = parts.part_rows(config, members, near.shares, -near.normals)
        rates = np.zeros((len(members), len(self.state)))
        rates[:, self.rollers] = -rows.view(np.float64) @ config.node_jacobian
        point = start + near.shares * (end - start) - near.gaps * near.normals
        lever = (1j * (point - body.center) * near.normals.conj()).real
        by_pose = np.column_stack([near.normals.real, near.normals.imag, lever])
        return parts.part_radii[members] - near.gaps, rates, by_pose

    def pressed_depths(self, grip: Grip) -> Array:
        """
        Return how deep an object would be in the members (m,) where all press on it [m].

        :param grip: with the object near there.
        :raises GraspError: the robot has no such members.
        """
        depths, _, by_pose = self.depths(grip)
        pose = np.array(grip.body.pose)
        pose[:2] += np.linalg.lstsq(by_pose[:, :2], PRESSED - depths, rcond=None)[0]
        members = find_members(self.robot, grip.members).members
        body = grip.body.moved_to(pose)
        found = attach_grip(self._config, body, members, tubes=self.tubes, quick=True)
        if isinstance(found, HoldStatus):
            return np.full(len(members), PRESSED)
        return np.maximum(self.depths(grip.moved_to(found.pose))[0], LEAST * PRESSED)
