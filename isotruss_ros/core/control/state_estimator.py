# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Where the robot is, and how hard it squeezes: encoders, the object's pose and markers together.

Encoders miss what slips, and zeros are as good as the homing. The state is what has to be added to
the readings, the wrench on the held object, and what stays as its contacts roll:

    x = (dphi, w, s, A),  y = equilibrium of (FK(q + dphi), w, s, A),  z = h(y, x) + v

The stiffness s moves nothing that is measured: it is only considered. A measurement counts at its
stamp: q is what the encoders read then, and x hardly changes while it is on its way.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
import math

from isotruss_ros.core.control.belief import Belief, Expectation, update_belief
from isotruss_ros.core.control.estimated_robot import EstimatedRobot
from isotruss_ros.core.control.first_contact import FirstContact, Seen
from isotruss_ros.core.control.inputs import steady_pressures
from isotruss_ros.core.control.marker_gate import fits, judge_markers
from isotruss_ros.core.control.reading_history import ReadingHistory
from isotruss_ros.core.control.slip_watch import SlipWatch
from isotruss_ros.core.control.state_estimate import EstimatorSettings, StateEstimate
from isotruss_ros.core.errors import ConfigurationError, GraspError, StructureError
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grip import find_members, Grip
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.blas_threads import single_threaded
import numpy as np

#: Deviation of the anchors of contacts before the object's pose tells them [m].
UNKNOWN = 0.05
#: After so many poses in a row that do not fit, the object is held elsewhere; after so many
#: messages of markers of which none fits, the zeros are elsewhere.
LOST = 5
#: The model serves to first order for this travel of any roller [m].
NEAR = 3e-3
#: What says that a state is none in which the object is held.
NOT_HELD = (ConfigurationError, GraspError, StructureError)
#: An object that lay free is held when its squeeze is by so many deviations above zero.
FREE = 2.0
#: Slips are drawn anew over each such piece of travel [m].
SLIP_LENGTH = 0.1


class StateEstimator:
    """
    An iterated Kalman filter over the zeros of the rollers and how an object is held.

    :ivar settings: what is known of the robot.
    :param robot: the robot, with its zeros and stiffness as far as they are known.
    :param settings: what else is known of it; as for one that was not homed if None.
    """

    def __init__(self, robot: Robot, settings: EstimatorSettings | None = None) -> None:
        self.settings = given = settings or EstimatorSettings()
        self._robot, self._model, self._grip = robot, EstimatedRobot(robot), None
        count = len(robot.roller_names)
        variances = [given.zeros**2] * count + [given.load**2] * 3 + [given.stiffness**2]
        self._belief = Belief(self._model.state, np.diag(variances))
        self._history, self._slips = ReadingHistory(), SlipWatch(count)
        self._contact, self._seen = FirstContact(), -math.inf
        self._lost = self._strange = 0
        self._used: tuple[str, ...] = ()
        self._left_out: tuple[str, ...] = ()

    @property
    def grip(self) -> Grip | None:
        """Return members and object that are held where the measured pose says so."""
        return self._grip

    @grip.setter
    def grip(self, grip: Grip | None) -> None:
        """
        Choose what can be held.

        :param grip: with the object anywhere; None for nothing.
        :raises GraspError: the robot has no such members.
        """
        if grip is not None:
            find_members(self._robot, grip.members)
        self._grip = grip
        self._release()

    def take_encoders(self, time: float, readings: Array) -> None:
        """
        Go on to a reading of the encoders; one that is not later than the last does not count.

        :param time: of the reading [s].
        :param readings: (r,) roller travel since home [m].
        """
        last = self._history.last
        if last is not None:
            if time <= last[0]:
                return
            self._predict(time - last[0], np.abs(readings - last[1]))
        self._history.add(time, readings)

    def take_pressures(self, pressures: tuple[float, ...] | None) -> None:
        """
        Model the tubes with measured pressures from now on, see `steady_pressures`.

        :param pressures: (t,) gauge, by tube in the order of the robot file [Pa]; None for those
            of the file.
        """
        model = self._model
        model.take_pressures(steady_pressures(model.tubes.pressure, pressures))

    @single_threaded
    def take_pose(self, time: float, pose: Pose, deviations: Array) -> bool:
        """
        Take in where the object was measured.

        :param time: of the measurement [s].
        :param pose: of the object, robot frame.
        :param deviations: (3,) standard deviations of x, y [m] and angle [rad], positive.
        :return: whether it counts: in time, of an object that the robot holds, and it fits.
        :raises ConfigurationError: no configuration of the robot fits the encoders.
        """
        readings, model = self._history.at(time), self._model
        if readings is None or self._grip is None:
            return False
        self._go_to(readings)
        if model.held is None:
            told = self._touch(time, readings, pose, deviations)
            if not self._attach(readings, pose):
                return told
        rows = np.arange(len(model.expected.values))[-3:]
        expected = self._expect(rows)
        errors = self.settings.pose_error / np.array([1.0, 1.0, model.held.arm])
        noise = np.diag(np.asarray(deviations) ** 2 + errors**2)
        noise += self._encoder_noise(expected.rates)
        measured = np.array(pose)
        turned = measured[2] - expected.values[2]
        measured[2] = expected.values[2] + math.remainder(turned, 2.0 * math.pi)
        spread = self._belief.spread(expected.rates)
        if not fits(measured - expected.values, spread + noise):
            self._lost += 1
            if self._lost >= LOST:
                self._release()
            return False
        self._lost = 0
        return self._update(measured, noise, rows)

    @single_threaded
    def take_markers(
        self, time: float, joints: Mapping[str, tuple[float, float]], deviation: float
    ) -> bool:
        """
        Take in where joints were measured; those that do not fit are left out.

        :param time: of the measurement [s].
        :param joints: (x, y) by the name of the joint, robot frame [m].
        :param deviation: standard deviation of a coordinate, positive [m].
        :return: whether some of them count.
        :raises ConfigurationError: no configuration of the robot fits the encoders.
        :raises GraspError: the robot has no such joint.
        """
        names = self._robot.topology.joint_names
        for name in joints:
            if name not in names:
                raise GraspError(f'joint {name!r}: must be one of {", ".join(names)}')
        readings = self._history.at(time)
        if readings is None or not joints:
            return False
        self._go_to(readings)
        rows = np.array([2 * names.index(name) + i for name in joints for i in (0, 1)])
        expected = self._expect(rows)
        measured = np.array(list(joints.values()), dtype=float).ravel()
        noise = (deviation**2 + self.settings.joint_error**2) * np.eye(len(rows))
        noise += self._encoder_noise(expected.rates)
        verdict = judge_markers(
            (measured - expected.values).reshape(-1, 2),
            self._belief.spread(expected.rates) + noise,
            expected.rates[:, self._model.rollers],
            self._history.spread,
        )
        if verdict.slips is not None:
            self._doubt(verdict.slipped * np.eye(len(readings))[verdict.slips])
        told = np.array(list(joints))
        self._used = tuple(sorted(told[verdict.fits].tolist()))
        self._left_out = tuple(sorted(told[~verdict.fits].tolist()))
        self._strange = 0 if self._used else self._strange + 1
        if self._strange >= LOST:  # such as after the encoders began anew
            self._doubt(np.full(len(readings), self.settings.zeros))
            self._strange = 0
        chosen = np.flatnonzero(np.repeat(verdict.fits, 2))
        if not self._used or not self._update(
            measured[chosen], noise[np.ix_(chosen, chosen)], rows[chosen]
        ):
            return False
        own = self._model.rollers
        variances = np.diag(self._belief.covariance)[own] + self.settings.joint_error**2
        self._slips.add(time, readings, self._belief.mean[own], variances)
        return True

    @single_threaded
    def estimate(self) -> StateEstimate | None:
        """
        Return what is believed at the last reading of the encoders; None before the first.

        :raises ConfigurationError: no configuration of the robot fits the encoders.
        """
        if self._history.last is None:
            return None
        time, readings = self._history.last
        if np.abs(readings - self._model.readings).max() > NEAR:
            self._go_to(readings)
        belief, given, model = self._belief, self.settings, self._model
        # To first order from where the model was last.
        beyond = belief.mean - model.state
        beyond[model.rollers] += readings - model.readings
        values = model.expected.values + model.expected.rates @ beyond
        joints = 2 * len(self._robot.topology.joint_names)
        spread = belief.spread(model.expected.rates)
        slipping = zip(self._robot.roller_names, self._slips.slipping, strict=True)
        found = StateEstimate(
            time,
            belief.mean[model.rollers].copy(),
            belief.covariance[model.rollers, model.rollers].copy(),
            readings + belief.mean[model.rollers],
            values[:joints].reshape(-1, 2),
            spread[:joints, :joints] + given.joint_error**2 * np.eye(joints),
            used=self._used,
            left_out=self._left_out,
            slipping=tuple(name for name, slips in slipping if slips),
        )
        if model.held is None:
            return found
        squeeze = model.held.squeeze + float(model.squeeze_rates @ beyond)
        variance = float(belief.spread(model.squeeze_rates[None])[0, 0])
        errors = given.pose_error / np.array([1.0, 1.0, model.held.arm])
        return replace(
            found,
            pose=values[joints:],
            pose_covariance=spread[joints:, joints:] + np.diag(errors**2),
            squeeze=squeeze,
            squeeze_deviation=math.sqrt(variance + (given.squeeze_error * squeeze) ** 2),
        )

    def _predict(self, elapsed: float, way: Array) -> None:
        """Be less sure after a while, and after some travel (r,) of the rollers."""
        given, wrench = self.settings, self._model.wrench
        mean, covariance = self._belief.mean.copy(), self._belief.covariance.copy()
        left = math.exp(-elapsed / given.load_time)
        mean[wrench] *= left
        covariance[wrench] *= left
        covariance[:, wrench] *= left
        more = np.zeros(len(mean))
        more[self._model.rollers] = given.slip**2 * SLIP_LENGTH * way + given.drift**2 * elapsed
        more[wrench] = given.load**2 * (1.0 - left**2)
        self._belief = Belief(mean, covariance + np.diag(more))

    def _doubt(self, deviations: Array) -> None:
        """Be less sure of the zeros by standard deviations (r,) [m]."""
        more = np.zeros(len(self._belief.mean))
        more[self._model.rollers] = deviations**2
        covariance = self._belief.covariance + np.diag(more)
        self._belief = replace(self._belief, covariance=covariance)

    def _go_to(self, readings: Array) -> None:
        """Evaluate the model at a reading of the encoders; release what it cannot hold there."""
        model = self._model
        if model.held is not None:
            try:
                if not model.follow(readings, self._belief.mean):
                    self._begin()
                return
            except NOT_HELD:
                self._release()
        model.evaluate(readings, self._belief.mean)

    def _attach(self, readings: Array, pose: Pose) -> bool:
        """Begin to hold the object where it was measured; tell whether the model can for sure."""
        model, belief = self._model, self._belief
        try:
            held = model.attach(self._grip.moved_to(pose), readings, belief.mean)
        except NOT_HELD:
            return False
        if not held:
            return False
        own = model.rollers
        by_rollers = Belief(belief.mean[own], belief.covariance[own, own])
        unsure = math.sqrt(by_rollers.spread(model.squeeze_rates[None, own])[0, 0])
        sure = FREE if self._contact.lies else 1.0
        if model.held.squeeze < sure * unsure:  # it may not even touch
            model.release()
            model.evaluate(readings, belief.mean)
            return False
        self._begin()
        return True

    def _touch(self, time: float, readings: Array, pose: Pose, deviations: Array) -> bool:
        """Take in what contacts with a free object tell; tell whether they tell something."""
        if time <= self._seen:
            return False
        self._seen = time
        belief, placed = self._belief, self._grip.moved_to(pose)
        depths = self._model.depths(placed)
        seen = Seen(np.array(pose), np.square(deviations), readings, belief.mean, depths)
        told = self._contact.take(seen, belief, lambda: self._model.pressed_depths(placed))
        if told is None:
            return False

        def expect(mean: Array) -> Expectation:
            return Expectation(
                told.value + told.rates[None] @ (mean - belief.mean), told.rates[None]
            )

        considered, noise = np.array([self._model.stiffness]), np.array([[told.variance]])
        first = expect(belief.mean)
        self._belief = update_belief(belief, np.zeros(1), noise, expect, first, considered)
        self._model.evaluate(readings, self._belief.mean)
        return True

    def _begin(self) -> None:
        """Begin with unknown anchors of contacts that are new to the model."""
        state, size = self._model.state, self._model.stiffness + 1
        covariance = UNKNOWN**2 * np.eye(len(state))
        covariance[:size, :size] = self._belief.covariance[:size, :size]
        self._belief, self._lost = Belief(state, covariance), 0

    def _release(self) -> None:
        """Hold no object in the model; what is known of the rollers is kept."""
        size = self._model.stiffness + 1
        mean, covariance = self._belief.mean[:size], self._belief.covariance[:size, :size]
        self._belief, self._lost = Belief(mean, covariance), 0
        self._contact = FirstContact()
        self._model.release()
        self._model.evaluate(self._model.readings, mean)

    def _expect(self, rows: Indices) -> Expectation:
        """Return these rows of what the model expects."""
        values, rates = self._model.expected
        return Expectation(values[rows], rates[rows])

    def _update(self, measured: Array, noise: Array, rows: Indices) -> bool:
        """Take in measurements (m,), these rows of what is expected; tell whether that worked."""
        model = self._model

        def expect(mean: Array) -> Expectation:
            model.evaluate(model.readings, mean)
            return self._expect(rows)

        considered = np.array([model.stiffness])
        first = self._expect(rows)
        try:
            self._belief = update_belief(self._belief, measured, noise, expect, first, considered)
        except NOT_HELD:
            self._release()
            return False
        return True

    def _encoder_noise(self, rates: Array) -> Array:
        """Return what noise of the encoders does to measurements of some rates (m, n), (m, m)."""
        by_rollers = rates[:, self._model.rollers]
        return self.settings.encoders**2 * by_rollers @ by_rollers.T
