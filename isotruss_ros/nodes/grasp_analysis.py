"""Node `grasp_analysis`: joint states and object pose in, contact forces and closure out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
import sys
import time

from geometry_msgs.msg import WrenchStamped
from isotruss_msgs.msg import GraspState
from isotruss_msgs.srv import AnalyzeGrasp
from isotruss_ros.core import GraspCode, GraspMonitor, GraspReport, load_robot, Refusal, Sample
from isotruss_ros.nodes import parameters as params
from isotruss_ros.nodes.cycle import Cycle
from isotruss_ros.nodes.diagnostics import CycleTimes, Level
from isotruss_ros.nodes.grasp_messages import external_wrench, question, state_message
from isotruss_ros.nodes.inputs import age, latest, Sensors
from isotruss_ros.nodes.managed import ManagedNode
from isotruss_ros.nodes.markers import GraspMarkers
from isotruss_ros.nodes.messages import MessageError, seconds
from isotruss_ros.nodes.newest import subscribe_newest
from isotruss_ros.nodes.qos import RELIABLE
from isotruss_ros.nodes.report import Reporter
from isotruss_ros.nodes.runner import run
from rclpy.parameter import Parameter
from rclpy.time import Time
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
        self._cycle_times = CycleTimes()
        self._monitor: GraspMonitor | None = None
        self._cycle: Cycle | None = None
        self._drawn = 0.0
        self.start()

    def configure(self) -> None:
        """Load the robot and listen."""
        values = self.values
        self._robot = load_robot(values[params.ROBOT])
        values.on_change(lambda _new: None, self._apply)
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
        Sensors(self, self._robot, self._monitor)
        subscribe_newest(self, WrenchStamped, 'external_wrench', self._take_wrench)
        self.diagnostics.hardware_id = self._robot.name

    def activate(self) -> None:
        """Answer from now on."""
        self._cycle = Cycle(self, self.values[RATE], self._step, self._forget)
        self.create_service(AnalyzeGrasp, 'analyze_grasp', self._answer)

    def deactivate(self) -> None:
        """Stop the cycle."""
        self._cycle = None

    def cleanup(self) -> None:
        """Let go of the robot."""
        self._monitor = None

    def details(self) -> dict[str, object]:
        """Return how the loop is and what it goes by."""
        monitor = self._monitor
        if monitor is None:
            return {}
        now = 1e-9 * self.get_clock().now().nanoseconds
        return {
            'age of joint states [s]': age(monitor.rollers, now),
            'age of object pose [s]': age(monitor.center, now),
            'age of external wrench [s]': age(monitor.wrench, now),
        } | self._cycle_times.summary(1.0 / self.values[RATE])

    def _forget(self) -> None:
        """Rely on nothing that came before: its age cannot be known."""
        self._monitor.rollers = self._monitor.center = self._monitor.wrench = None

    def _now(self) -> float:
        return 1e-9 * self.get_clock().now().nanoseconds

    def _apply(self) -> None:
        """Take over changed parameters, in the next cycle."""
        self._monitor.object_diameter = self.values[params.OBJECT_DIAMETER]
        self._monitor.friction = self.values[params.FRICTION]
        self._monitor.spacing = self.values[SPACING]
        self._monitor.timeout = self.values[params.COMMAND_TIMEOUT]
        if self._cycle is not None:
            self._cycle.change(self.values[RATE])

    def _take_wrench(self, message: WrenchStamped) -> None:
        try:
            wrench = external_wrench(message, self._robot.frame)
            came = Sample(wrench, seconds(message.header))
            self._monitor.wrench = latest(self._monitor.wrench, came, self._monitor.timeout)
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

    def _step(self, now: Time) -> None:
        began = time.perf_counter()
        report = self._monitor.report(1e-9 * now.nanoseconds)
        state = state_message(report, self._robot.frame)
        self._states.publish(state)
        self._closures.publish(Bool(data=state.force_closure))
        if report.grasp is not None:
            # A wrench cannot say that it is none: where there is no answer it is silent.
            wrench = WrenchStamped(header=state.header, wrench=state.normal_wrench)
            self._wrenches.publish(wrench)
            self.diagnostics.say(Level.OK, report.message or 'answering')
        else:
            self._reporter.warn(report.code.name, f'{report.code}: {report.message}')
            self.diagnostics.say(Level.ERROR, f'{report.code}: {report.message}')
        self._draw(report)
        self._cycle_times.note(time.perf_counter() - began)

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
