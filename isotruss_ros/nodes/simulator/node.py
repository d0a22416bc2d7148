# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node `simulator`: it simulates a robot that follows roller commands, and its object."""

from __future__ import annotations

from pathlib import Path

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped, WrenchStamped
from isotruss_ros.calibration.home import move_home
from isotruss_ros.core import (
    ElasticObject,
    Grip,
    HoldStatus,
    Pose,
    RigidObject,
    Robot,
    RollerFaults,
    RollingGrip,
    SimulatedRobot,
)
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.simulation.simulated_robot import SimulatedObject
from isotruss_ros.mujoco_plant.driven_robot import DrivenRobot
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.recording import PlantRecorder
from isotruss_ros.nodes.conversions.grasp_messages import read_external_wrench
from isotruss_ros.nodes.conversions.messages import check_frame, MessageError, read_pose
from isotruss_ros.nodes.framework import common_parameters as common
from isotruss_ros.nodes.framework.cycle import Cycle
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.parameters import FixedSpec, ParameterError
from isotruss_ros.nodes.framework.topics import RELIABLE
from isotruss_ros.nodes.simulator.simulated_object import place_at_start
from isotruss_ros.nodes.simulator.simulated_object import SPECS as OBJECT_SPECS
from isotruss_ros.nodes.simulator.simulated_sensors import SENSOR_SPECS, SimulatedSensors
from isotruss_ros.nodes.simulator.simulated_truth import CLOCK_SPEED, ClockSource, SimulatedTruth
import numpy as np
from std_msgs.msg import Float64MultiArray

#: Largest roller speed; faster commands are reduced to it [m/s].
SPEED_LIMIT = 1.0
#: Longest time that MuJoCo simulates per cycle unless the node uses simulated time [s]; the rest
#: is reported as lag.
MAX_CYCLE_STEP = 0.1
KINEMATIC, ELASTIC, MUJOCO = 'kinematic', 'elastic', 'mujoco'
SPECS = (
    *OBJECT_SPECS,
    FixedSpec(
        'plant',
        KINEMATIC,
        'kinematic: the object is at rest in the grasp frame but for rolling; '
        'elastic: it is where the equilibrium with the elastic tubes puts it, and can slip; '
        'mujoco: a dynamics engine moves robot and object',
    ),
    common.RATE,
    common.COMMAND_TIMEOUT,
    FixedSpec('stuck_roller', '', 'Roller t/j that does not move; none if empty'),
    FixedSpec(
        'roller_slip',
        0.0,
        'Mean slip of the tube as a share of the roller travel, not measured by encoders [-]',
        (0.0, 0.5),
    ),
    FixedSpec('seed', 0, 'Seed of the noise and the slip', (0, 2**31 - 1)),
    FixedSpec(
        'zero_deviation',
        0.0,
        "How far from the robot file's home the encoders read zero, drawn by `seed`: standard "
        'deviation of the travel [m]',
        (0.0, 0.1),
    ),
    CLOCK_SPEED,
    *SENSOR_SPECS,
    FixedSpec('recording', '', 'File of the states of MuJoCo for later rendering; none if empty'),
)


class Simulator(ManagedNode):
    """Node that follows roller velocities, and publishes joint states and object pose."""

    node_name = 'simulator'
    specs = SPECS
    awaited = ('roller_velocity_controller/commands',)
    _dropped: HoldStatus | None = None
    _driven: DrivenRobot | None = None
    _recorder: PlantRecorder | None = None

    def configure(self) -> None:
        """Create the robot at home, with the object grasped or free."""
        self._simulated = self._make_robot()
        if path := self.values.recording:
            if self._driven is None:
                raise ParameterError(
                    f'parameter recording: {path!r}: must be empty unless plant is mujoco'
                )
            self._recorder = PlantRecorder(self._driven.plant, Path(path))
        self._sensors = SimulatedSensors(self, self.robot, self.values, self.values.seed)
        self._truth = SimulatedTruth(self, self.robot)

    def activate(self) -> None:
        """Follow commands from now on; until the first command the rollers are at rest."""
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
        """Stop the rollers."""
        self._simulated.stop()

    def cleanup(self) -> None:
        """End the recording."""
        if self._recorder is not None:
            self._recorder.close()
            self._recorder = None

    def read_robot(self) -> Robot:
        """Return the robot with its home at the roller positions where the encoders read zero."""
        robot, deviation = super().read_robot(), self.values.zero_deviation
        if deviation == 0.0:
            return robot
        rng = np.random.default_rng(self.values.seed)
        return Robot(move_home(robot, deviation * rng.normal(size=len(robot.roller_names))))

    def _make_robot(self) -> SimulatedRobot | DrivenRobot:
        values = self.values
        home = self.robot.home
        stuck = frozenset({values.stuck_roller} - {''})
        faults = RollerFaults(SPEED_LIMIT, stuck=stuck, slip=values.roller_slip)
        if values.plant not in (KINEMATIC, ELASTIC, MUJOCO):
            raise ParameterError(
                f'parameter plant: {values.plant!r}: must be {KINEMATIC}, {ELASTIC} or {MUJOCO}'
            )
        body = self._body = place_at_start(self.robot, values)
        self._elastic = self._driven = None
        if values.plant == MUJOCO:
            sim_time = self.get_parameter('use_sim_time').value
            longest = float('inf') if sim_time else MAX_CYCLE_STEP
            mass, ground = values.object_mass, values.ground_friction
            options = PlantOptions(
                friction=values.friction, object_mass=mass, ground_friction=ground
            )
            free, seed = values.object_is_free, values.seed
            self._driven = DrivenRobot(self.robot, body, free, options, faults, seed, longest)
            return self._driven
        if values.plant == ELASTIC or values.object_is_free:
            simulated = self._put_object(body.pose)
        else:
            members = common.select_grip(self.robot, values)
            simulated = RigidObject.in_grip(RollingGrip.attach(home, Grip(members, body)))
        return SimulatedRobot(home, simulated, faults, values.seed)

    def _put_object(self, pose: Pose) -> SimulatedObject:
        """Return a free object at a pose; only friction can hold it."""
        self._elastic = None
        values, body = self.values, self._body.moved_to(pose)
        if values.plant == KINEMATIC:
            return RigidObject(body, values.friction)
        friction = values.friction if body.friction is None else body.friction
        self._elastic = ElasticObject(body, friction)  # type: ignore[assignment]
        return self._elastic

    def _stop_on_clock_jump(self) -> None:
        """Stop the rollers, because a jump of the clock makes the age of the command unknown."""
        self._simulated.stop()
        self._time = self._commanded = self.now()

    def _receive_command(self, message: Float64MultiArray) -> None:
        # Integrate the previous command up to now before its replacement.
        self._advance(self.now())
        try:
            self._simulated.command(message.data)
        except ConfigurationError as error:
            self._simulated.stop()
            self.warn('command', f'rollers stopped: {error}')
        self._commanded = self._time

    def _set_object_pose(self, message: PoseStamped) -> None:
        """Move the free object to another pose; the robot does not move."""
        try:
            check_frame('set_object_pose', message.header, self.robot.frame)
            pose = read_pose('set_object_pose', message.pose)
        except MessageError as error:
            self.warn('set_object_pose', str(error))
            return
        if self._driven is not None:
            self._driven.place_object(pose)
            return
        self._simulated.replace_object(self._put_object(pose))  # type: ignore[union-attr]
        self._simulated.advance(0.0)

    def _receive_wrench(self, message: WrenchStamped) -> None:
        try:
            wrench = read_external_wrench(
                message, self.robot.frame, self._simulated.object_pose.angle
            )
            if self._driven is not None:
                self._driven.plant.pull(wrench)
            elif self._elastic is not None:  # no force moves an object fixed in the grasp frame
                self._elastic.external_wrench = wrench
        except MessageError as error:
            self.warn('external_wrench', str(error))

    def _advance(self, now: float) -> None:
        """Integrate the motion up to a time; a command is valid for `command_timeout`."""
        expiry = self._commanded + self.values.command_timeout
        elapsed = min(now, expiry) - self._time
        try:
            if elapsed > 0.0:  # simulated time advances in steps
                self._simulated.advance(elapsed)
        except ConfigurationError as error:
            self._simulated.stop()
            self.warn('blocked', f'rollers blocked: {error}')
        if now > expiry:
            self._simulated.stop()
            # Each interval is integrated exactly once.
            self._simulated.advance(now - max(expiry, self._time))
        self._time = now

    def _step(self, now: float) -> None:
        self._advance(now)
        if self.values.plant != KINEMATIC:
            self._report_hold()
        if self._recorder is not None:
            self._recorder.record(now)
        simulated = self._simulated
        self._sensors.publish(
            now,
            simulated.roller_positions,
            simulated.roller_velocities,
            simulated.object_pose,
            self._joints,
        )
        self._truth.publish(now, simulated.object_pose, self._joints, self._forces)

    def _joints(self) -> Array:
        """Return the joint positions, (j, 2) [m]."""
        count = len(self.robot.topology.joint_names)
        if self._driven is not None:
            return self._driven.plant.nodes[:count]
        config = self._simulated.config  # type: ignore[union-attr]
        joints = config.nodes[:count]
        if self._elastic is not None:
            joints = self._elastic.joints(config)
        return joints

    def _forces(self) -> dict[str, float]:
        """Return the normal force of each member on the object [N]; empty without contact."""
        if self._driven is not None:
            forces = self._driven.plant.contact_forces()
            return {name: force.normal for name, force in forces.items()}
        grasp = None if self._elastic is None else self._elastic.grasp
        if grasp is None:
            return {}
        return dict(zip(grasp.member_names, grasp.normal_forces.tolist(), strict=True))

    def details(self) -> dict[str, object]:
        """Return the lag of MuJoCo behind the clock for the diagnostics."""
        driven = self._driven
        return {} if driven is None else {'lag of the simulation [s]': round(driven.lag, 3)}

    def _report_hold(self) -> None:
        """Report in the diagnostics whether the object is held; log the reason if it is lost."""
        members = [name for name, force in self._forces().items() if force > 0.0]
        dropped, before = None if self._elastic is None else self._elastic.dropped, self._dropped
        self._dropped = dropped
        if len(members) > 1:
            words = f'the object is between {", ".join(members)}'
            self.diagnostics.set_status(DiagnosticStatus.OK, words)
            return
        words = 'the object is not held'
        if dropped is not None:
            words = f'{words}: {dropped.value}'
        self.diagnostics.set_status(DiagnosticStatus.WARN, words)
        if dropped is not None and before is not dropped:
            # rclpy takes no other severity from the same line.
            if dropped is HoldStatus.NO_CONTACT:
                self.get_logger().info(words)
            else:
                self.get_logger().warning(words)
