# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

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

from isotruss_ros.core.control.first_contact import FirstContact, Seen
from isotruss_ros.core.control.inputs import Timeline
from isotruss_ros.core.control.marker_gate import fits, judge_markers
from isotruss_ros.core.control.slip_watch import SlipWatch
from isotruss_ros.core.control.state_estimate import EstimatorSettings, StateEstimate
from isotruss_ros.core.control.state_filter import StateFilter
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grip import find_members, Grip
from isotruss_ros.core.model.pose import Pose, pose_difference
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.blas_threads import single_threaded
import numpy as np

#: After so many poses in a row that do not fit, the object is held elsewhere; after so many
#: messages of markers of which none fits, the zeros are elsewhere.
LOST = 5
#: The model serves to first order for this travel of any roller [m].
NEAR = 3e-3
#: Measurements count that are no older than this, and ahead of the encoders by no more [s].
OLDEST, AHEAD = 1.0, 0.05
#: An object that lay free is held when its squeeze is by so many deviations above zero.
FREE = 2.0


class StateEstimator:
    """
    An iterated Kalman filter over the zeros of the rollers and how an object is held.

    :ivar settings: what is known of the robot.
    :param robot: the robot, with its zeros and stiffness as far as they are known.
    :param settings: what else is known of it; as for one that was not homed if None.
    """

    def __init__(self, robot: Robot, settings: EstimatorSettings | None = None) -> None:
        self.settings = given = settings or EstimatorSettings()
        self._robot, self._filter = robot, StateFilter(robot, given)
        self._grip: Grip | None = None
        self._readings, self._slips = Timeline(), SlipWatch(len(robot.roller_names))
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
        :raises ConfigurationError: what was held is let go in a singular configuration.
        """
        if grip is not None:
            find_members(self._robot, grip.members)
        self._grip, self._contact = grip, FirstContact()
        self._filter.release()

    def take_encoders(self, time: float, readings: Array) -> None:
        """
        Go on to a reading of the encoders; one that is not later than the last does not count.

        :param time: of the reading [s].
        :param readings: (r,) roller travel since home [m].
        """
        if self._readings:
            before, last = self._readings.last
            if time <= before:
                return
            self._filter.predict(time - before, np.abs(readings - last))
        self._readings.add(time, np.array(readings, dtype=float))
        self._readings.discard_before(time - OLDEST)

    def take_pressures(self, pressures: tuple[float, ...] | None) -> None:
        """
        Model the tubes with measured pressures from now on, see `steady_pressures`.

        :param pressures: (t,) gauge, by tube in the order of the robot file [Pa]; None for those
            of the file.
        """
        self._filter.take_pressures(pressures)

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
        if self._grip is None or not self._in_time(time):
            return False
        readings, believed = self._readings.at(time), self._filter
        believed.go_to(readings)
        if believed.held is None:
            told = self._touch(time, readings, pose, deviations)
            sure = FREE if self._contact.lies else 1.0
            if not believed.attach(self._grip.moved_to(pose), readings, sure):
                return told
            self._contact, self._lost = FirstContact(), 0
        rows = np.arange(len(believed.expected.values))[-3:]
        expected, spread = believed.expect(rows)
        errors = self.settings.pose_error / np.array([1.0, 1.0, believed.held.arm])
        noise = np.diag(np.asarray(deviations) ** 2 + errors**2)
        off = pose_difference(pose, expected.values)
        if not fits(off, spread + noise):
            self._lost += 1
            if self._lost >= LOST:
                believed.release()
            return False
        self._lost = 0
        return believed.update(expected.values + off, noise, rows)

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
        if not joints or not self._in_time(time):
            return False
        readings = self._readings.at(time)
        believed = self._filter
        believed.go_to(readings)
        rows = np.array([2 * names.index(name) + i for name in joints for i in (0, 1)])
        expected, spread = believed.expect(rows)
        measured = np.array(list(joints.values()), dtype=float).ravel()
        noise = (deviation**2 + self.settings.joint_error**2) * np.eye(len(rows))
        used, slipped = judge_markers(
            (measured - expected.values).reshape(-1, 2),
            spread + noise,
            expected.rates[:, believed.rollers],
            np.ptp(self._readings.values, axis=0),
        )
        believed.doubt(slipped)
        told = np.array(list(joints))
        self._used = tuple(sorted(told[used].tolist()))
        self._left_out = tuple(sorted(told[~used].tolist()))
        self._strange = 0 if self._used else self._strange + 1
        if self._strange >= LOST:  # such as after the encoders began anew
            believed.doubt(np.full(len(readings), self.settings.zeros))  # type: ignore[arg-type]
            self._strange = 0
        chosen = np.flatnonzero(np.repeat(used, 2))
        if not self._used or not believed.update(
            measured[chosen], noise[np.ix_(chosen, chosen)], rows[chosen]
        ):
            return False
        belief, own = believed.belief, believed.rollers
        variances = np.diag(belief.covariance)[own] + self.settings.joint_error**2
        self._slips.add(time, readings, belief.mean[own], variances)
        return True

    @single_threaded
    def estimate(self) -> StateEstimate | None:
        """
        Return what is believed at the last reading of the encoders; None before the first.

        :raises ConfigurationError: no configuration of the robot fits the encoders.
        """
        if not self._readings:
            return None
        time, readings = self._readings.last
        given, model = self.settings, self._filter
        if np.abs(readings - model.readings).max() > NEAR:
            model.go_to(readings)
        belief = model.belief
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

    def _in_time(self, time: float) -> bool:
        """Return whether the readings of the encoders at a time are known."""
        known = self._readings
        return bool(known) and known.first[0] <= time <= known.last[0] + AHEAD

    def _touch(self, time: float, readings: Array, pose: Pose, deviations: Array) -> bool:
        """Take in what contacts with a free object tell; tell whether they tell something."""
        if time <= self._seen:
            return False
        self._seen = time
        model, placed = self._filter, self._grip.moved_to(pose)
        measured = np.array(pose), np.square(deviations)
        seen = Seen(*measured, readings, model.belief.mean, *model.depths(placed))
        told = self._contact.take(seen, model.belief, lambda: model.pressed_depths(placed))
        if told is None:
            return False
        model.learn_zero(told, readings)
        return True
