"""Node `simulator`: a robot that follows roller commands, and an object to grip or in the grip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
import sys

from geometry_msgs.msg import PoseStamped
from isotruss_ros.core import (
    ConfigurationError,
    Cylinder,
    Grasp,
    HeldObject,
    load_robot,
    LooseObject,
    RollerFaults,
    SimulatedRobot,
    snug_center,
)
from isotruss_ros.nodes import parameters as params
from isotruss_ros.nodes.cycle import Cycle
from isotruss_ros.nodes.managed import ManagedNode
from isotruss_ros.nodes.messages import pose_message, stamp
from isotruss_ros.nodes.qos import RELIABLE
from isotruss_ros.nodes.report import Reporter
from isotruss_ros.nodes.runner import run
from rclpy.parameter import Parameter
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

# The simulated object is in the grip from the start and stays there, or lies free at first.
GRIP_MODULE = replace(params.GRIP_MODULE, read_only=True)
OBJECT_DIAMETER = replace(params.OBJECT_DIAMETER, read_only=True)
SQUEEZE = params.Spec(
    'squeeze',
    0.0,
    'How much nearer to the corner of the grip than where it just touches the object is [m]',
    bounds=(0.0, 0.1),
    read_only=True,
)
LIES_FREE = params.Spec(
    'object_lies_free',
    False,
    'The object lies at object_x, object_y until friction closes a grasp; in the grip if not',
    read_only=True,
)
OBJECT_X = params.Spec(
    'object_x', 0.5, 'Where the object lies free [m]', bounds=(-1e3, 1e3), read_only=True
)
OBJECT_Y = params.Spec(
    'object_y', 0.4, 'Where the object lies free [m]', bounds=(-1e3, 1e3), read_only=True
)
FRICTION = replace(params.FRICTION, read_only=True)
NOISE = params.Spec(
    'roller_noise',
    0.0,
    'Standard deviation of the speed of a moving roller [m/s]',
    bounds=(0.0, 1.0),
    read_only=True,
)
SPEED_LIMIT = params.Spec(
    'speed_limit',
    1.0,
    'Rollers cut larger commands to this [m/s]',
    bounds=(0.0, 10.0),
    read_only=True,
)
STUCK_ROLLER = params.Spec(
    'stuck_roller', '', 'Roller t/j that does not move; none if empty', read_only=True
)
SLIP = params.Spec(
    'roller_slip',
    0.0,
    'Mean share of its way that the tube does not follow a roller, unseen by the encoders',
    bounds=(0.0, 0.5),
    read_only=True,
)
SEED = params.Spec('seed', 0, 'Seed of the noise and the slip, not negative', read_only=True)
SPECS = (
    params.ROBOT,
    OBJECT_DIAMETER,
    GRIP_MODULE,
    SQUEEZE,
    LIES_FREE,
    OBJECT_X,
    OBJECT_Y,
    FRICTION,
    params.RATE,
    params.COMMAND_TIMEOUT,
    NOISE,
    SPEED_LIMIT,
    STUCK_ROLLER,
    SLIP,
    SEED,
)


class Simulator(ManagedNode):
    """
    Takes roller velocity commands, gives joint states and the object's pose.

    :raises IsotrussError: a parameter is unusable; says which and what would be right.
    """

    def __init__(self, parameter_overrides: Sequence[Parameter] = ()) -> None:
        super().__init__('simulator', SPECS, parameter_overrides)
        self._reporter = Reporter(self.get_logger())
        self._cycle: Cycle | None = None
        self.start()

    def configure(self) -> None:
        """Put the robot at home, with the object in its grip or lying free."""
        self._robot = load_robot(self.values[params.ROBOT])
        self._simulated = self._make_robot()
        self.values.on_change(lambda _new: None, self._apply)
        self._joint_states = self.create_lifecycle_publisher(JointState, 'joint_states', RELIABLE)
        self._object_pose = self.create_lifecycle_publisher(PoseStamped, 'object_pose', RELIABLE)
        self.diagnostics.hardware_id = self._robot.name

    def activate(self) -> None:
        """Follow commands from now on; none is in force yet."""
        self._time = self._commanded = 1e-9 * self.get_clock().now().nanoseconds
        self.create_subscription(
            Float64MultiArray, 'roller_velocity_controller/commands', self._take_command, RELIABLE
        )
        self._cycle = Cycle(self, self.values[params.RATE], self._step, self._jumped_back)

    def deactivate(self) -> None:
        """Stand still."""
        self._cycle = None
        self._simulated.stop()

    def _make_robot(self) -> SimulatedRobot:
        values = self.values
        module, diameter = values[GRIP_MODULE], values[OBJECT_DIAMETER]
        params.check_grip_module(self._robot, {GRIP_MODULE.name: module})
        if values[SEED] < 0:
            raise params.ParameterError(f'parameter seed: {values[SEED]}: must not be negative')
        home = self._robot.home
        stuck = frozenset({values[STUCK_ROLLER]} - {''})
        faults = RollerFaults(values[SPEED_LIMIT], values[NOISE], stuck, values[SLIP])
        if values[LIES_FREE]:
            cylinder = Cylinder((values[OBJECT_X], values[OBJECT_Y]), diameter)
            lying = LooseObject(cylinder, values[FRICTION])
            return SimulatedRobot(home, lying, faults, values[SEED])
        grasp = Grasp(module, snug_center(home, module, diameter, values[SQUEEZE]), diameter)
        return SimulatedRobot(home, HeldObject.attach(home, grasp), faults, values[SEED])

    def _apply(self) -> None:
        if self._cycle is not None:
            self._cycle.change(self.values[params.RATE])

    def _jumped_back(self) -> None:
        """Stand still, where the robot is: how long a command has been in force is not known."""
        self._simulated.stop()
        self._time = self._commanded = 1e-9 * self.get_clock().now().nanoseconds

    def _take_command(self, message: Float64MultiArray) -> None:
        # Until now the command before was in force: integrate it before it is replaced.
        self._advance(self.get_clock().now())
        try:
            self._simulated.command(message.data)
        except ConfigurationError as error:
            self._simulated.stop()
            self._reporter.warn('command', f'rollers stopped: {error}')
        self._commanded = self._time

    def _advance(self, time: Time) -> None:
        """Integrate to a time; a command that is not renewed ends after `command_timeout`."""
        now = 1e-9 * time.nanoseconds
        expiry = self._commanded + self.values[params.COMMAND_TIMEOUT]
        elapsed = min(now, expiry) - self._time
        try:
            if elapsed > 0.0:  # simulated time goes on in steps; between them nothing changes
                self._simulated.advance(elapsed)
        except ConfigurationError as error:
            self._simulated.stop()
            self._reporter.warn('blocked', f'rollers block: {error}')
        if now > expiry:
            self._simulated.stop()
            self._simulated.advance(0.0)
        self._time = now

    def _step(self, now: Time) -> None:
        self._advance(now)
        joints = JointState(
            name=list(self._robot.roller_names),
            position=self._simulated.roller_positions.tolist(),
            velocity=self._simulated.roller_velocities.tolist(),
        )
        stamp(joints.header, now)
        self._joint_states.publish(joints)
        pose = PoseStamped(pose=pose_message(self._simulated.object_pose))
        stamp(pose.header, now, self._robot.frame)
        self._object_pose.publish(pose)


def main(args: Sequence[str] | None = None) -> int:
    """Run the simulator until it is interrupted."""
    return run(Simulator, args)


if __name__ == '__main__':
    sys.exit(main())
