# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node `state_estimator`, which estimates configuration and squeeze from all sensors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
import math

from diagnostic_msgs.msg import DiagnosticStatus
from isotruss_msgs.msg import StateEstimate as StateEstimateMessage
from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings, StateEstimate
from isotruss_ros.core.estimation.state_estimator import StateEstimator
from isotruss_ros.core.inputs import (
    find_fresh,
    fresh_pressures,
    HISTORY_DURATION,
    Input,
    InputError,
    RejectedInput,
    require_fresh,
    StampedInput,
)
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.servo.decision import describe_squeeze
from isotruss_ros.core.statics.deform import find_sag
from isotruss_ros.nodes.conversions.state_messages import to_estimate_message
from isotruss_ros.nodes.framework import common_parameters as common
from isotruss_ros.nodes.framework.cycle import Cycle
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.parameters import FixedSpec, Spec, Value
from isotruss_ros.nodes.framework.sensors import Inputs

#: Period of the test whether the robot is upright and sags under its weight [s].
SAG_PERIOD = 2.0
#: Prior standard deviations for a robot whose home was not calibrated.
PRIOR = EstimatorSettings()
SPECS = (
    *common.OBJECT_SPECS,
    common.GRIP_MODULE,
    common.GRIP,
    replace(common.RATE, default=25.0, bounds=(1.0, 1000.0)),
    common.COMMAND_TIMEOUT,
    common.PRESSURE_TIMEOUT,
    common.AMBIENT_PRESSURE,
    Spec('pose_deviation', 1e-3, 'Standard deviation of x and y of object_pose [m]', (1e-6, 1.0)),
    Spec(
        'angle_deviation',
        0.009,
        'Standard deviation of the angle of object_pose [rad]',
        (1e-6, 1.0),
    ),
    Spec(
        'marker_deviation', 1e-3, 'Standard deviation of x and y of joint_markers [m]', (1e-6, 1.0)
    ),
    FixedSpec(
        'zero_deviation',
        0.0,
        'Prior standard deviation of the roller offsets [m]; 0: that of the robot file, or 10 mm '
        'without calibrate_home',
        (0.0, 1.0),
    ),
    FixedSpec(
        'inclination',
        PRIOR.inclination,
        "Largest possible inclination of the robot's plane [rad]; the default is that of an "
        'upright robot',
        (0.0, PRIOR.inclination),
    ),
    FixedSpec(
        'slip', PRIOR.slip, 'Expected slip of a roller relative to its travel [-]', (0.0, 1.0)
    ),
)


class StateEstimatorNode(ManagedNode):
    """Node that updates and publishes the state estimate in every cycle."""

    node_name = 'state_estimator'
    specs = SPECS
    awaited = ('joint_states',)
    _estimator: StateEstimator | None = None
    _last: StateEstimate | None = None
    #: Sentence with the result of the last test whether the robot sags, and time of this test [s].
    _sag, _sought = '', -math.inf

    def configure(self) -> None:
        """Create the publisher and the subscriptions."""
        self.inputs = Inputs(self, self.robot)
        self.inputs.keep(
            'rollers',
            take=lambda sample: self._estimator.take_encoders(sample.time, sample.value.positions),
        )
        self.inputs.keep('pose', take=self._take_pose, oldest=HISTORY_DURATION)
        self.inputs.keep('markers', take=self._take_markers, oldest=HISTORY_DURATION)
        self.inputs.keep('pressures', 'held_grip')
        self._begin()
        self._estimates = self.advertise(StateEstimateMessage, 'state_estimate')

    def _check(self, new: dict[str, Value]) -> None:
        """Check the parameters of the grip."""
        common.check_grip(self.robot, new)

    def activate(self) -> None:
        """Start the cycle of the estimator."""
        self.cycle = Cycle(self, self._step, self._begin)

    def cleanup(self) -> None:
        """Discard the robot and its estimator."""
        self._estimator = self._last = None

    def details(self) -> dict[str, object]:
        """Return the used measurements and the faults of sensors for the diagnostics."""
        estimate = self._last
        if estimate is None:
            return {}
        details: dict[str, object] = {
            'joints with valid markers': ', '.join(estimate.used) or 'none',
            'joints with rejected markers': ', '.join(estimate.left_out) or 'none',
            'slipping rollers': ', '.join(estimate.slipping) or 'none',
        }
        if estimate.is_improbable:
            details['roller offsets'] = (
                'unknown: they exceed their prior deviations; check home, the frame of the '
                'markers, and whether the robot is upright'
            )
        elif estimate.may_be_upright:
            details['roller offsets'] = (
                'uncertain: the markers do not exclude that weight moves the joints; mark more '
                'joints, calibrate home, or set inclination to that of the robot'
            )
        if estimate.pose is not None:
            words = describe_squeeze(estimate.squeeze, estimate.squeeze_deviation)
            details |= {'grip': words, 'age of poses beyond their stamps [s]': estimate.delay}
        return details

    def _begin(self) -> None:
        """Reset the estimate to the prior, at the start and after a jump of the clock."""
        values = self.values
        self.inputs.clear()
        settings = replace(PRIOR, slip=values.slip, inclination=values.inclination)
        settings = settings.calibrated(self.robot.description, values.zero_deviation or None)
        self._estimator, self._last = StateEstimator(self.robot, settings), None
        #: Times of poses and markers that are later than the joint states of the last cycle [s],
        #: and updates by them, for which the model is evaluated once.
        self._waiting: list[tuple[float, Callable[[], object]]] = []
        self._apply()

    def _apply(self) -> None:
        """Set object and grasping members of the estimator from the parameters."""
        values = self.values
        body = common.make_body(values, common.read_described(values))
        grip = Grip(common.select_grip(self.robot, values), body)
        if grip != self._estimator.grip:
            self._estimator.set_grip(grip)

    def _take_pose(self, sample: StampedInput) -> None:
        values, estimator = self.values, self._estimator
        deviations = values.pose_deviation, values.pose_deviation, values.angle_deviation
        take = partial(estimator.take_pose, sample.time, sample.value, deviations)
        self._waiting.append((sample.time, take))

    def _take_markers(self, sample: StampedInput) -> None:
        estimator, deviation = self._estimator, self.values.marker_deviation
        take = partial(estimator.take_markers, sample.time, sample.value, deviation)
        self._waiting.append((sample.time, take))

    def _take_waiting(self, now: float) -> None:
        """
        Update the estimate with new poses and markers; reject and log invalid input.

        Those later than the joint states wait for joint states of their time, until joint states
        of this age would be stale.
        """
        oldest = now - max(HISTORY_DURATION, self.values.command_timeout)
        rollers = self.inputs.rollers
        last = rollers.time if isinstance(rollers, StampedInput) else -math.inf
        waiting, self._waiting = self._waiting, []
        for time, take in waiting:
            if time > last:
                if time > oldest:
                    self._waiting.append((time, take))
                continue
            try:
                take()
            except IsotrussError as error:
                self.reasons.note('measurement', str(error))

    def _take_pressures(self, now: float) -> str:
        """Use measured pressures in the model; return a warning if they are not fresh, else ''."""
        try:
            pressures = fresh_pressures(now, self.values.pressure_timeout, self.inputs.pressures)
        except InputError as error:
            return str(error)
        self._estimator.take_pressures(pressures)
        return ''

    def _find_sag(self, now: float, estimate: StateEstimate) -> str:
        """Return a warning if a robot without object sags under its weight, otherwise ''."""
        if not 0.0 <= now - self._sought < SAG_PERIOD:
            self._sought, self._sag = now, ''
            if estimate.pose is None and isinstance(self.inputs.markers, StampedInput):
                readings = estimate.travel - estimate.offsets
                sag = find_sag(self.robot.configuration(readings), self.inputs.markers.value)
                self._sag = str(sag) if sag is not None and sag.is_upright else ''
        return self._sag

    def _step(self, now: float) -> None:
        stale, inputs = self._take_pressures(now), self.inputs
        # The grip of `manipulation` is used while it is fresh.
        record = find_fresh(now, self.values.command_timeout, inputs.held_grip)
        self._estimator.take_grip(record)
        self._take_waiting(now)
        try:
            require_fresh(now, self.values.command_timeout, joint_states=inputs.rollers)
            estimate = self._estimator.estimate()
        except IsotrussError as error:
            bad = inputs.rollers is not None
            level = DiagnosticStatus.ERROR if bad else DiagnosticStatus.WARN
            self.diagnostics.set_status(str(error), level)
            return
        self._last = estimate
        self._estimates.publish(to_estimate_message(estimate, self.robot))
        rejected = map(_rejection, (inputs.rollers, inputs.pose, inputs.markers))
        reasons = (
            stale,
            *rejected,
            _describe_doubts(estimate),
            self._find_sag(now, estimate),
        )
        doubts = '; '.join(filter(None, reasons))
        if doubts:
            self.reasons.note('doubts', doubts)
        level = DiagnosticStatus.WARN if doubts else DiagnosticStatus.OK
        self.diagnostics.set_status(doubts or 'estimating', level)


def _rejection(latest: Input) -> str:
    """Return the reason of the rejection of an input's last message; empty if it was accepted."""
    rejected = latest if isinstance(latest, RejectedInput) else getattr(latest, 'rejected', None)
    return '' if rejected is None else rejected.reason


def _describe_doubts(estimate: StateEstimate) -> str:
    """Return a sentence that names the suspected faults; empty if there are none."""
    suspects = {
        'swapped markers': estimate.swapped,
        'inconsistent markers': estimate.left_out,
        'slipping rollers': estimate.slipping,
    }
    return '; '.join(f'{what}: {", ".join(names)}' for what, names in suspects.items() if names)
