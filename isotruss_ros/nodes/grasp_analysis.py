# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node `grasp_analysis`, which computes contact forces and force closure of a measured object."""

from __future__ import annotations

from dataclasses import replace
import time

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from isotruss_msgs.msg import GraspState
from isotruss_msgs.srv import AnalyzeGrasp
from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.inputs import StampedInput
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.statics.wrinkling import MAX_UTILISATION
from isotruss_ros.nodes.conversions.grasp_messages import (
    ContactForces,
    read_external_wrench,
    read_query,
    to_state_message,
)
from isotruss_ros.nodes.conversions.markers import to_marker_array
from isotruss_ros.nodes.conversions.messages import ALIGNED_OBJECT, make_header, name_frame
from isotruss_ros.nodes.framework import common_parameters as common
from isotruss_ros.nodes.framework.cycle import Cycle
from isotruss_ros.nodes.framework.gate import Topic
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.parameters import Spec
from isotruss_ros.nodes.framework.sensors import Inputs
from isotruss_ros.nodes.framework.topics import EVENTS
from isotruss_ros.nodes.framework.transforms import find_contact_frames, TransformBroadcaster
from isotruss_ros.nodes.grasp.grasp_monitor import GraspMonitor
from isotruss_ros.nodes.grasp.grasp_report import (
    AnalyzedGrasp,
    GraspCode,
    GraspQuery,
    GraspReport,
)
import numpy as np
from std_msgs.msg import Bool
from visualization_msgs.msg import MarkerArray

SPECS = (
    *common.OBJECT_SPECS,
    replace(common.RATE, default=25.0, bounds=(1.0, 1000.0)),
    common.COMMAND_TIMEOUT,
    common.PRESSURE_TIMEOUT,
    common.AMBIENT_PRESSURE,
    # Lower bound: memory grows with the square of the number of points.
    Spec(
        'spacing',
        0.005,
        'Spacing of the contact points of the fixed object along the tubes [m]',
        (0.002, 0.1),
    ),
)
#: Shortest period of markers, equal to the frame period of RViz [s].
MARKER_PERIOD = 1.0 / 30.0


class GraspAnalysisNode(ManagedNode):
    """Node that analyses the grasp in every cycle from the latest inputs."""

    node_name = 'grasp_analysis'
    specs = SPECS
    awaited = ('joint_states', 'object_pose')
    #: Time at which markers were last published [s].
    _drawn = 0.0

    def configure(self) -> None:
        """Create publishers and subscriptions."""
        values = self.values
        self._described = common.read_described(values)
        inputs = self.inputs = Inputs(self, self.robot)
        timeout = values.command_timeout
        self._monitor = GraspMonitor(self.robot, self._make_query(), timeout, inputs)
        self._states = self.advertise(GraspState, 'grasp/state')
        self._held = self.advertise(Bool, 'grasp/held')
        self._closures = self.advertise(Bool, 'grasp/force_closure')
        self._wrenches = self.advertise(WrenchStamped, 'grasp/wrench')
        self._forces = self.advertise(WrenchStamped, 'grasp/contact_forces', EVENTS)
        self._contacts = ContactForces(self.robot.frame)
        self._arrays = self.advertise(MarkerArray, 'grasp/markers')
        self._transforms = TransformBroadcaster(self, self.robot)
        inputs.keep('rollers', 'estimate', 'pose', 'pressures', 'held_grip')
        wrenches = Topic(WrenchStamped, 'external_wrench', self._read_wrench)
        inputs.keep_topic('wrench', wrenches)

    def _read_wrench(self, message: WrenchStamped) -> tuple[float, float, float]:
        """Return the external wrench in a message in the aligned or the object's frame."""
        pose = self.inputs.pose
        known = isinstance(pose, StampedInput)
        return read_external_wrench(message, self.robot.frame, pose.value.angle if known else None)

    def _make_query(self) -> GraspQuery:
        """Return the query that the parameters define."""
        values, unloaded = self.values, (0.0, 0.0, 0.0)
        body = common.make_body(values, self._described)
        friction = body.friction_or(None)
        return GraspQuery((), body, friction, unloaded, values.spacing)

    def activate(self) -> None:
        """Start the periodic analysis, and offer the service `analyze_grasp`."""
        self.cycle = Cycle(self, self._step, self.inputs.clear)
        self.create_service(AnalyzeGrasp, 'analyze_grasp', self._analyze)

    def _apply(self) -> None:
        """Use new parameter values from the next cycle on."""
        self._monitor.query = self._make_query()
        self._monitor.timeout = self.values.command_timeout
        self._monitor.pressure_timeout = self.values.pressure_timeout

    def _analyze(
        self, request: AnalyzeGrasp.Request, response: AnalyzeGrasp.Response
    ) -> AnalyzeGrasp.Response:
        now = self.now()
        try:
            query = read_query(request, self.values.spacing)
        except IsotrussError as error:
            report = GraspReport(GraspCode.INVALID_REQUEST, str(error), now)
        else:
            report = self._monitor.analyze_request(query, now)
        response.success = report.grasp is not None
        response.message = report.message
        response.state = to_state_message(report, self.robot.frame)
        if report.grasp is not None:
            response.state.nonlinearity = report.grasp.settled.nonlinearity
        return response

    def _step(self, now: float) -> None:
        report = self._monitor.report(now)
        state = to_state_message(report, self.robot.frame)
        self._states.publish(state)
        self._held.publish(Bool(data=report.held is True))
        self._closures.publish(Bool(data=state.force_closure))
        words, level = f'{report.code}: {report.message}', DiagnosticStatus.ERROR
        if report.grasp is not None:
            # A wrench message has no code: without a result none is published.
            header = make_header(report.time, name_frame(self.robot.frame, ALIGNED_OBJECT))
            self._wrenches.publish(WrenchStamped(header=header, wrench=state.normal_wrench))
            grasp = report.grasp
            grip = grasp.settled.equilibrium
            contacts = {} if grip is None else find_contact_frames(grip)
            self._transforms.broadcast(grasp.config, grasp.body.pose, contacts, report.time)
            self._publish_forces(report.time, grasp)
            used = grasp.largest_utilisation
            sound = used <= MAX_UTILISATION and not grasp.settled.flattened
            level = DiagnosticStatus.OK if sound else DiagnosticStatus.WARN
        if report.code is not GraspCode.OK:
            self.reasons.note(report.code.name, words)
        status = words if report.grasp is None else report.message or 'analysing'
        self.diagnostics.set_status(status, level)
        self._draw(report)

    def _publish_forces(self, when: float, grasp: AnalyzedGrasp) -> None:
        """Publish the force of each member on the free object, in its contact frame."""
        if not self._forces.get_subscription_count():
            return
        normal, friction = grasp.settled.normal_forces, grasp.settled.friction_forces
        if not normal:  # without contact, the two members nearest to the object
            nearest = np.argsort(member_depths(grasp.config, grasp.body), kind='stable')[-2:]
            normal = {self.robot.member_names[i]: 0.0 for i in nearest.tolist()}
        for message in self._contacts.make_messages(when, normal, friction):
            self._forces.publish(message)

    def _draw(self, report: GraspReport) -> None:
        """Publish markers at the frame rate of RViz if there is a subscriber."""
        now = time.monotonic()
        if now - self._drawn >= MARKER_PERIOD and self._arrays.get_subscription_count():
            self._arrays.publish(to_marker_array(report, self.robot.frame, self.now()))
            self._drawn = now
