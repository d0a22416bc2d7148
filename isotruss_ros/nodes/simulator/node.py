# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node `simulator`, which simulates a robot that follows roller commands, and its object."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped, WrenchStamped
from isotruss_ros.calibration.home import move_home
from isotruss_ros.core import HoldStatus, Robot
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.mujoco_plant.recording import PlantRecorder
from isotruss_ros.nodes.conversions.grasp_messages import read_external_wrench
from isotruss_ros.nodes.conversions.messages import check_frame, MessageError, read_pose
from isotruss_ros.nodes.framework import common_parameters as common
from isotruss_ros.nodes.framework.cycle import Cycle
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.parameters import FixedSpec, ParameterError
from isotruss_ros.nodes.framework.topics import RELIABLE
from isotruss_ros.nodes.simulator.plants import KINEMATIC, make_plant, MUJOCO, place_at_start
from isotruss_ros.nodes.simulator.plants import SPECS as OBJECT_SPECS
from isotruss_ros.nodes.simulator.simulated_sensors import SENSOR_SPECS, SimulatedSensors
from isotruss_ros.nodes.simulator.simulated_truth import CLOCK_SPEED, ClockSource, SimulatedTruth
import numpy as np
from std_msgs.msg import Float64MultiArray

SPECS = (
    *OBJECT_SPECS,
    FixedSpec(
        'plant',
        KINEMATIC,
        'kinematic: the object rolls on the grasping members without slip; '
        'elastic: the object is in equilibrium with the elastic tubes, and can slip; '
        'mujoco: MuJoCo simulates the dynamics of robot and object',
    ),
    common.RATE,
    common.COMMAND_TIMEOUT,
    FixedSpec('stuck_roller', '', 'Name t/j of a roller that does not move; empty: none'),
    FixedSpec(
        'roller_slip',
        0.0,
        'Mean slip of the tube relative to the roller travel, which encoders do not measure [-]',
        (0.0, 0.5),
    ),
    FixedSpec(
        'seed', 0, 'Random seed of noise, dropouts, slip and roller offsets', (0, 2**31 - 1)
    ),
    FixedSpec(
        'zero_deviation',
        0.0,
        'Standard deviation of the initial roller offsets, which are drawn with `seed` [m]',
        (0.0, 0.1),
    ),
    CLOCK_SPEED,
    *SENSOR_SPECS,
    FixedSpec('recording', '', 'File for the states of MuJoCo, for later rendering; empty: none'),
)


class Simulator(ManagedNode):
    """Node that simulates a robot with commanded roller velocities, and publishes its sensors."""

    node_name = 'simulator'
    specs = SPECS
    awaited = ('roller_velocity_controller/commands',)
    _dropped: HoldStatus | None = None
    _recorder: PlantRecorder | None = None

    def configure(self) -> None:
        """Create the robot at home, with the object grasped or free."""
        values, sim_time = self.values, self.get_parameter('use_sim_time').value
        self._plant = make_plant(
            self.robot, place_at_start(self.robot, values), values, not sim_time
        )
        if path := values.recording:
            if values.plant != MUJOCO:
                raise ParameterError(
                    f'parameter recording: {path!r}: must be empty unless plant is mujoco'
                )
            plant = self._plant.plant  # type: ignore[union-attr]
            self._recorder = PlantRecorder(plant, Path(path))
        self._sensors = SimulatedSensors(self, self.robot, values)
        self._truth = SimulatedTruth(self, self.robot)

    def activate(self) -> None:
        """Execute commands from now on; until the first command the rollers rest."""
        speed = self.values.clock_speed
        if speed > 0.0:
            ClockSource(self, self.values.rate, speed)
        self._time = self._commanded = self.now()
        for kind, topic, receive in (
            (Float64MultiArray, 'roller_velocity_controller/commands', self._receive_command),
            (PoseStamped, 'set_object_pose', self._set_object_pose),
            (WrenchStamped, 'external_wrench', self._receive_wrench),
        ):
            self.create_subscription(kind, topic, receive, RELIABLE)
        self.cycle = Cycle(self, self._step, self._stop_on_clock_jump)

    def deactivate(self) -> None:
        """Stop the simulated rollers."""
        self._plant.stop()

    def cleanup(self) -> None:
        """End the recording of the plant's states."""
        if self._recorder is not None:
            self._recorder.close()
            self._recorder = None

    def read_robot(self) -> Robot:
        """Return the robot with home at the roller positions at which the encoders read zero."""
        robot, deviation = super().read_robot(), self.values.zero_deviation
        if deviation == 0.0:
            return robot
        rng = np.random.default_rng(self.values.seed)
        return Robot(move_home(robot, deviation * rng.normal(size=len(robot.roller_names))))

    def _stop_on_clock_jump(self) -> None:
        """Stop the rollers, because a jump of the clock makes the age of the command unknown."""
        self._plant.stop()
        self._time = self._commanded = self.now()

    def _receive_command(self, message: Float64MultiArray) -> None:
        # Integrate the previous command up to now before its replacement. The object, whose
        # equilibrium takes most of the computing time, follows in the next step.
        self._move(self.now(), self._plant.drive)
        try:
            self._plant.command(message.data)
        except ConfigurationError as error:
            self._plant.stop()
            self.reasons.note('command', f'rollers stopped: {error}')
        self._commanded = self._time

    def _set_object_pose(self, message: PoseStamped) -> None:
        """Move the free object to another pose; the robot does not move."""
        try:
            check_frame('set_object_pose', message.header, self.robot.frame)
            pose = read_pose('set_object_pose', message.pose)
        except MessageError as error:
            self.reasons.note('set_object_pose', str(error))
            return
        self._plant.place_object(pose)

    def _receive_wrench(self, message: WrenchStamped) -> None:
        angle = self._plant.object_pose.angle
        try:
            self._plant.pull(read_external_wrench(message, self.robot.frame, angle))
        except MessageError as error:
            self.reasons.note('external_wrench', str(error))

    def _move(self, now: float, move: Callable[[float], None]) -> None:
        """Simulate the motion up to a time; a command is valid for `command_timeout`."""
        expiry = self._commanded + self.values.command_timeout
        elapsed = min(now, expiry) - self._time
        try:
            if elapsed >= 0.0:  # at zero, the object follows the rollers
                move(elapsed)
        except ConfigurationError as error:
            self._plant.stop()
            self.reasons.note('blocked', f'rollers blocked: {error}')
        if now > expiry:
            self._plant.stop()
            # Each interval is integrated exactly once.
            move(now - max(expiry, self._time))
        self._time = now

    def _step(self, now: float) -> None:
        self._move(now, self._plant.advance)
        if self.values.plant != KINEMATIC or self.values.object_is_free:
            self._report_hold()
        if self._recorder is not None:
            self._recorder.record(now)
        self._sensors.publish(now, self._plant)
        self._truth.publish(now, self._plant)

    def details(self) -> dict[str, object]:
        """Return the time by which MuJoCo lags behind the clock, for the diagnostics."""
        lag = self._plant.lag
        return {} if lag is None else {'lag of the simulation [s]': round(lag, 3)}

    def _report_hold(self) -> None:
        """Report in the diagnostics whether the object is held; log the reason of a loss."""
        members = [name for name, force in self._plant.normal_forces.items() if force > 0.0]
        dropped, before = self._plant.dropped, self._dropped
        self._dropped = dropped
        if len(members) > 1:
            words = f'the object is between {", ".join(members)}'
            self.diagnostics.set_status(words)
            return
        words = 'the object is not held'
        if dropped is not None:
            words = f'{words}: {dropped.value}'
        self.diagnostics.set_status(words, DiagnosticStatus.WARN)
        if dropped is not None and before is not dropped:
            # rclpy takes no other severity from the same line.
            if dropped is HoldStatus.NO_CONTACT:
                self.get_logger().info(words)
            else:
                self.get_logger().warning(words)
