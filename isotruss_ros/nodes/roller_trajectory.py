"""
Node `roller_trajectory`: drives the rollers along a trajectory, such as the way to a grasp.

It stands where ros2_control's joint_trajectory_controller would, on the topic that this takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
import sys

from isotruss_ros.core import IsotrussError, load_robot, Refusal, Sample
from isotruss_ros.core.roller_path_servo import RollerPathServo
from isotruss_ros.core.samples import require_fresh
from isotruss_ros.nodes import parameters as params
from isotruss_ros.nodes.cycle import Cycle
from isotruss_ros.nodes.diagnostics import Level
from isotruss_ros.nodes.emergency_stop import EmergencyStop
from isotruss_ros.nodes.inputs import age, latest
from isotruss_ros.nodes.managed import ManagedNode
from isotruss_ros.nodes.messages import command_message, MessageError, RollerStates, seconds
from isotruss_ros.nodes.newest import subscribe_newest
from isotruss_ros.nodes.qos import RELIABLE
from isotruss_ros.nodes.runner import run
from isotruss_ros.nodes.trajectory_messages import roller_path
import numpy as np
from rclpy.parameter import Parameter
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

RATE = replace(params.RATE, default=100.0, bounds=(10.0, 1000.0))
SPECS = (params.ROBOT, RATE, params.COMMAND_TIMEOUT, params.REQUIRE_EMERGENCY_STOP)
#: Of this node alone: `manipulation` has a stop of its own to be released.
RELEASE = '~/release_emergency_stop'


class RollerTrajectory(ManagedNode):
    """
    Follows one trajectory at a time; says nothing to the rollers while there is none.

    A new trajectory takes over from the old one, an empty one ends it. An emergency stop ends it
    too, and none is taken until it is released; nothing goes on by itself afterwards.

    :raises IsotrussError: a parameter is unusable; says which and what would be right.
    """

    def __init__(self, parameter_overrides: Sequence[Parameter] = ()) -> None:
        super().__init__('roller_trajectory', SPECS, parameter_overrides)
        self._servo: RollerPathServo | None = None
        self._cycle: Cycle | None = None
        self._stop = EmergencyStop(
            self, lambda: self.values[params.REQUIRE_EMERGENCY_STOP], self._stop_changed, RELEASE
        )
        self.start()

    def configure(self) -> None:
        """Listen to the rollers."""
        values = self.values
        self._robot = load_robot(values[params.ROBOT])
        self._states = RollerStates(self._robot.roller_names)
        self._servo = RollerPathServo(self._robot, values[params.COMMAND_TIMEOUT])
        values.on_change(lambda _new: None, self._apply)
        self._commands = self.create_lifecycle_publisher(
            Float64MultiArray, 'roller_velocity_controller/commands', RELIABLE
        )
        subscribe_newest(self, JointState, 'joint_states', self._take_joint_states)
        self.diagnostics.hardware_id = self._robot.name

    def activate(self) -> None:
        """Take trajectories from now on."""
        self.create_subscription(
            JointTrajectory,
            'joint_trajectory_controller/joint_trajectory',
            self._take_trajectory,
            RELIABLE,
        )
        self.diagnostics.say(Level.OK, 'no trajectory to follow')
        self._cycle = Cycle(
            self,
            self.values[RATE],
            self._step,
            jumped_back=lambda: self._forget('the clock ran back'),
            stands=lambda now: self._forget(f'simulated time stands at {now}'),
            patience=self._servo.timeout,
        )

    def deactivate(self) -> None:
        """Leave the rollers at rest."""
        self._cycle = None
        self._give_up('the node was deactivated')

    def details(self) -> dict[str, object]:
        """Return what it does and what it goes by."""
        if self._servo is None:
            return {}
        now = 1e-9 * self.get_clock().now().nanoseconds
        return {
            'following': self._servo.busy,
            'time on the trajectory [s]': f'{self._servo.time:.3f}',
            'age of joint states [s]': age(self._servo.rollers, now),
            'emergency stop': self._stop.reason or 'no',
        }

    def _take_joint_states(self, message: JointState) -> None:
        try:
            came = Sample(self._states.state(message), seconds(message.header))
            self._servo.rollers = latest(self._servo.rollers, came, self._servo.timeout)
        except MessageError as error:
            self._servo.rollers = Refusal(str(error))

    def _take_trajectory(self, message: JointTrajectory) -> None:
        if not message.points:
            self._give_up('an empty trajectory ends it')
            return
        now, meant = 1e-9 * self.get_clock().now().nanoseconds, seconds(message.header)
        try:
            if self._stop.reason is not None:
                raise MessageError(self._stop.reason)
            if meant:  # zero means at once
                require_fresh('trajectory', Sample(None, meant), now, self._servo.timeout)
            path = roller_path(message, self._robot)
            self._servo.begin(path, now)
        except IsotrussError as error:
            self._give_up('a trajectory that cannot be followed came')
            self.diagnostics.say(Level.WARN, f'trajectory refused: {error}')
            self.get_logger().warning(f'trajectory refused: {error}')
            return
        self.diagnostics.say(Level.OK, f'following a trajectory of {path.duration:.1f} s')

    def _stop_changed(self) -> None:
        if self._stop.reason is not None:
            self._give_up('emergency stop')

    def _apply(self) -> None:
        self._servo.timeout = self.values[params.COMMAND_TIMEOUT]
        if self._cycle is not None:
            self._cycle.change(self.values[RATE], self._servo.timeout)
        self._stop_changed()

    def _step(self, now: Time) -> None:
        if not self._servo.busy:
            return
        step = self._servo.decide(1e-9 * now.nanoseconds)
        self._commands.publish(command_message(step.speeds))
        if step.failure:
            self._tell(Level.WARN, f'trajectory given up: {step.failure}')
        elif step.ended:
            self._tell(Level.OK, 'the rollers have arrived')

    def _forget(self, why: str) -> None:
        """Rely on nothing that was measured so far: its age cannot be known."""
        self._servo.rollers = None
        self._give_up(why)

    def _give_up(self, why: str) -> None:
        """Leave the rollers at rest if they follow a trajectory."""
        if self._servo is None or not self._servo.busy:
            return
        self._servo.end()
        self._commands.publish(command_message(np.zeros(len(self._robot.roller_names))))
        self._tell(Level.WARN, f'trajectory given up: {why}')

    def _tell(self, level: Level, message: str) -> None:
        self.diagnostics.say(level, message)
        if level is Level.OK:
            self.get_logger().info(message)
        else:
            self.get_logger().warning(message)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until it is interrupted."""
    return run(RollerTrajectory, args)


if __name__ == '__main__':
    sys.exit(main())
