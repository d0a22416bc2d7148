"""Node `manipulation`: the object's twist in, roller velocity commands and status out."""

from __future__ import annotations

from collections.abc import Sequence
import sys
import time

from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from isotruss_msgs.msg import ManipulationStatus
from isotruss_ros.core import Decision, load_robot, Refusal, Sample, Status, TwistServo
from isotruss_ros.nodes import parameters as params
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
from isotruss_ros.nodes.runner import run, StoppableNode
import numpy as np
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

#: A controller has this long to acknowledge the last command.
LAST_WORD = Duration(seconds=0.5)
#: Statuses that need no words in the log: nobody asks for anything, or all is well.
SILENT = frozenset({Status.OK, Status.IDLE, Status.HALT_NO_TWIST})


class Manipulation(StoppableNode):
    """
    Decides in every cycle, from the latest messages only, what the rollers are to do.

    :raises IsotrussError: a parameter is unusable; says which and what would be right.
    """

    def __init__(self, parameter_overrides: Sequence[Parameter] = ()) -> None:
        super().__init__('manipulation', parameter_overrides=list(parameter_overrides))
        self._values = params.Parameters(
            self,
            (
                params.ROBOT,
                params.OBJECT_DIAMETER,
                params.GRIP_MODULE,
                params.RATE,
                params.COMMAND_TIMEOUT,
                params.USE_STAMPED_TWIST,
            ),
        )
        self._robot = load_robot(self._values[params.ROBOT])
        self._roller_states = RollerStates(self._robot.roller_names)
        self._reporter = Reporter(self.get_logger())
        self._servo = TwistServo(
            self._robot,
            self._values[params.GRIP_MODULE],
            self._values[params.OBJECT_DIAMETER],
            period=1.0 / self._values[params.RATE],
            timeout=self._values[params.COMMAND_TIMEOUT],
        )
        self._commands = self.create_publisher(
            Float64MultiArray, 'roller_velocity_controller/commands', RELIABLE
        )
        self._status = self.create_publisher(ManipulationStatus, 'manipulation/status', RELIABLE)
        self.create_subscription(JointState, 'joint_states', self._take_joint_states, LATEST)
        self.create_subscription(PoseStamped, 'object_pose', self._take_object_pose, LATEST)
        if self._values[params.USE_STAMPED_TWIST]:
            self.create_subscription(TwistStamped, 'cmd_vel', self._take_stamped_twist, LATEST)
        else:
            self.create_subscription(Twist, 'cmd_vel', self._take_twist, LATEST)
        # Made once: a message with its parts costs more to make than to fill in.
        self._status_message = ManipulationStatus()
        self._cycle_time = 0.0
        self._timer = self.create_timer(self._servo.period, self._cycle)
        self._values.on_change(
            lambda values: params.check_grip_module(self._robot, values), self._apply
        )

    def stop(self) -> None:
        """Leave the rollers at zero, and make sure that they know."""
        self._commands.publish(command_message(np.zeros(len(self._robot.roller_names))))
        self._commands.wait_for_all_acked(LAST_WORD)

    def _now(self) -> float:
        return 1e-9 * self.get_clock().now().nanoseconds

    def _apply(self) -> None:
        """Take over changed parameters, in the next cycle."""
        self._servo.grip_module = self._values[params.GRIP_MODULE]
        self._servo.object_diameter = self._values[params.OBJECT_DIAMETER]
        self._servo.timeout = self._values[params.COMMAND_TIMEOUT]
        self._servo.period = 1.0 / self._values[params.RATE]
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
