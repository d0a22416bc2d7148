# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The state of a robot and of what it holds, as far as it is known: an iterated Kalman filter."""

from __future__ import annotations

import math

from isotruss_ros.core.control.belief import Belief, Expectation, update_belief
from isotruss_ros.core.control.estimated_robot import EstimatedRobot
from isotruss_ros.core.control.first_contact import Told
from isotruss_ros.core.control.state_estimate import EstimatorSettings
from isotruss_ros.core.errors import ConfigurationError, GraspError, StructureError
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np

#: Deviation of the anchors of contacts before the object's pose tells them [m].
UNKNOWN = 0.05
#: What says that a state is none in which the object is held.
NOT_HELD = (ConfigurationError, GraspError, StructureError)
#: Slips are drawn anew over each such piece of travel [m].
SLIP_LENGTH = 0.1


class StateFilter:
    """
    What is believed of the state of a model, and the model where it was evaluated last.

    :ivar belief: of the state.
    :ivar model: see `EstimatedRobot`.
    :param robot: with its zeros and stiffness as far as they are known.
    :param settings: what else is known of it.
    """

    def __init__(self, robot: Robot, settings: EstimatorSettings) -> None:
        self._settings, self.model = settings, EstimatedRobot(robot)
        zeros = [settings.zeros**2] * len(robot.roller_names)
        variances = [*zeros, *[settings.load**2] * 3, settings.stiffness**2]
        self.belief = Belief(self.model.state, np.diag(variances))

    def predict(self, elapsed: float, way: Array) -> None:
        """
        Be less sure after a while.

        :param elapsed: [s].
        :param way: (r,) travel of the rollers since, not negative [m].
        """
        given, model, belief = self._settings, self.model, self.belief
        left = math.exp(-elapsed / given.load_time)
        kept, more = np.ones(len(belief.mean)), np.zeros(len(belief.mean))
        kept[model.wrench] = left
        more[model.rollers] = given.slip**2 * SLIP_LENGTH * way + given.drift**2 * elapsed
        more[model.wrench] = given.load**2 * (1.0 - left**2)
        covariance = belief.covariance * np.outer(kept, kept) + np.diag(more)
        self.belief = Belief(kept * belief.mean, covariance)

    def doubt(self, deviations: Array) -> None:
        """
        Be less sure of the zeros.

        :param deviations: (r,) by standard deviations [m].
        """
        covariance, own = self.belief.covariance.copy(), self.model.rollers
        covariance[own, own] += np.diag(deviations**2)
        self.belief = Belief(self.belief.mean, covariance)

    def go_to(self, readings: Array) -> None:
        """
        Evaluate the model; release what it cannot hold there.

        :param readings: (r,) of the encoders [m].
        :raises ConfigurationError: there is no such configuration.
        """
        model = self.model
        if model.held is not None:
            contacts = model.held.contacts
            try:
                model.evaluate(readings, self.belief.mean, follow=True)
                if model.held.contacts is not contacts:
                    self._begin()
                return
            except NOT_HELD:
                self.release()
        model.evaluate(readings, self.belief.mean)

    def attach(self, grip: Grip, readings: Array, sure: float) -> bool:
        """
        Begin to hold an object where it was measured; tell whether the model can for sure.

        :param grip: the object there, and the members that would hold it.
        :param readings: (r,) of the encoders [m].
        :param sure: by so many of its deviations the squeeze is above zero: it may not even touch.
        """
        model, belief = self.model, self.belief
        try:
            held = model.attach(grip, readings, belief.mean)
        except NOT_HELD:
            return False
        if not held:
            return False
        own = model.rollers
        by_rollers = Belief(belief.mean[own], belief.covariance[own, own])
        unsure = math.sqrt(by_rollers.spread(model.squeeze_rates[None, own])[0, 0])
        if model.held.squeeze < sure * unsure:
            model.release()
            model.evaluate(readings, belief.mean)
            return False
        self._begin()
        return True

    def release(self) -> None:
        """Hold no object in the model; what is known of the rollers is kept."""
        model = self.model
        model.release()
        model.evaluate(model.readings, self.belief.mean[: model.stiffness + 1])
        self._begin()

    def _begin(self) -> None:
        """Begin with unknown anchors of the contacts that there are."""
        state, known = self.model.state, slice(self.model.stiffness + 1)
        covariance = UNKNOWN**2 * np.eye(len(state))
        covariance[known, known] = self.belief.covariance[known, known]
        self.belief = Belief(state, covariance)

    def expect(self, rows: Indices) -> tuple[Expectation, Array]:
        """
        Return some of what the model expects where it was evaluated last, and its covariance.

        :param rows: numbers (m,) in `EstimatedRobot.expected`.
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
        model, prior = self.model, self.belief
        noise = noise + self._encoder_noise(self._expect(rows).rates)

        def expect(mean: Array) -> Expectation:
            if mean is not prior.mean:
                model.evaluate(model.readings, mean)
            return self._expect(rows)

        try:
            self.belief = update_belief(prior, measured, noise, expect, model.stiffness)
        except NOT_HELD:
            self.release()
            return False
        return True

    def _expect(self, rows: Indices) -> Expectation:
        """Return rows (m,) of what the model expects."""
        values, rates = self.model.expected
        return Expectation(values[rows], rates[rows])

    def _encoder_noise(self, rates: Array) -> Array:
        """Return what noise of the encoders does to measurements of some rates (m, n), (m, m)."""
        by_rollers = rates[:, self.model.rollers]
        return self._settings.encoders**2 * by_rollers @ by_rollers.T

    def learn_zero(self, told: Told, readings: Array) -> None:
        """
        Take in what is zero of the state.

        :param told: by the contacts of a free object.
        :param readings: (r,) of the encoders then [m].
        """
        prior, rates, noise = self.belief, told.rates[None], np.array([[told.variance]])

        def expect(mean: Array) -> Expectation:
            return Expectation(told.value + rates @ (mean - prior.mean), rates)

        self.belief = update_belief(prior, np.zeros(1), noise, expect, self.model.stiffness)
        self.model.evaluate(readings, self.belief.mean)
