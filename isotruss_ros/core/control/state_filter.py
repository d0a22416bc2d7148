# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The state of a robot and of what it holds, as far as it is known: an iterated Kalman filter."""

from __future__ import annotations

from dataclasses import replace
import math

from isotruss_ros.core.control.belief import Belief, Expectation, update_belief
from isotruss_ros.core.control.first_contact import Told
from isotruss_ros.core.control.inputs import steady_pressures
from isotruss_ros.core.control.state_estimate import EstimatorSettings
from isotruss_ros.core.errors import ConfigurationError, GraspError, StructureError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_statics import TubeModel
from isotruss_ros.core.holding.held_gradient import held_gradient
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus, NotHeldError
from isotruss_ros.core.holding.loaded_frame import held_joints
from isotruss_ros.core.holding.roll_grip import roll_contacts, roll_grip, with_pressures
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grip import find_members, Grip
from isotruss_ros.core.model.convex_object import segment_gaps
from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np

#: Deviation of the anchors of contacts before the object's pose tells them [m].
UNKNOWN = 0.05
#: What says that a state is none in which the object is held.
NOT_HELD = (ConfigurationError, GraspError, StructureError)
#: Slips are drawn anew over each such piece of travel [m].
SLIP_LENGTH = 0.1
#: Derivatives of a held object serve for this travel of any roller [m].
KEPT = 3e-3
#: A depth at which members surely press [m], and the least of them when they press alike [-].
PRESSED, LEAST = 5e-3, 0.1


class StateFilter:
    """
    What is believed of the state x = (dphi, w, s, A), and what is expected where it was last.

    These are the offsets of the r rollers [m], the wrench (fx, fy, m / arm) on the held object
    [N], the stiffness against the model's [-], and the anchors of the k contacts [m]; without an
    object there are none of these.

    :ivar belief: of the state.
    :ivar rollers: places of the offsets in the state.
    :ivar held: how the object is held in the model; None where it is not.
    :ivar state: (n,) in which the model was evaluated last.
    :ivar readings: (r,) of the encoders then [m].
    :ivar expected: where the joints are then (x0, y0, x1, y1, ...), and behind them the pose of
        the held object [m, rad].
    :ivar squeeze_rates: (n,) derivatives of the squeeze.
    :ivar tubes: with which an object is attached.
    :param robot: with its zeros and stiffness as far as they are known.
    :param settings: what else is known of it.
    """

    def __init__(self, robot: Robot, settings: EstimatorSettings) -> None:
        count = len(robot.roller_names)
        self._robot, self._settings = robot, settings
        self.held: HeldGrip | None = None
        self.rollers, self._wrench = slice(0, count), slice(count, count + 3)
        self._stiffness, self._anchors = count + 3, slice(count + 4, None)
        self.state, self.readings = np.eye(1, count + 4, self._stiffness)[0], np.zeros(count)
        self.squeeze_rates, self.tubes = np.zeros(count + 4), TubeModel()
        variances = np.repeat([settings.zeros, settings.load], (count, 3)) ** 2
        covariance = np.diag(np.append(variances, settings.stiffness**2))
        self.belief = Belief(self.state, covariance)
        self._differentiated: HeldGrip | None = None  # whose derivatives are expected
        self._config, self._joints = robot.home, 2 * len(robot.topology.joint_names)
        self.evaluate(self.readings, self.state)

    def predict(self, elapsed: float, way: Array) -> None:
        """
        Be less sure after a while.

        :param elapsed: [s].
        :param way: (r,) travel of the rollers since, not negative [m].
        """
        given, belief = self._settings, self.belief
        left = math.exp(-elapsed / given.load_time)
        kept, more = np.ones(len(belief.mean)), np.zeros(len(belief.mean))
        kept[self._wrench] = left
        more[self.rollers] = given.slip**2 * SLIP_LENGTH * way + given.drift**2 * elapsed
        more[self._wrench] = given.load**2 * (1.0 - left**2)
        covariance = belief.covariance * np.outer(kept, kept) + np.diag(more)
        self.belief = Belief(kept * belief.mean, covariance)

    def doubt(self, deviations: Array) -> None:
        """
        Be less sure of the zeros.

        :param deviations: (r,) by standard deviations [m].
        """
        covariance, own = self.belief.covariance.copy(), self.rollers
        covariance[own, own] += np.diag(deviations**2)
        self.belief = Belief(self.belief.mean, covariance)

    def take_pressures(self, pressures: tuple[float, ...] | None) -> None:
        """
        Model the tubes with other pressures from the next evaluation on.

        :param pressures: (t,) gauge, by tube [Pa]; None for those of the robot file. See
            `steady_pressures`.
        """
        pressures = steady_pressures(self.tubes.pressure, pressures)  # type: ignore[arg-type]
        if pressures == self.tubes.pressure:
            return
        self.tubes, self._differentiated = self.tubes._replace(pressure=pressures), None
        if self.held is not None:
            self.held = with_pressures(self.held, pressures)

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
        config = held.config.moved_to(travel)
        anchors, wrench = state[self._anchors], state[self._wrench]
        if follow:
            wrench = wrench * (1.0, 1.0, held.arm)
            rolled = roll_grip(replace(held, anchors=anchors), config, wrench)
            if rolled is not None and rolled.hold(math.inf) is not HoldStatus.HELD:
                rolled = None
        else:
            rolled = roll_contacts(held, config, held.contacts, anchors, held.angles, wrench)
        if rolled is None:
            raise GraspError('no equilibrium holds the object in the estimated state')
        self._take(rolled, readings, np.append(state[: self._stiffness + 1], rolled.anchors))

    def go_to(self, readings: Array) -> None:
        """
        Evaluate the model; release what it cannot hold there.

        :param readings: (r,) of the encoders [m].
        :raises ConfigurationError: there is no such configuration.
        """
        if self.held is not None:
            contacts = self.held.contacts
            try:
                self.evaluate(readings, self.belief.mean, follow=True)
                if self.held.contacts is not contacts:
                    self._begin(self.state)
                return
            except NOT_HELD:
                self.release()
        self.evaluate(readings, self.belief.mean)

    def attach(self, grip: Grip, readings: Array, sure: float) -> bool:
        """
        Begin to hold an object where it was measured; tell whether the model can for sure.

        :param grip: the object there, and the members that would hold it.
        :param readings: (r,) of the encoders [m].
        :param sure: by so many of its deviations the squeeze is above zero: it may not even touch.
        """
        belief, own = self.belief, self.rollers
        try:
            config = self._config.moved_to(readings + belief.mean[own])
            found = self._attach(config, grip)
            if found.hold(math.inf) is not HoldStatus.HELD:
                return False
            self._take(found, readings, np.append(belief.mean, found.anchors))
        except NOT_HELD:
            return False
        by_rollers = self.squeeze_rates[own]
        unsure = math.sqrt(by_rollers @ belief.covariance[own, own] @ by_rollers)
        if found.squeeze < sure * unsure:
            self._let_go()
            self.evaluate(readings, belief.mean)
            return False
        self._begin(self.state)
        return True

    def release(self) -> None:
        """Hold no object in the model; what is known of the rollers is kept."""
        self._let_go()
        self._begin(self.belief.mean[: self._stiffness + 1])
        self.evaluate(self.readings, self.belief.mean)

    def expect(self, rows: Indices) -> tuple[Expectation, Array]:
        """
        Return some of what the model expects where it was evaluated last, and its covariance.

        :param rows: numbers (m,) in `expected`.
        :return: with the (m, m) covariance from state and encoders.
        """
        expected = self._expect(rows)
        return expected, self.belief.spread(expected.rates) + self._encoder_noise(expected.rates)

    def update(self, measured: Array, noise: Array, rows: Indices) -> bool:
        """
        Take measurements in where the model was evaluated last.

        :param measured: (m,).
        :param noise: (m, m) covariance, that of the encoders aside.
        :param rows: (m,) see `expect`.
        :return: whether that worked; the object is released where not.
        """
        prior = self.belief
        noise = noise + self._encoder_noise(self._expect(rows).rates)

        def expect(mean: Array) -> Expectation:
            if mean is not prior.mean:
                self.evaluate(self.readings, mean)
            return self._expect(rows)

        try:
            self.belief = update_belief(prior, measured, noise, expect, self._stiffness)
        except NOT_HELD:
            self.release()
            return False
        return True

    def learn_zero(self, told: Told, readings: Array) -> None:
        """
        Take in what is zero of the state.

        :param told: by the contacts of a free object.
        :param readings: (r,) of the encoders then [m].
        """
        prior, rates, noise = self.belief, told.rates[None], np.array([[told.variance]])

        def expect(mean: Array) -> Expectation:
            return Expectation(told.value + rates @ (mean - prior.mean), rates)

        self.belief = update_belief(prior, np.zeros(1), noise, expect, self._stiffness)
        self.evaluate(readings, self.belief.mean)

    def depths(self, grip: Grip) -> tuple[Array, Array, Array]:
        """
        Return how deep an object is in the members where the model was evaluated, holding nothing.

        :param grip: with the object where it was measured.
        :return: (m,) [m], with derivatives by the state (m, n) and by the pose (m, 3).
        :raises GraspError: the robot has no such members.
        """
        config, body, parts = self._config, grip.body, collision_model(self._robot)
        members = find_members(self._robot, grip.members).members
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
        try:
            found = self._attach(self._config, grip.moved_to(pose))
        except NotHeldError:
            return np.full(len(depths), PRESSED)
        return np.maximum(self.depths(grip.moved_to(found.pose))[0], LEAST * PRESSED)

    def _let_go(self) -> None:
        """Hold nothing."""
        if self.held is not None:
            self.held, self._config = None, self.held.config  # type: ignore[attr-defined]
            self._differentiated = None

    def _begin(self, state: Array) -> None:
        """Begin with unknown anchors of the contacts that there are in a state (n,)."""
        known = slice(self._stiffness + 1)
        covariance = UNKNOWN**2 * np.eye(len(state))
        covariance[known, known] = self.belief.covariance[known, known]
        self.belief = Belief(state, covariance)

    def _expect(self, rows: Indices) -> Expectation:
        """Return rows (m,) of what the model expects."""
        values, rates = self.expected
        return Expectation(values[rows], rates[rows])

    def _encoder_noise(self, rates: Array) -> Array:
        """Return what noise of the encoders does to measurements of some rates (m, n), (m, m)."""
        by_rollers = rates[:, self.rollers]
        return self._settings.encoders**2 * by_rollers @ by_rollers.T

    def _attach(self, config: Configuration, grip: Grip) -> HeldGrip:
        """Return how members hold an object near its pose."""
        members = find_members(self._robot, grip.members).members
        return attach_grip(config, grip.body, members, tubes=self.tubes, quick=True)

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
