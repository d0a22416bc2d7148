# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
State estimation of the robot from encoders, the object's pose and joint markers.

Encoders do not measure slip, and the calibration of home has errors. Markers correct the roller
offsets, see `OffsetFilter`. Measured poses correct the state of the grip, see `GripBelief`, in
which the covariance of the offsets is taken into account. Measurements are processed at the times
of their stamps.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
import math

from isotruss_ros.core.errors import ConfigurationError, GraspError, StructureError
from isotruss_ros.core.estimation.equilibrium_cache import Pressures
from isotruss_ros.core.estimation.grip_tracker import GripTracker
from isotruss_ros.core.estimation.offset_filter import Markers, OffsetFilter
from isotruss_ros.core.estimation.state_estimate import (
    EstimatorSettings,
    JUMP_LENGTH,
    StateEstimate,
)
from isotruss_ros.core.holding.grip_record import GripEstimate, GripRecord
from isotruss_ros.core.inputs import HISTORY_DURATION, StampedInput, Timeline, UsedReadings
from isotruss_ros.core.kinematics.configuration import ConfigurationTracker
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grip import find_members, Grip
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import Array, finite_array, MAX_MAGNITUDE
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.statics.tube_stiffness import tube_pressures
import numpy as np
from numpy.typing import ArrayLike


class StateEstimator:
    """Estimator of roller offsets, and of pose and squeeze of a held object."""

    @check_kinds
    def __init__(self, robot: Robot, settings: EstimatorSettings | None = None) -> None:
        self.settings = settings or EstimatorSettings()
        self.grip: Grip | None = None
        self._robot, self._tracker = robot, ConfigurationTracker(robot.home)
        self._filter = OffsetFilter(robot, self.settings)
        self._grip = GripTracker(offsets=self._filter.offsets)
        #: Estimate of the control loop that tracks the grip; None: this estimator tracks it.
        self._received: GripEstimate | None = None
        self._readings, self._used_markers = Timeline(), UsedReadings()
        self._roll_time = 0.0  # time of the readings to which the grip was rolled [s]
        self._used_offsets = self._filter.offsets  # roller offsets in the equilibrium of the grip

    @check_kinds
    def set_grip(self, grip: Grip) -> None:
        """Set the grip that may hold an object, with the object at any pose."""
        find_members(self._robot.topology, grip.members)
        self.grip, self._grip, self._received = grip, self._grip.discarded(), None

    def take_encoders(self, time: float, readings: Array) -> None:
        """Advance to encoder readings (r,), travel minus offset [m]; skip older readings."""
        readings = self._robot.check_rollers(readings, 'encoder readings [m]')
        (time,) = finite_array([time], 1, 'time of the readings [s]', ConfigurationError).tolist()
        if self._readings:
            previous_time, previous = self._readings.last
            if time <= previous_time:
                return
            self._filter.predict(time - previous_time, np.abs(readings - previous))
        self._readings = self._readings.added(time, readings).since(time - HISTORY_DURATION)

    def take_pressures(self, pressures: Pressures) -> None:
        """Use gauge pressures (t,) [Pa], or those of the robot file; see `steady_pressures`."""
        if pressures is not None:
            pressures = tube_pressures(self._robot.description, pressures)
        self._grip = self._grip.with_pressures(pressures)

    @check_kinds
    def take_grip(self, record: GripRecord | None) -> None:
        """
        Use the grip estimated by a control loop from now on, instead of measured poses.

        :param record: the grip with its estimate; None: poses are used.
        """
        received = None if record is None else record.estimate
        if self.grip is not None and received is not self._received:
            self._grip, self._received = self._grip.discarded(), received
            self._used_offsets = self._filter.offsets

    @single_threaded
    def take_pose(self, time: float, pose: Pose, deviations: Array) -> bool:
        """
        Update the belief of the grip with a measured pose; return whether it was used.

        Old and repeated poses, and poses without a held object, are not used.

        :param deviations: (3,) standard deviations of x, y [m] and angle [rad], positive.
        """
        what = "the object's pose (x, y, angle) [m, rad]"
        pose = Pose(*finite_array(pose, 3, what, GraspError, MAX_MAGNITUDE).tolist())
        deviations = _positive(deviations, 3, 'deviations of the pose [m, rad]')
        if self.grip is None or self._received is not None or not self._in_time(time):
            return False
        self._roll()
        self._grip, is_new = self._grip.observed(StampedInput(pose, time), self._roll_time - time)
        if not is_new:
            return False
        belief = self._grip.belief
        if belief is not None and belief.state.jump <= JUMP_LENGTH and not belief.slipped:
            return True
        # Without a belief, and after a jump or slip, a belief starts at the measured pose.
        offsets, covariance = self._filter.offsets, self._filter.offset_covariance
        config = self._tracker.configuration(self._readings.last[1] + offsets)
        grip, tracker = self.grip.moved_to(pose), self._grip.discarded()
        tracker = tracker.with_offsets(offsets, covariance)
        tracker, _ = tracker.searched(config, grip, self.settings, deviations)
        belief = tracker.belief
        is_held = belief is not None and belief.squeeze > belief.geometric_deviation
        self._grip = tracker if is_held else tracker.discarded()
        self._used_offsets = offsets
        return is_held

    @single_threaded
    def take_markers(self, time: float, joints: Markers, deviation: float) -> bool:
        """
        Update the roller offsets with markers on joints; reject inconsistent markers.

        :param joints: measured position (x, y) for the name of each joint, robot frame [m].
        :param deviation: standard deviation of a coordinate, positive [m].
        :return: whether at least one marker was used; old and repeated markers are not used.
        """
        (deviation,) = _positive([deviation], 1, 'deviation of the markers [m]').tolist()
        names = self._robot.topology.joint_names
        for name, xy in joints.items():
            if name not in names:
                raise GraspError(f'joint {name!r}: must be one of {", ".join(names)}')
            finite_array(xy, 2, f'marker on joint {name} [m]', GraspError, MAX_MAGNITUDE)
        if not self._in_time(time):
            return False
        markers = {}
        for name, xy in joints.items():
            self._used_markers, is_new = self._used_markers.use(name, time, xy)
            if is_new:
                markers[name] = xy
        if not markers:
            return False
        self._roll()
        readings, offset_filter = self._readings.at(time), self._filter
        reach = np.ptp(self._readings.values, axis=0)
        model = partial(self._place_joints, readings)
        if not offset_filter.take_markers(time, markers, deviation, readings, reach, model):
            return False
        covariance = offset_filter.offset_covariance
        self._grip = self._grip.with_offsets(offset_filter.offsets, covariance)
        return True

    @single_threaded
    def estimate(self) -> StateEstimate | None:
        """Return the estimate at the last encoder reading; None before the first one."""
        if not self._readings:
            return None
        # Offsets and joint positions, whose covariance is B C B^T plus that of joint errors.
        self._roll()
        time, readings = self._readings.last
        offset_filter, grip = self._filter, self._held
        offsets, covariance = offset_filter.offsets.copy(), offset_filter.offset_covariance
        positions, rates = self._place_joints(readings, offsets)
        by_offsets = rates @ covariance @ rates.T
        joint_covariance = by_offsets + self.settings.joint_error**2 * np.eye(len(positions))
        travel, joints = readings + offsets, positions.reshape(-1, 2)
        findings = {
            'is_improbable': offset_filter.is_improbable,
            'may_be_upright': offset_filter.may_be_upright,
            **offset_filter.findings,
        }
        estimate = StateEstimate(
            time, offsets, covariance, travel, joints, joint_covariance, **findings
        )
        if grip is None:
            return estimate
        # Pose and squeeze, with the errors of the model.
        model_errors = self.settings.pose_error / np.array([1.0, 1.0, self.grip.body.arm])
        # If errors that are not in the model move the joints, the squeeze is unknown. The weight
        # of an upright robot bends the tubes around the object as well.
        is_unknown = offset_filter.is_improbable or offset_filter.may_be_upright
        deviation = math.hypot(grip.squeeze_deviation, is_unknown * grip.squeeze)
        return replace(
            estimate,
            pose=grip.pose,
            pose_covariance=grip.pose_covariance + np.diag(model_errors**2),
            squeeze=grip.squeeze,
            squeeze_deviation=deviation,
            delay=grip.delay,
        )

    @property
    def _held(self) -> GripEstimate | None:
        """Return the received or tracked estimate of the held object; None without an object."""
        belief = self._grip.belief
        return self._received if belief is None else belief.estimate

    def _roll(self) -> None:
        """Roll the held object to the last encoder reading; discard the belief if it is lost."""
        (time, readings), offsets = self._readings.last, self._filter.offsets
        elapsed, self._roll_time = time - self._roll_time, time
        belief = self._grip.belief
        if belief is None or elapsed == 0.0:
            return
        try:
            config = belief.held.config.moved_to(readings + offsets)
            self._grip, _ = self._grip.followed(config, elapsed)
        except (ConfigurationError, GraspError, StructureError):
            self._grip = self._grip.discarded()
        self._used_offsets = offsets

    def _place_joints(self, readings: Array, offsets: Array) -> tuple[Array, Array]:
        """Return the joint positions (2j,) [m], and their Jacobian by the roller offsets."""
        count, grip = 2 * len(self._robot.topology.joint_names), self._held
        config = self._tracker.configuration(readings + offsets)
        positions, rates = config.nodes.ravel()[:count], config.node_jacobian[:count]
        if grip is None:
            return positions, rates
        changes = grip.displacement_rates @ (offsets - self._used_offsets)
        return positions + (grip.displacements + changes), rates + grip.displacement_rates

    def _in_time(self, time: float) -> bool:
        """Return whether a time is between the first and the last stored encoder reading [s]."""
        finite_array([time], 1, 'time of the measurement [s]', GraspError)
        return bool(self._readings) and self._readings.first[0] <= time <= self._readings.last[0]


def _positive(deviations: ArrayLike, count: int, what: str) -> Array:
    """Return standard deviations (count,); raise GraspError unless finite and positive."""
    checked = finite_array(deviations, count, what, GraspError, MAX_MAGNITUDE)
    if checked.min() <= 0.0:
        raise GraspError(f'{what}: {checked.tolist()}: must be positive')
    return checked
