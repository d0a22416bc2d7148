# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node `state_estimator`: where the robot is and how hard it squeezes, by all its sensors."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from isotruss_msgs.msg import StateEstimate as StateEstimateMessage
from isotruss_ros.core.control.inputs import fresh_pressures, Input, InputError
from isotruss_ros.core.control.state_estimate import EstimatorSettings, StateEstimate
from isotruss_ros.core.control.state_estimator import StateEstimator
from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.nodes.conversions.estimate_messages import to_estimate_message
from isotruss_ros.nodes.conversions.joint_state_messages import read_roller_state
from isotruss_ros.nodes.conversions.messages import read_stamp
from isotruss_ros.nodes.framework import common_parameters as common
from isotruss_ros.nodes.framework.cycle import Cycle
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.parameters import FixedSpec, Spec, Value
from isotruss_ros.nodes.framework.robot_frame import RobotFrame
from isotruss_ros.nodes.framework.sensors import Inputs
from isotruss_ros.nodes.framework.topics import RELIABLE, subscribe_newest
from sensor_msgs.msg import JointState, MultiDOFJointState

#: What is known of a robot that was not homed.
KNOWN = EstimatorSettings()
SPECS = (
    common.OBJECT_DIAMETER,
    common.OBJECT,
    common.GRIP_MODULE,
    common.GRIP,
    replace(common.RATE, default=50.0, bounds=(1.0, 1000.0)),
    common.COMMAND_TIMEOUT,
    common.PRESSURE_TIMEOUT,
    Spec('pose_deviation', 1e-3, 'Standard deviation of x and y of object_pose [m]', (1e-6, 1.0)),
    Spec('angle_deviation', 0.009, 'Standard deviation of its angle [rad]', (1e-6, 1.0)),
    Spec(
        'marker_deviation', 1e-3, 'Standard deviation of x and y of joint_markers [m]', (1e-6, 1.0)
    ),
    FixedSpec(
        'zero_deviation',
        KNOWN.zeros,
        "Standard deviation of the rollers' zeros; 0.001 after calibrate_home [m]",
        (1e-6, 1.0),
    ),
    FixedSpec(
        'slip', KNOWN.slip, 'Share of its travel that a roller is expected to slip', (0.0, 1.0)
    ),
    FixedSpec(
        'stiffness_deviation',
        KNOWN.stiffness,
        'Standard deviation of the stiffness of the tubes, as a share of it',
        (0.0, 1.0),
    ),
)


class StateEstimatorNode(ManagedNode):
    """Take each measurement in as it comes, and publish the estimate in every cycle."""

    node_name = 'state_estimator'
    specs = SPECS
    awaited = ('joint_states',)
    _estimator: StateEstimator | None = None
    _last: StateEstimate | None = None
    pressures: Input = None

    def configure(self) -> None:
        """Create publisher and subscriptions."""
        self._frame = RobotFrame.heard_by(self, self.robot)
        self.inputs = Inputs(self, self.robot, self)
        self.inputs.keep_tube_pressures()
        self._begin()
        self._estimates = self.create_lifecycle_publisher(
            StateEstimateMessage, 'state_estimate', RELIABLE
        )
        for kind, topic, take in (
            (JointState, 'joint_states', self._take_encoders),
            (PoseStamped, 'object_pose', self._take_pose),
            (MultiDOFJointState, 'joint_markers', self._take_markers),
        ):
            subscribe_newest(self, kind, topic, partial(self._receive, topic, take))

    def _check(self, new: dict[str, Value]) -> None:
        """Check the grip."""
        common.check_grip(self.robot, new)

    def activate(self) -> None:
        """Start the cycle."""
        self.cycle = Cycle(self, self._step, self._begin)

    def cleanup(self) -> None:
        """Release the robot."""
        self._estimator = self._last = None

    def details(self) -> dict[str, object]:
        """Return what is trusted."""
        estimate = self._last
        if estimate is None:
            return {}
        details: dict[str, object] = {
            'joints whose markers are used': ', '.join(estimate.used) or 'none',
            'joints whose markers are left out': ', '.join(estimate.left_out) or 'none',
            'rollers that seem to slip': ', '.join(estimate.slipping) or 'none',
        }
        if estimate.pose is not None:
            spread = estimate.squeeze_deviation
            details['squeeze [N]'] = f'{estimate.squeeze:.1f}, deviation {spread:.1f}'
        return details

    def _begin(self) -> None:
        """Begin with zeros that are not known: also after a jump of the clock."""
        values = self.values
        self.inputs.clear()
        settings = EstimatorSettings(
            zeros=values.zero_deviation,
            slip=values.slip,
            stiffness=values.stiffness_deviation,
        )
        self._estimator, self._last = StateEstimator(self.robot, settings), None
        self._apply()

    def _apply(self) -> None:
        """Expect the object between the members of the parameters from now on."""
        values = self.values
        self.timeout = values.command_timeout
        members = common.select_grip(self.robot, values.grip, values.grip_module)
        grip = Grip(members, common.read_body(values))
        if grip != self._estimator.grip:
            self._estimator.grip = grip

    def _receive(self, topic: str, take: object, message: object) -> None:
        """Take a message in; one that is not usable is named and left."""
        try:
            take(message)
        except IsotrussError as error:
            self.warn(topic, f'{topic}: {error}')

    def _take_encoders(self, message: JointState) -> None:
        state = read_roller_state(message, self.robot.roller_names)
        self._estimator.take_encoders(read_stamp(message.header), state.positions)

    def _take_pose(self, message: PoseStamped) -> None:
        pose, values = self._frame.read_pose(message), self.values
        deviations = values.pose_deviation, values.pose_deviation, values.angle_deviation
        self._estimator.take_pose(read_stamp(message.header), pose, deviations)

    def _take_markers(self, message: MultiDOFJointState) -> None:
        joints = self._frame.read_markers(message)
        deviation = self.values.marker_deviation
        self._estimator.take_markers(read_stamp(message.header), joints, deviation)

    def _take_pressures(self, now: float) -> str:
        """Model the tubes with measured pressures; tell why, where the last ones stay."""
        try:
            found = fresh_pressures(now, self.values.pressure_timeout, self.pressures)
        except InputError as error:
            return str(error)
        self._estimator.take_pressures(found)
        return ''

    def _step(self, now: float) -> None:
        stale = self._take_pressures(now)
        try:
            estimate = self._estimator.estimate()
        except IsotrussError as error:
            self.diagnostics.set_status(DiagnosticStatus.ERROR, str(error))
            return
        if estimate is None:
            self.diagnostics.set_status(DiagnosticStatus.WARN, 'no joint_states received yet')
            return
        age, most = now - estimate.time, self.values.command_timeout
        if age > most:
            self.diagnostics.set_status(
                DiagnosticStatus.ERROR, f'joint_states: {age:.3f} s old; must be at most {most} s'
            )
            return
        self._last = estimate
        self._estimates.publish(to_estimate_message(estimate, self.robot))
        doubts = '; '.join(filter(None, (stale, _describe_doubts(estimate))))
        if doubts:
            self.warn('doubts', doubts)
        self.diagnostics.set_status(
            DiagnosticStatus.WARN if doubts else DiagnosticStatus.OK, doubts or 'estimating'
        )


def _describe_doubts(estimate: StateEstimate) -> str:
    """Return what seems to be wrong; empty where nothing does."""
    doubts = []
    if estimate.left_out:
        doubts.append(f'markers that do not fit: {", ".join(estimate.left_out)}')
    if estimate.slipping:
        doubts.append(f'rollers that seem to slip: {", ".join(estimate.slipping)}')
    return '; '.join(doubts)
