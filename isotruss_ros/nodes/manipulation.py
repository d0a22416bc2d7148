"""Node `manipulation`: the object's twist in, roller velocity commands and status out."""

from __future__ import annotations

from collections.abc import Sequence
import sys
import time

from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from isotruss_msgs.msg import ManipulationStatus
from isotruss_ros.core import Decision, load_robot, Refusal, Sample, Status, TwistServo
from isotruss_ros.nodes import parameters as params
from isotruss_ros.nodes.managed import ManagedNode
from isotruss_ros.nodes.messages import (
    check_frame,
    command_message,
    MessageError,
    object_center,
    planar_twist,
    RollerStates,
    seconds,
    stamp,
    twist_message,
)
from isotruss_ros.nodes.qos import LATEST, RELIABLE
from isotruss_ros.nodes.report import Reporter
from isotruss_ros.nodes.runner import run
import numpy as np
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from rclpy.timer import Timer
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

#: A controller has this long to acknowledge the last command.
LAST_WORD = Duration(seconds=0.5)
#: Statuses that need no words in the log: nobody asks for anything, or all is well.
SILENT = frozenset({Status.OK, Status.IDLE, Status.HALT_NO_TWIST})
SPECS = (
    params.ROBOT,
    params.OBJECT_DIAMETER,
    params.GRIP_MODULE,
    params.RATE,
    params.COMMAND_TIMEOUT,
    params.USE_STAMPED_TWIST,
)


class Manipulation(ManagedNode):
    """
    Decides in every cycle, from the latest messages only, what the rollers are to do.

    :raises IsotrussError: a parameter is unusable; says which and what would be right.
    """

    def __init__(self, parameter_overrides: Sequence[Parameter] = ()) -> None:
        super().__init__('manipulation', SPECS, parameter_overrides)
        self._reporter = Reporter(self.get_logger())
        # Made once: a message with its parts costs more to make than to fill in.
        self._status_message = ManipulationStatus()
        self._cycle_time = 0.0
        self._timer: Timer | None = None
        self.start()

    def configure(self) -> None:
        """Load the robot and listen."""
        values = self.values
        self._robot = load_robot(values[params.ROBOT])
        values.on_change(lambda new: params.check_grip_module(self._robot, new), self._apply)
        self._roller_states = RollerStates(self._robot.roller_names)
        self._servo = TwistServo(
            self._robot,
            values[params.GRIP_MODULE],
            values[params.OBJECT_DIAMETER],
            period=1.0 / values[params.RATE],
            timeout=values[params.COMMAND_TIMEOUT],
        )
        self._commands = self.create_lifecycle_publisher(
            Float64MultiArray, 'roller_velocity_controller/commands', RELIABLE
        )
        self._status = self.create_lifecycle_publisher(
            ManipulationStatus, 'manipulation/status', RELIABLE
        )
        self.create_subscription(JointState, 'joint_states', self._take_joint_states, LATEST)
        self.create_subscription(PoseStamped, 'object_pose', self._take_object_pose, LATEST)
        if values[params.USE_STAMPED_TWIST]:
            self.create_subscription(TwistStamped, 'cmd_vel', self._take_stamped_twist, LATEST)
        else:
            self.create_subscription(Twist, 'cmd_vel', self._take_twist, LATEST)
        self.diagnostics.hardware_id = self._robot.name

    def activate(self) -> None:
        """Decide from now on."""
        self._timer = self.create_timer(self._servo.period, self._cycle)

    def deactivate(self) -> None:
        """Leave the rollers at zero, and make sure that they know."""
        self._timer = None
        self._commands.publish(command_message(np.zeros(len(self._robot.roller_names))))
        if not self._commands.wait_for_all_acked(LAST_WORD):
            self.get_logger().warning('the last zero command was not acknowledged by everyone')

    def _now(self) -> float:
        return 1e-9 * self.get_clock().now().nanoseconds

    def _apply(self) -> None:
        """Take over changed parameters, in the next cycle."""
        self._servo.grip_module = self.values[params.GRIP_MODULE]
        self._servo.object_diameter = self.values[params.OBJECT_DIAMETER]
        self._servo.timeout = self.values[params.COMMAND_TIMEOUT]
        self._servo.period = 1.0 / self.values[params.RATE]
        if self._timer is not None:
            self._timer.timer_period_ns = int(1e9 * self._servo.period)

    def _take_twist(self, message: Twist) -> None:
        try:
            self._servo.twist = Sample(planar_twist(message), self._now())
        except MessageError as error:
            self._servo.twist = Refusal(str(error))

    def _take_stamped_twist(self, message: TwistStamped) -> None:
        try:
            check_frame('twist', message.header, self._robot.frame)
            self._servo.twist = Sample(planar_twist(message.twist), seconds(message.header))
        except MessageError as error:
            self._servo.twist = Refusal(str(error))

    def _take_joint_states(self, message: JointState) -> None:
        try:
            state = self._roller_states.state(message)
            self._servo.rollers = Sample(state, seconds(message.header))
        except MessageError as error:
            self._servo.rollers = Refusal(str(error))

    def _take_object_pose(self, message: PoseStamped) -> None:
        try:
            center = object_center(message, self._robot.frame)
            self._servo.center = Sample(center, seconds(message.header))
        except MessageError as error:
            self._servo.center = Refusal(str(error))

    def _cycle(self) -> None:
        began = time.perf_counter()
        decision = self._servo.decide(self._now())
        self._commands.publish(command_message(decision.command.roller_velocities))
        self._report(decision)
        self._cycle_time = time.perf_counter() - began

    def _report(self, decision: Decision) -> None:
        command, message = decision.command, self._status_message
        stamp(message.header, self.get_clock().now(), self._robot.frame)
        message.code = int(command.status)
        message.message = decision.message
        twist_message(decision.twist, message.commanded)
        twist_message(command.achieved_twist, message.achieved)
        message.scale = command.scale
        message.cycle_time = self._cycle_time
        self._status.publish(message)
        if command.status not in SILENT:
            self._reporter.warn(command.status.name, f'{command.status}: {decision.message}')


def main(args: Sequence[str] | None = None) -> int:
    """Run the manipulation node until it is interrupted."""
    return run(Manipulation, args)


if __name__ == '__main__':
    sys.exit(main())
