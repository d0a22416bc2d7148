# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A node that stands in for the rest of the world, and nodes under one executor."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
import contextlib
import math
import sys
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped, Twist, WrenchStamped
from isotruss_msgs.msg import GraspState, ManipulationStatus
from isotruss_ros.core import deform, load_robot, Pose, tangent_center
from isotruss_ros.nodes.conversions import messages
from isotruss_ros.nodes.conversions.grasp_messages import to_wrench_message
from isotruss_ros.nodes.conversions.sensor_messages import to_joint_markers
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.manipulation.node import Manipulation
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
import numpy as np
import rclpy
from rclpy.client import Client
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure, JointState, MultiDOFJointState
from std_msgs.msg import Bool, Float64MultiArray
from std_srvs.srv import Trigger

#: Far more than anything needs here; a busy machine must not fail a test [s].
DEADLINE = 240.0
#: What is said once is kept for late joiners.
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
ROBOT = load_robot('nine_member')
MODULE = 'north/Z'
DIAMETER = 0.3
CENTER = tangent_center(ROBOT.home, MODULE, DIAMETER)
UP = (0.0, 0.02, 0.0)
N = len(ROBOT.roller_names)


def overrides(**values: object) -> list[Parameter]:
    return [Parameter(name, value=value) for name, value in values.items()]


def failed(*rollers: str) -> DiagnosticArray:
    """Return a message of `failed_rollers`."""
    error = DiagnosticStatus.ERROR
    return DiagnosticArray(status=[DiagnosticStatus(name=name, level=error) for name in rollers])


def maker(kind: type[Node], **defaults: object) -> Callable[..., Callable[[], Node]]:
    """Return a function of parameters, of which some have defaults, for what makes a node."""
    return lambda **values: lambda: kind(overrides(**(defaults | values)))


#: To made-up joint states no roller has failed.
manipulation = maker(Manipulation, failure_time=0.0)


def hang_joints(weight: float) -> dict[str, list[float]]:
    """Return the joints (x, y) [m] of an upright robot whose modules have a weight [N]."""
    bent = deform(ROBOT.home, {}, module_loads=dict.fromkeys(ROBOT.module_names, (0, -weight, 0)))
    places = zip(ROBOT.topology.joint_names, ROBOT.home.nodes, strict=False)
    return {name: (place + bent.displacement(name)[:2]).tolist() for name, place in places}


def planar(message: PoseStamped) -> np.ndarray:
    """Return the pose of an object (x, y, angle) [m, rad]."""
    return np.array(messages.read_pose('pose', message.pose))


class Probe(Node):
    """Publishes every input of our nodes and keeps every output with the time of its arrival."""

    def __init__(self, twist_type: type, sim_time: bool = False) -> None:
        super().__init__(
            'probe',
            parameter_overrides=overrides(use_sim_time=sim_time),
            start_parameter_services=False,
            enable_rosout=False,
        )
        self.twists = self.create_publisher(twist_type, 'cmd_vel', 1)
        self.joint_states = self.create_publisher(JointState, 'joint_states', 1)
        self.object_poses = self.create_publisher(PoseStamped, 'object_pose', 1)
        self.commands = self.create_publisher(
            Float64MultiArray, 'roller_velocity_controller/commands', 1
        )
        self.wrenches = self.create_publisher(WrenchStamped, 'external_wrench', 1)
        self.gauges = self.create_publisher(FluidPressure, 'tube_pressures', 10)
        self.stops = self.create_publisher(Bool, 'emergency_stop', LATCHED)
        self.clock = self.create_publisher(Clock, '/clock', 1)
        self._noise = 1e-12  # a tracker never measures the same pose to the last bit [m]
        self._states: Publisher | None = None  # made by the first state
        self._markers: Publisher | None = None  # made by the first markers
        self.seen: dict[str, list] = {}
        for kind, key, topic in (
            (Float64MultiArray, 'command', 'roller_velocity_controller/commands'),
            (ManipulationStatus, 'status', 'manipulation/status'),
            (JointState, 'joints', 'joint_states'),
            (PoseStamped, 'pose', 'object_pose'),
            (GraspState, 'state', 'grasp/state'),
            (Bool, 'closure', 'grasp/force_closure'),
            (Bool, 'held', 'grasp/held'),
            (WrenchStamped, 'wrench', 'grasp/wrench'),
            (DiagnosticArray, 'diagnostics', '/diagnostics'),
        ):
            self.listen(kind, key, topic)

    def listen(self, kind: type, key: str, topic: str) -> None:
        """Keep the messages of a topic in `seen`."""
        self.seen[key] = []
        self.create_subscription(kind, topic, lambda message: self._take(key, message), 100)

    def _take(self, key: str, message: object) -> None:
        self.seen[key].append((time.monotonic(), message))

    def last(self, key: str) -> object | None:
        return self.seen[key][-1][1] if self.seen[key] else None

    def past(self, age: float) -> float:
        """Return the time `age` seconds ago (in the future if negative) [s]."""
        return 1e-9 * self.get_clock().now().nanoseconds - age

    def tick(self, time_of: float) -> None:
        """Publish simulated time [s]."""
        self.clock.publish(Clock(clock=Time(nanoseconds=round(1e9 * time_of)).to_msg()))

    def send_twist(self, twist: tuple[float, float, float] = UP) -> None:
        self.twists.publish(messages.to_twist_message(twist))

    def send_joints(self, age: float = 0.0, **changes: object) -> None:
        """Publish joint states at home, changed as given."""
        fields = {'name': list(ROBOT.roller_names), 'position': [0.0] * N} | changes
        message = JointState(**fields)
        message.header = messages.make_header(self.past(age))
        self.joint_states.publish(message)

    def send_pose(
        self, age: float = 0.0, frame: str = 'truss', center: tuple[float, float] = CENTER
    ) -> None:
        """Publish the object's pose with a noise of 1 pm, in the grip unless told otherwise."""
        self._noise = -self._noise
        self.send_object((center[0], center[1] + self._noise, 0.3), age, frame)

    def send_object(self, pose: Sequence[float], age: float = 0.0, frame: str = 'truss') -> None:
        """Publish a pose (x, y, angle) of the object [m, rad]."""
        message = PoseStamped(pose=messages.to_pose_message(Pose(*map(float, pose))))
        message.header = messages.make_header(self.past(age), frame)
        self.object_poses.publish(message)

    def send_held(self, held: int, members: Sequence[str] = (), **fields: object) -> None:
        """Publish whether the analysis has the object held, and by which members."""
        if self._states is None:
            self._states = self.create_publisher(GraspState, 'grasp/state', 1)
        state = GraspState(held=held, grasping_members=list(members), **fields)
        state.header = messages.make_header(self.past(0.0), 'truss')
        self._states.publish(state)

    def send_markers(self, joints: Mapping[str, Sequence[float]], age: float = 0.0) -> None:
        """Publish measured joints (x, y) [m]."""
        if self._markers is None:
            self._markers = self.create_publisher(MultiDOFJointState, 'joint_markers', 10)
        message = to_joint_markers(joints)
        message.header = messages.make_header(self.past(age), 'truss')
        self._markers.publish(message)

    def send_pressures(self, pressures: Sequence[float]) -> None:
        for tube, pressure in zip(ROBOT.description.pressures, pressures, strict=True):
            header = messages.make_header(self.past(0.0), tube)
            self.gauges.publish(FluidPressure(header=header, fluid_pressure=float(pressure)))

    def send_wrench(
        self,
        wrench: tuple[float, float, float],
        age: float = 0.0,
        frame: str = 'truss_object_aligned',
    ) -> None:
        message = WrenchStamped(wrench=to_wrench_message(wrench))
        message.header = messages.make_header(self.past(age), frame)
        self.wrenches.publish(message)

    def send_command(self, velocities: Sequence[float]) -> None:
        self.commands.publish(Float64MultiArray(data=list(map(float, velocities))))

    def send_measured(self, **changes: object) -> None:
        """Publish joint states at home, and a pose of the object, changed as given."""
        self.send_joints()
        self.send_pose(**changes)

    def send_all(self, **changes: object) -> None:
        """Publish good inputs of the manipulation node, the pose changed as given."""
        self.send_measured(**changes)
        self.send_twist()


class Watched:
    """Messages of nodes to a probe; `nodes` are the probe and the nodes."""

    probe: Probe
    nodes: list[Node]
    until: Callable[..., None]
    call: Callable[[str, object], Any]

    def spin(self, duration: float, each: Callable[[], None] = lambda: None) -> None:
        end = time.monotonic() + duration - 1e-9
        self.until(lambda: time.monotonic() >= end, each)

    def release_stop(self) -> object:
        """Release the emergency stop; return the response."""
        return self.call('release_emergency_stop', Trigger.Request())

    def until_code(
        self, code: int, each: Callable[[], None], key: str = 'status'
    ) -> ManipulationStatus | GraspState:
        """Go on until a node reports a code; return the `status` or the `state` of the grasp."""
        self.until(lambda: self.code(key) == code, each)
        return self.probe.last(key)

    def code(self, key: str = 'status') -> int | None:
        report = self.probe.last(key)
        return None if report is None else report.code

    def command(self) -> np.ndarray:
        message = self.probe.last('command')
        return np.full(N, math.nan) if message is None else np.array(message.data)

    def change(self, **values: object) -> None:
        """Set parameters of the first node, which takes them."""
        results = self.nodes[1].set_parameters(overrides(**values))
        assert all(result.successful for result in results), results

    def place(self) -> np.ndarray | None:
        """Return the last pose of the object (x, y, angle) [m, rad]; None before."""
        message = self.probe.last('pose')
        return None if message is None else planar(message)

    def travel(self) -> np.ndarray:
        """Return the last measured travel of the rollers, zero before [m]."""
        message = self.probe.last('joints')
        return np.zeros(N) if message is None else np.array(message.position)

    def report(self, name: str) -> DiagnosticStatus:
        """Return the last diagnostics of a node, stale before the first."""
        for _, array in reversed(self.probe.seen['diagnostics']):
            if array.status[0].name == name:
                return array.status[0]
        return DiagnosticStatus(level=DiagnosticStatus.STALE)

    def detail(self, key: str, name: str = 'manipulation') -> str:
        return {item.key: item.value for item in self.report(name).values}.get(key, '')


class World(Watched):
    """Nodes under one executor, destroyed at the end."""

    def __init__(
        self, *nodes: ManagedNode, twist_type: type = Twist, sim_time: bool = False
    ) -> None:
        self.probe = Probe(twist_type, sim_time)
        self.nodes = [self.probe, *nodes]
        self._clients: dict[str, Client] = {}
        self.executor = SingleThreadedExecutor()
        for node in self.nodes:
            self.executor.add_node(node)

    def add(self, node: ManagedNode) -> ManagedNode:
        self.nodes.append(node)
        self.executor.add_node(node)
        return node

    def call(self, name: str, request: object) -> object:
        if name not in self._clients:
            kind = type(request).__name__.removesuffix('_Request')
            service = getattr(sys.modules[type(request).__module__], kind)
            self._clients[name] = self.probe.create_client(service, name)
        client = self._clients[name]
        self.until(client.service_is_ready)
        return self.ask(lambda: client.call_async(request))

    def ask(self, send: Callable[[], Future], period: float = 1.0) -> object:
        """Return the first answer to repeated requests; some are lost before discovery."""
        sent: list[Future] = []
        self.until(lambda: any(f.done() for f in sent), lambda: sent.append(send()), period)
        return next(future.result() for future in sent if future.done())

    def until(
        self, ok: Callable[[], bool], each: Callable[[], None] = lambda: None, period: float = 0.01
    ) -> None:
        """Spin until something holds; fail at the deadline."""
        deadline = time.monotonic() + DEADLINE
        due = 0.0
        while not ok():
            assert time.monotonic() < deadline, (
                f'not within {DEADLINE} s; last status: {self.probe.last("status")}'
            )
            if time.monotonic() >= due:
                each()
                due = time.monotonic() + period
            self.executor.spin_once(timeout_sec=min(period, 0.005))

    def close(self) -> None:
        self.executor.shutdown()
        for node in self.nodes:
            node.destroy_node()


class Manager:
    """Requests of transitions to a managed node."""

    UP = (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE)
    DOWN = (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP)

    def __init__(self, w: Watched, name: str) -> None:
        self._world, self._name = w, name

    def ask(self, transition: int, label: str = '') -> bool:
        """Request a transition; return whether it came about."""
        wanted = ChangeState.Request(transition=Transition(id=transition, label=label))
        return self._world.call(f'{self._name}/change_state', wanted).success

    def state(self) -> str:
        state = self._world.call(f'{self._name}/get_state', GetState.Request())
        return state.current_state.label

    def restart(self) -> None:
        """Go down to unconfigured, and up to active again."""
        assert all(self.ask(transition) for transition in (*self.DOWN, *self.UP))


def begin_context(args: Sequence[str] = ()) -> None:
    """Bring up rclpy; tests that need no middleware may have left it up."""
    if rclpy.ok():
        rclpy.shutdown()
    rclpy.init(args=list(args))


@contextlib.contextmanager
def world(
    *make_nodes: Callable[[], ManagedNode],
    twist_type: type = Twist,
    sim_time: bool = False,
    remaps: Sequence[str] = (),
) -> Iterator[World]:
    """Bring up a context with nodes, with remaps such as `node:from:=to`, and take it down."""
    begin_context(['--ros-args', *(part for rule in remaps for part in ('-r', rule))])
    made = None
    try:
        made = World(*(make() for make in make_nodes), twist_type=twist_type, sim_time=sim_time)
        yield made
    finally:
        if made is not None:
            made.close()
        rclpy.shutdown()
