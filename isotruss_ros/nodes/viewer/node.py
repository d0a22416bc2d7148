# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node `viewer`, which shows robot, object and grasp in a browser, and accepts its commands."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import math
import time
import traceback
from typing import Any, TYPE_CHECKING

from geometry_msgs.msg import PoseStamped, Twist, WrenchStamped
from isotruss_msgs.msg import GraspState, ManipulationStatus, Obstacles
from isotruss_ros.core import load_robot, Pose, read_object
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.extras import MissingPackageError
from isotruss_ros.nodes.conversions.grasp_messages import to_wrench_message
from isotruss_ros.nodes.conversions.messages import (
    ALIGNED_OBJECT,
    make_header,
    MessageError,
    name_frame,
    request_parameters,
    to_twist_message,
)
from isotruss_ros.nodes.conversions.obstacle_messages import to_obstacles_message
from isotruss_ros.nodes.framework import common_parameters as common
from isotruss_ros.nodes.framework.parameters import FixedSpec, ROBOT, Spec
from isotruss_ros.nodes.framework.robot_frame import RobotFrame
from isotruss_ros.nodes.framework.runner import StoppableNode
from isotruss_ros.nodes.framework.supervision import describe_absence
from isotruss_ros.nodes.framework.topics import LATCHED, RELIABLE, subscribe_newest
from isotruss_ros.nodes.viewer.view_requests import (
    Calls,
    make_calls,
    MANIPULATION,
    NodeRestart,
    OBJECT_NODES,
    ObjectGoals,
)
from isotruss_ros.viewer.control import ZERO
from isotruss_ros.viewer.drag import LEVER_LENGTH, place_on_circle, PROGRESS_TIME
from isotruss_ros.viewer.message_checks import PictureError
from isotruss_ros.viewer.names import (
    CLEAR,
    DRAGGED,
    LOCAL,
    OBJECT,
    OBJECTS,
    PICK,
    PLACE,
    PLANT,
    RELEASE,
    RESET,
    RESUME,
    SHAPE,
)
from isotruss_ros.viewer.picture import Picture
from nav_msgs.msg import Path
from rclpy.client import Client
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

if TYPE_CHECKING:
    from isotruss_ros.viewer.controls import Controls
    from isotruss_ros.viewer.view import View

SPECS = (
    ROBOT,
    *common.OBJECT_SPECS,
    common.OBSTACLES,
    FixedSpec(
        'host', LOCAL, 'Address of the server; the default is reachable only from this machine'
    ),
    FixedSpec('port', 8080, 'Port of the server; 0: any free port', (0, 65535)),
    FixedSpec(
        'browser_timeout',
        0.5,
        'Time without a drawn picture after which a page loses control [s]; a page that draws '
        'slowly has twice its longest delay, at most 2 s',
        (0.2, 60.0),
    ),
    FixedSpec('rate', 20.0, 'Displayed frames per second [Hz]', (5.0, 60.0)),
    Spec('max_speed', 0.05, 'Largest speed of the dragged object or joint [m/s]', (0.001, 1.0)),
)
#: Parameters of other nodes that each request sets, by the name of the request.
SETTINGS = {
    'friction': ('friction', OBJECT_NODES),
    'diameter': ('object_diameter', OBJECT_NODES),
    'squeeze': ('squeeze_force', (MANIPULATION,)),
}
#: Longest time in which the release of an emergency stop is tried [s].
RELEASE_TIMEOUT = 2.0


class Viewer(StoppableNode):
    """Node that shows the newest messages, and moves the object toward a dragged handle."""

    node_name = 'viewer'
    specs = SPECS

    def start(self) -> None:
        """Create publishers, subscriptions and clients."""
        self.picture = Picture(load_robot(self.values.robot), self.values.object_diameter)
        described = common.read_described(self.values)
        if described is not None:
            self.picture.shape = described.shape
        self.picture.room.resting = common.read_resting_obstacles(self.values)
        self._view: View | None = None
        self._controls: Controls | None = None
        self._moving = self._pulling = self._stopped = False
        self._subscribe()
        self._twists = self.advertise(Twist, 'cmd_vel')
        self._wrenches = self.advertise(WrenchStamped, 'external_wrench')
        self._placed = self.advertise(Obstacles, 'obstacles')
        self._stops = self.advertise(Bool, 'emergency_stop', LATCHED)
        self._release = self.create_client(Trigger, 'release_emergency_stop')
        self._resume = self.create_client(Trigger, 'resume_grip')
        self._clear = self.create_client(Trigger, 'clear_obstacles')
        self._goals = ObjectGoals(self, self._report_goal)
        self._restart = NodeRestart(self, self._report_goal)
        self._squeeze = 0.0

    def begin(self) -> None:
        """Start the server of the view, and print its address."""
        try:
            from isotruss_ros.viewer.controls import Controls
            from isotruss_ros.viewer.view import View
        except ModuleNotFoundError as error:
            raise MissingPackageError(error) from error
        host = self.values.host
        self._view = View(self.picture, host, self.values.port)
        if not self._view.local:
            self.get_logger().warning(
                f'host {host}: whoever knows the token in the address can watch and command the '
                'robot; the token is sent without encryption'
            )
        self._controls = Controls(
            self._view.server,
            self.picture,
            self.values.friction,
            self.values.browser_timeout,
            self._report_refusal,
            partial(self.reasons.note, 'control'),
        )
        print(f'viewer: {self._view.address}', flush=True)
        self.create_steady_timer(1.0 / self.values.rate, self._step)

    def stop(self) -> None:
        """Publish a zero twist if twists were published, and stop the server."""
        if self._moving:
            self._twists.publish(Twist())
        if self._view is not None:
            self._view.close()

    def fail(self, error: Exception) -> None:
        """
        End the control by a browser after an uncaught error in a callback.

        The node goes on, because it has the stop button.
        """
        if self._controls is None:
            raise error
        place = traceback.extract_tb(error.__traceback__)[-1]
        words = f'error of the viewer: {type(error).__name__}: {error}'
        self.reasons.note('error', f'{words} (in {place.name}, {place.filename}:{place.lineno})')
        self._controls.give_up(words)
        self._publish_twist(None, self.now())
        self._publish_wrench()

    def _subscribe(self) -> None:
        picture = self.picture
        self._frame = RobotFrame.heard_by(self, picture.robot)
        for kind, topic, receive in (
            (JointState, 'joint_states', picture.receive_joint_states),
            (PoseStamped, 'object_pose', self._receive_object_pose),
            (GraspState, 'grasp/state', picture.receive_state),
            (ManipulationStatus, 'manipulation/status', picture.receive_status),
            (MarkerArray, 'grasp/markers', picture.receive_markers),
            (Obstacles, 'obstacles', self._receive_obstacles),
            (Path, 'planned_path', picture.receive_path),
        ):
            # Messages of obstacles from several publishers are parts of one state.
            every = kind is Obstacles
            subscribe_newest(self, kind, topic, partial(self._receive, topic, receive), every)
        # An earlier latched stop is in the status.
        self.create_subscription(Bool, 'emergency_stop', self._receive_stop, RELIABLE)

    def _receive(self, topic: str, receive: Callable[[Any, float], None], message: Any) -> None:
        try:
            receive(message, time.monotonic())
        except (PictureError, MessageError, ConfigurationError) as error:
            self.reasons.note(topic, str(error))

    def _receive_object_pose(self, message: PoseStamped, now: float) -> None:
        self.picture.take_pose(self._frame.read_pose(message), now)

    def _receive_obstacles(self, message: Obstacles, now: float) -> None:
        self.picture.room.take_obstacles(self._frame.read_obstacles(message), now)

    def _receive_stop(self, message: Bool) -> None:
        self._stopped = message.data

    def _step(self) -> None:
        # Progress counts on the clock of the robot, which a busy simulator slows down.
        controls, now, robot_time = self._controls, time.monotonic(), self.now()
        if controls.hear(now):
            self._stops.publish(Bool(data=True))
        stopped = self._stopped or self.picture.is_stopped(now)
        if controls.control.stopped and not stopped:
            self._report_goal('')  # requests from before the stop are void
        controls.control.latch(stopped)
        for name, value in controls.take(now, robot_time):
            self._carry_out(name, value)
        control, pose = controls.control, self._dragged_pose(now)
        position = None if pose is None else pose[:2]
        if pose is not None and control.drag is not None and control.drag.turns:
            position = place_on_circle(pose.angle, control.drag.target[0])
        if control.drag is not None and control.drag.is_stuck(robot_time):
            self._give_up(position, now)
        moves = control.drag is not None and not control.drag.turns
        self.picture.goal = control.drag.target if moves else None
        controls.update(pose)
        self._publish_twist(position, robot_time)
        self._publish_wrench()
        self._publish_obstacles(robot_time)
        self._view.update(now)
        controls.mark(now)

    def _dragged_pose(self, now: float) -> Pose | None:
        """Return the pose of the object or joint that is dragged; None if unknown."""
        picture, name = self.picture, self._controls.dragged
        if not picture.is_fresh('object_pose' if name == OBJECT else 'joint_states', now):
            return None
        if name == OBJECT:
            return picture.pose
        place = picture.robot.node_names.index(name)
        return Pose(*picture.config.nodes[place].tolist(), 0.0)  # type: ignore[call-arg]

    def _give_up(self, position: tuple[float, float] | None, now: float) -> None:
        control = self._controls.control
        left = 'its position is unknown'
        if position is not None:
            way = math.dist(position, control.drag.target)
            left = f'{1e3 * way:.0f} mm left'
            if control.drag.turns:
                left = f'{math.degrees(way / LEVER_LENGTH):.0f}° left'
        control.drag = None
        words = f'{self._controls.dragged}: no progress for {PROGRESS_TIME:.0f} s, {left}'
        why = self.picture.describe_hindrance(now, PROGRESS_TIME)
        self._report_goal(f'drag aborted: {words}; {why}')
        self.get_logger().warning(self.picture.goal_report)

    def _publish_twist(self, position: tuple[float, float] | None, now: float) -> None:
        drag = self._controls.control.drag
        if drag is None or position is None:
            if self._moving:
                self._twists.publish(Twist())
            self._moving = False
            return
        if not self._moving:
            self._report_goal('')
        vx, vy = drag.follow(position, self.values.max_speed, now)
        twist = (0.0, 0.0, vx / LEVER_LENGTH) if drag.turns else (vx, vy, 0.0)
        self._twists.publish(to_twist_message(twist))
        self._moving = True

    def _publish_wrench(self) -> None:
        wrench = self._controls.control.wrench
        if wrench == ZERO and not self._pulling:
            return
        header = make_header(self.now(), name_frame(self.picture.robot.frame, ALIGNED_OBJECT))
        self._wrenches.publish(WrenchStamped(header=header, wrench=to_wrench_message(wrench)))
        # Twists continue once published: old ones expire.
        self._pulling = True

    def _publish_obstacles(self, now: float) -> None:
        """Publish the placed obstacles, with control or without, so that none is silent."""
        placed = self._controls.placed.advance(now)
        if placed:
            self._placed.publish(to_obstacles_message(placed, now, self.picture.robot.frame))

    def _carry_out(self, name: str, value: float | str) -> None:
        if name == RELEASE:
            self._stops.publish(Bool(data=False))
            make_calls(self._ask(self._release))
        elif name == RESUME:
            make_calls(self._ask(self._resume))
        elif name == CLEAR:
            make_calls(self._clear_obstacles())
        elif name == DRAGGED:
            joint = '' if value == OBJECT else value
            mode = 'object' if value == OBJECT else 'joint'
            self._send_parameters(MANIPULATION, {'joint': joint, 'mode': mode})
        elif name == PICK:
            self._goals.send(PICK, squeeze=self._squeeze)
        elif name == PLACE:
            self._goals.send(PLACE)
        elif name == PLANT:
            self._restart.restart_simulator(self._squeeze, value)  # type: ignore[arg-type]
        elif name == SHAPE:
            self._change_object(value)  # type: ignore[arg-type]
        elif name == RESET:
            self._restart.restart_simulator(self._squeeze)
        else:
            parameter, nodes = SETTINGS[name]
            if name == 'squeeze':
                self._squeeze = value  # type: ignore[assignment]
            if name == 'diameter':
                self.picture.diameter = value  # type: ignore[assignment]
            for node in nodes:
                self._send_parameters(node, {parameter: value})

    def _change_object(self, kind: str) -> None:
        description = OBJECTS[kind]
        self.picture.shape = read_object(description).shape if description else None
        self._restart.change_object(self._squeeze, kind, description)

    def _clear_obstacles(self) -> Calls:
        """Clear all moving obstacles; those that other nodes publish return with a message."""
        yield from self._ask(self._clear)
        self.picture.room.clear_moving()

    def _report_refusal(self, words: str) -> None:
        self.picture.goal_report = words
        if words:
            self.reasons.note('browser', words)

    def _report_goal(self, words: str) -> None:
        self.picture.goal_report = words

    def _ask(self, client: Client) -> Calls:
        """Call a service of `manipulation` until it succeeds or a timeout has passed."""
        end = time.monotonic() + RELEASE_TIMEOUT
        while client.service_is_ready():
            response = yield partial(client.call_async, Trigger.Request())
            if response.success or time.monotonic() > end:
                self.get_logger().info(f'{client.srv_name}: {response.message}')
                return
        self.reasons.note('release', describe_absence('service', client.srv_name, MANIPULATION))

    def _send_parameters(self, node: str, values: dict[str, float | str]) -> None:
        """Set parameters of another node, and log the parameters that it rejects."""
        client = self._restart.setters[node]
        if not client.service_is_ready():
            if node == MANIPULATION:  # the other nodes are optional
                self.reasons.note(node, f'node {node} does not exist: its parameters are not set')
            return

        def report(future: Future) -> None:
            for result in future.result().results:
                if not result.successful:
                    self.get_logger().warning(f'{node}: {result.reason}')

        client.call_async(request_parameters(values)).add_done_callback(report)
