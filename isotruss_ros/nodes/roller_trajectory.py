"""
Node `roller_trajectory`: drives the rollers along a trajectory, such as the path to a grasp.

It takes the place of ros2_control's joint_trajectory_controller, with the topic of that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from isotruss_ros.core import IsotrussError, load_robot, StampedInput
from isotruss_ros.core.control.inputs import require_fresh
from isotruss_ros.core.control.roller_trajectory import RollerTrajectoryServo
from isotruss_ros.nodes.components.emergency_stop import EmergencyStop
from isotruss_ros.nodes.components.sensors import format_age, subscribe_joint_states
from isotruss_ros.nodes.conversions.messages import MessageError, read_stamp, to_command_message
from isotruss_ros.nodes.conversions.trajectory_messages import read_roller_trajectory
from isotruss_ros.nodes.framework import parameters as params
from isotruss_ros.nodes.framework.cycle import Cycle
from isotruss_ros.nodes.framework.diagnostics import Level
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.qos import ACKNOWLEDGE_TIME, RELIABLE
from isotruss_ros.nodes.framework.runner import run
import numpy as np
from rclpy.parameter import Parameter
from rclpy.time import Time
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

RATE = replace(params.RATE, default=100.0, bounds=(10.0, 1000.0))
SPECS = (params.ROBOT, RATE, params.COMMAND_TIMEOUT, params.REQUIRE_EMERGENCY_STOP)
#: The services are private to this node: `manipulation` has an emergency stop of its own.
NAMESPACE = '~/'


class RollerTrajectory(ManagedNode):
    """
    Follow one trajectory at a time; publish no commands while there is none.

    A new trajectory replaces the old one, an empty one ends it. An emergency stop ends it too, and
    none is accepted until the stop is released; no trajectory resumes by itself afterwards.

    :param parameter_overrides: values of parameters other than the defaults.
    :raises IsotrussError: a parameter is unusable; the text names it and what would be right.
    """

    def __init__(self, parameter_overrides: Sequence[Parameter] = ()) -> None:
        super().__init__('roller_trajectory', SPECS, parameter_overrides)
        self._servo: RollerTrajectoryServo | None = None
        self._cycle: Cycle | None = None
        self._stop = EmergencyStop(
            self,
            lambda: self.values[params.REQUIRE_EMERGENCY_STOP],
            self._apply_stop,
            self._wait_for_zero,
            NAMESPACE,
        )
        self.start()

    def configure(self) -> None:
        """Load the robot, create publishers and subscriptions."""
        values = self.values
        self._robot = load_robot(values[params.ROBOT])
        self._servo = RollerTrajectoryServo(self._robot, values[params.COMMAND_TIMEOUT])
        values.on_change(lambda _new: None, self._apply)
        self._commands = self.create_lifecycle_publisher(
            Float64MultiArray, 'roller_velocity_controller/commands', RELIABLE
        )
        subscribe_joint_states(self, self._robot, self._servo)
        self.diagnostics.hardware_id = self._robot.name

    def activate(self) -> None:
        """Accept trajectories from now on."""
        self.create_subscription(
            JointTrajectory,
            'joint_trajectory_controller/joint_trajectory',
            self._receive_trajectory,
            RELIABLE,
        )
        self.diagnostics.set_status(Level.OK, 'no trajectory to follow')
        self._cycle = Cycle(
            self,
            self.values[RATE],
            self._step,
            jumped_back=lambda: self._clear_inputs('the clock jumped back'),
            stopped=lambda now: self._clear_inputs(f'simulated time stopped at {now}'),
            progress_timeout=self._servo.timeout,
        )

    def deactivate(self) -> None:
        """Stop the rollers."""
        self._cycle = None
        self._abort('the node was deactivated')

    def details(self) -> dict[str, object]:
        """Return the state of the trajectory and the age of the joint states."""
        if self._servo is None:
            return {}
        now = self.now()
        return {
            'following': self._servo.busy,
            'time on the trajectory [s]': f'{self._servo.time:.3f}',
            'age of joint states [s]': format_age(self._servo.rollers, now),
            'emergency stop': self._stop.reason or 'no',
        }

    def _receive_trajectory(self, message: JointTrajectory) -> None:
        if not message.points:
            self._abort('an empty trajectory was received')
            return
        now, start = self.now(), read_stamp(message.header)
        try:
            if self._stop.reason is not None:
                raise MessageError(self._stop.reason)
            if start:  # zero means at once
                require_fresh(now, self._servo.timeout, trajectory=StampedInput(None, start))
            path = read_roller_trajectory(message, self._robot)
            self._servo.begin(path, now)
        except IsotrussError as error:
            self._abort('a trajectory was rejected')
            self.diagnostics.set_status(Level.WARN, f'trajectory rejected: {error}')
            self.get_logger().warning(f'trajectory rejected: {error}')
            return
        self.diagnostics.set_status(Level.OK, f'following a trajectory of {path.duration:.1f} s')

    def _wait_for_zero(self) -> bool:
        """Return whether the subscribers have received the last command, zero."""
        return not self.active or self._commands.wait_for_all_acked(ACKNOWLEDGE_TIME)

    def _apply_stop(self) -> None:
        if self._stop.reason is not None:
            self._abort('emergency stop')

    def _apply(self) -> None:
        self._servo.timeout = self.values[params.COMMAND_TIMEOUT]
        if self._cycle is not None:
            self._cycle.change(self.values[RATE], self._servo.timeout)
        self._apply_stop()

    def _step(self, now: Time) -> None:
        if not self._servo.busy:
            return
        step = self._servo.decide(1e-9 * now.nanoseconds)
        self._commands.publish(to_command_message(step.speeds))
        if step.failure:
            self._report(Level.WARN, f'trajectory aborted: {step.failure}')
        elif step.ended:
            self._report(Level.OK, 'the rollers have arrived')

    def _clear_inputs(self, why: str) -> None:
        """Discard the joint states: after a jump of the clock their age is unknown."""
        self._servo.rollers = None
        self._abort(why)

    def _abort(self, why: str) -> None:
        """Stop the rollers if they follow a trajectory."""
        if self._servo is None or not self._servo.busy:
            return
        self._servo.end()
        self._commands.publish(to_command_message(np.zeros(len(self._robot.roller_names))))
        self._report(Level.WARN, f'trajectory aborted: {why}')

    def _report(self, level: Level, message: str) -> None:
        self.diagnostics.set_status(level, message)
        if level is Level.OK:
            self.get_logger().info(message)
        else:
            self.get_logger().warning(message)


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the node until it is interrupted.

    :param args: of the command line; those of the process if None.
    """
    return run(RollerTrajectory, args)
