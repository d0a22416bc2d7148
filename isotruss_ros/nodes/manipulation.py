"""Node `manipulation`: the object's twist in, roller velocity commands and status out."""

from __future__ import annotations

from collections.abc import Sequence
import sys
import time

from geometry_msgs.msg import Twist, TwistStamped
from isotruss_ros.core import load_robot, Refusal, Sample, Status, TwistServo
from isotruss_ros.nodes import parameters as params
from isotruss_ros.nodes.cycle import Cycle
from isotruss_ros.nodes.emergency_stop import EmergencyStop
from isotruss_ros.nodes.failed_rollers import (
    check_failed_rollers,
    FailedRollers,
    remaining_motions,
)
from isotruss_ros.nodes.inputs import age, latest, Sensors
from isotruss_ros.nodes.managed import ManagedNode
from isotruss_ros.nodes.messages import (
    check_frame,
    command_message,
    MessageError,
    planar_twist,
    seconds,
)
from isotruss_ros.nodes.newest import subscribe_newest
from isotruss_ros.nodes.qos import RELIABLE
from isotruss_ros.nodes.runner import run
from isotruss_ros.nodes.servo_settings import apply_settings, FAILED_ROLLERS
from isotruss_ros.nodes.servo_settings import SPECS as SERVO_SPECS
from isotruss_ros.nodes.status_report import StatusReport
import numpy as np
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from rclpy.time import Time
from std_msgs.msg import Float64MultiArray

SPECS = (
    params.ROBOT,
    params.USE_STAMPED_TWIST,
    params.REQUIRE_EMERGENCY_STOP,
    *SERVO_SPECS,
)
#: A controller has this long to acknowledge the last command.
LAST_WORD = Duration(seconds=0.5)


class Manipulation(ManagedNode):
    """
    Decides in every cycle, from the latest messages only, what the rollers are to do.

    :raises IsotrussError: a parameter is unusable; says which and what would be right.
    """

    def __init__(self, parameter_overrides: Sequence[Parameter] = ()) -> None:
        super().__init__('manipulation', SPECS, parameter_overrides)
        self._report: StatusReport | None = None
        self._servo: TwistServo | None = None
        self._cycle: Cycle | None = None
        self._stop = EmergencyStop(
            self, lambda: self.values[params.REQUIRE_EMERGENCY_STOP], self._stop_changed
        )
        self._failed_rollers = FailedRollers(self, lambda: self._servo, self._failures_changed)
        self.start()

    def configure(self) -> None:
        """Load the robot and listen."""
        values = self.values
        self._robot = load_robot(values[params.ROBOT])
        values.on_change(self._check, self._apply)
        self._report = StatusReport(self, self._robot.frame)
        self._servo = TwistServo(
            self._robot,
            values[params.GRIP_MODULE],
            values[params.OBJECT_DIAMETER],
            period=1.0 / values[params.RATE],
            timeout=values[params.COMMAND_TIMEOUT],
        )
        apply_settings(self._servo, values)
        self._failed_rollers.hold_found()
        self._failures_changed()
        for pair in self._servo.guard.unguarded:
            self.get_logger().warning(f'{pair} overlap at home: they are not kept apart')
        self._commands = self.create_lifecycle_publisher(
            Float64MultiArray, 'roller_velocity_controller/commands', RELIABLE
        )
        Sensors(self, self._robot, self._servo)
        if values[params.USE_STAMPED_TWIST]:
            subscribe_newest(self, TwistStamped, 'cmd_vel', self._take_stamped_twist)
        else:
            subscribe_newest(self, Twist, 'cmd_vel', self._take_twist)
        self.diagnostics.hardware_id = self._robot.name

    def activate(self) -> None:
        """Decide from now on."""
        self._cycle = Cycle(
            self,
            self.values[params.RATE],
            self._step,
            jumped_back=self._forget,
            stands=self._clock_stands,
            patience=self._servo.timeout,
        )

    def deactivate(self) -> None:
        """Leave the rollers at zero, and make sure that they know."""
        self._cycle = None
        self._send_zeros()
        if not self._commands.wait_for_all_acked(LAST_WORD):
            self.get_logger().warning('the last zero command was not acknowledged by everyone')

    def cleanup(self) -> None:
        """Let go of the robot; which rollers failed is kept."""
        self._failed_rollers.keep_found()
        self._servo = None

    def details(self) -> dict[str, object]:
        """Return how the loop is and what it goes by."""
        found: dict[str, object] = {'emergency stop': self._stop.reason or 'no'}
        servo = self._servo
        if servo is None:
            return found
        now = 1e-9 * self.get_clock().now().nanoseconds
        inputs = {'twist': servo.twist, 'joint states': servo.rollers, 'object pose': servo.center}
        found |= {f'age of {name} [s]': age(given, now) for name, given in inputs.items()}
        if servo.failed:
            found['failed rollers'] = ', '.join(sorted(servo.failed))
            found['what can still be done'] = remaining_motions(servo)
        return found | self._report.summary(servo.period)

    def _send_zeros(self) -> None:
        self._commands.publish(command_message(np.zeros(len(self._robot.roller_names))))

    def _halt(self) -> tuple[Status, str] | None:
        """Return why the rollers stand still whatever the inputs say."""
        reason = self._stop.reason
        if reason is not None:
            return Status.HALT_EMERGENCY_STOP, reason
        doubt = self._failed_rollers.doubt(self._robot)
        return None if doubt is None else (Status.HALT_INVALID_FAILED_ROLLERS, doubt)

    def _stop_changed(self) -> None:
        """Stop at once; after a release, go on with what is commanded from then on."""
        if self._servo is None:
            return
        self._servo.stopped = self._halt()
        self._servo.twist = None
        if self._servo.stopped is not None and self.active:
            self._send_zeros()

    def _forget(self) -> None:
        """Rely on nothing that came before: its age cannot be known."""
        self._servo.twist = self._servo.rollers = self._servo.center = None

    def _clock_stands(self, now: Time) -> None:
        """Stop; with the clock, ages stand still too, and old inputs would seem new."""
        self._forget()
        if self._servo.stopped is None:
            self._servo.stopped = (Status.HALT_CLOCK, f'simulated time stands at {now}')
        self._step(now)
        self._servo.stopped = self._halt()

    def _failures_changed(self) -> None:
        """Hold the rollers that somebody says have failed."""
        if self._servo is None:
            return
        by_parameter = set(self.values[FAILED_ROLLERS]) - {''}
        self._servo.failed = self._failed_rollers.named(self._robot) | by_parameter
        self._servo.stopped = self._halt()

    def _check(self, new: dict[str, params.Value]) -> None:
        params.check_grip_module(self._robot, new)
        check_failed_rollers(self._robot, new)

    def _apply(self) -> None:
        """Take over changed parameters, in the next cycle."""
        apply_settings(self._servo, self.values)
        self._failures_changed()
        if self._cycle is not None:
            self._cycle.change(self.values[params.RATE], self._servo.timeout)

    def _now(self) -> float:
        return 1e-9 * self.get_clock().now().nanoseconds

    def _take_twist(self, message: Twist) -> None:
        try:
            self._servo.twist = Sample(planar_twist(message), self._now())
        except MessageError as error:
            self._servo.twist = Refusal(str(error))

    def _take_stamped_twist(self, message: TwistStamped) -> None:
        try:
            check_frame('twist', message.header, self._robot.frame)
            came = Sample(planar_twist(message.twist), seconds(message.header))
            self._servo.twist = latest(self._servo.twist, came, self._servo.timeout)
        except MessageError as error:
            self._servo.twist = Refusal(str(error))

    def _step(self, now: Time) -> None:
        began = time.perf_counter()
        decision = self._servo.decide(1e-9 * now.nanoseconds)
        self._commands.publish(command_message(decision.command.roller_velocities))
        self._report.tell(decision, now)
        self._report.note_cycle_time(time.perf_counter() - began)


def main(args: Sequence[str] | None = None) -> int:
    """Run the manipulation node until it is interrupted."""
    return run(Manipulation, args)


if __name__ == '__main__':
    sys.exit(main())
