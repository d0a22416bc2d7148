"""Node `grasp_analysis`: joint states and object pose in, contact forces and closure out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
import sys
import time

from geometry_msgs.msg import PoseStamped, WrenchStamped
from isotruss_msgs.msg import GraspState
from isotruss_msgs.srv import AnalyzeGrasp
from isotruss_ros.core import GraspCode, GraspMonitor, GraspReport, load_robot, Refusal, Sample
from isotruss_ros.nodes import parameters as params
from isotruss_ros.nodes.grasp_messages import external_wrench, question, state_message
from isotruss_ros.nodes.managed import ManagedNode
from isotruss_ros.nodes.markers import GraspMarkers
from isotruss_ros.nodes.messages import MessageError, object_center, RollerStates, seconds
from isotruss_ros.nodes.qos import LATEST, RELIABLE
from isotruss_ros.nodes.report import Reporter
from isotruss_ros.nodes.runner import run
from rclpy.parameter import Parameter
from rclpy.timer import Timer
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from visualization_msgs.msg import MarkerArray

RATE = replace(params.RATE, default=100.0, bounds=(1.0, 1000.0))
# Not finer: for an object as large as the robot, memory grows with the square of the points.
SPACING = params.Spec(
    'spacing', 0.005, 'Distance of the points that can touch, along the tubes [m]', (0.002, 0.1)
)
SPECS = (
    params.ROBOT,
    params.OBJECT_DIAMETER,
    params.FRICTION,
    RATE,
    params.COMMAND_TIMEOUT,
    SPACING,
)
#: RViz draws no oftener [s].
MARKER_PERIOD = 1.0 / 30.0


class GraspAnalysisNode(ManagedNode):
    """
    Says in every cycle what holds the object by the latest messages, or why that is not known.

    :raises IsotrussError: a parameter is unusable; says which and what would be right.
    """

    def __init__(self, parameter_overrides: Sequence[Parameter] = ()) -> None:
        super().__init__('grasp_analysis', SPECS, parameter_overrides)
        self._reporter = Reporter(self.get_logger())
        self._timer: Timer | None = None
        self._drawn = 0.0
        self.start()

    def configure(self) -> None:
        """Load the robot and listen."""
        values = self.values
        self._robot = load_robot(values[params.ROBOT])
        values.on_change(lambda _new: None, self._apply)
        self._roller_states = RollerStates(self._robot.roller_names)
        self._monitor = GraspMonitor(
            self._robot,
            values[params.OBJECT_DIAMETER],
            values[params.FRICTION],
            values[SPACING],
            values[params.COMMAND_TIMEOUT],
        )
        self._states = self.create_lifecycle_publisher(GraspState, 'grasp/state', RELIABLE)
        self._closures = self.create_lifecycle_publisher(Bool, 'grasp/force_closure', RELIABLE)
        self._wrenches = self.create_lifecycle_publisher(WrenchStamped, 'grasp/wrench', RELIABLE)
        self._arrays = self.create_lifecycle_publisher(MarkerArray, 'grasp/markers', RELIABLE)
        self._markers = GraspMarkers(self._robot.frame)
        self.create_subscription(JointState, 'joint_states', self._take_joint_states, LATEST)
        self.create_subscription(PoseStamped, 'object_pose', self._take_object_pose, LATEST)
        self.create_subscription(WrenchStamped, 'external_wrench', self._take_wrench, LATEST)
        self.diagnostics.hardware_id = self._robot.name

    def activate(self) -> None:
        """Answer from now on."""
        self._timer = self.create_timer(1.0 / self.values[RATE], self._cycle)
        self.create_service(AnalyzeGrasp, 'analyze_grasp', self._answer)

    def deactivate(self) -> None:
        """Stop the cycle."""
        self._timer = None

    def _now(self) -> float:
        return 1e-9 * self.get_clock().now().nanoseconds

    def _apply(self) -> None:
        """Take over changed parameters, in the next cycle."""
        self._monitor.object_diameter = self.values[params.OBJECT_DIAMETER]
        self._monitor.friction = self.values[params.FRICTION]
        self._monitor.spacing = self.values[SPACING]
        self._monitor.timeout = self.values[params.COMMAND_TIMEOUT]
        if self._timer is not None:
            self._timer.timer_period_ns = int(1e9 / self.values[RATE])

    def _take_joint_states(self, message: JointState) -> None:
        try:
            state = self._roller_states.state(message)
            self._monitor.rollers = Sample(state, seconds(message.header))
        except MessageError as error:
            self._monitor.rollers = Refusal(str(error))

    def _take_object_pose(self, message: PoseStamped) -> None:
        try:
            center = object_center(message, self._robot.frame)
            self._monitor.center = Sample(center, seconds(message.header))
        except MessageError as error:
            self._monitor.center = Refusal(str(error))

    def _take_wrench(self, message: WrenchStamped) -> None:
        try:
            wrench = external_wrench(message, self._robot.frame)
            self._monitor.wrench = Sample(wrench, seconds(message.header))
        except MessageError as error:
            self._monitor.wrench = Refusal(str(error))

    def _answer(
        self, request: AnalyzeGrasp.Request, response: AnalyzeGrasp.Response
    ) -> AnalyzeGrasp.Response:
        asked = question(request, self.values[SPACING])
        report = self._monitor.what_if(asked, self._now())
        response.success = report.code is GraspCode.OK
        response.message = report.message
        response.state = state_message(report, self._robot.frame)
        return response

    def _cycle(self) -> None:
        report = self._monitor.report(self._now())
        state = state_message(report, self._robot.frame)
        self._states.publish(state)
        self._closures.publish(Bool(data=state.force_closure))
        if report.grasp is not None:
            # A wrench cannot say that it is none: where there is no answer it is silent.
            wrench = WrenchStamped(header=state.header, wrench=state.normal_wrench)
            self._wrenches.publish(wrench)
        else:
            self._reporter.warn(report.code.name, f'{report.code}: {report.message}')
        self._draw(report)

    def _draw(self, report: GraspReport) -> None:
        """Publish markers where somebody looks at them, not oftener than they are drawn."""
        now = time.monotonic()
        if now - self._drawn >= MARKER_PERIOD and self._arrays.get_subscription_count():
            self._arrays.publish(self._markers.update(report, self.get_clock().now()))
            self._drawn = now


def main(args: Sequence[str] | None = None) -> int:
    """Run the analysis until it is interrupted."""
    return run(GraspAnalysisNode, args)


if __name__ == '__main__':
    sys.exit(main())
