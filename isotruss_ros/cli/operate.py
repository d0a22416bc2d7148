# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Commands `isotruss pick`, `move`, `place`, `release`, `resume` and `clear-obstacles`.

Each command sends one goal to the running node `pick_and_place`, or one service call to the node
`manipulation`. The user does not need the command `ros2`.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
import math
import sys
import time
from typing import Any

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import MoveObject, PickObject, PlaceObject
from isotruss_ros.core import IsotrussError, Pose
from isotruss_ros.nodes.conversions.messages import read_pose, to_pose_message
from isotruss_ros.nodes.framework.command_line import (
    separate_ros_arguments,
    start_ros,
    StartError,
)
from isotruss_ros.nodes.framework.supervision import describe_absence
from isotruss_ros.nodes.framework.topics import LATCHED, NEWEST_MESSAGES
from isotruss_ros.nodes.manipulation.emergency_stop import NAME, RELEASE
from isotruss_ros.nodes.pick_and_place.action_steps import ask, TICK_PERIOD, unknown_goal
from nav_msgs.msg import Path
import rclpy
from rclpy.action import ActionClient
from rclpy.exceptions import InvalidNamespaceException
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

#: Timeout of the discovery of a server [s].
DISCOVERY_TIMEOUT = 5.0
#: Commands that call a service of the node `manipulation`: name, service and help.
SERVICES = (
    ('release', RELEASE, 'release the stop'),
    ('resume', 'resume_grip', 'resume after the object has slipped'),
    ('clear-obstacles', 'clear_obstacles', 'discard all moving obstacles'),
)
#: Longest time in which the release of a stop is tried [s].
RELEASE_TIMEOUT = 2.0
#: Longest wait for a response to a repeated request [s].
RESPONSE_TIMEOUT = 10.0


class SilenceError(IsotrussError):
    """Error: a server does not respond."""


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Send one goal or service call, and print its result.

    :return: 0 on success, 1 on failure, 130 after a signal; Ctrl-C cancels the goal.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        options = _parser().parse_args(separate_ros_arguments(words))
        start_ros(words)
    except StartError as error:
        return _fail(str(error))
    node = None
    try:
        node = rclpy.create_node('isotruss', namespace=options.namespace)
        return options.run(node, options)
    except InvalidNamespaceException as error:
        return _fail(' '.join(str(error).split()))
    except IsotrussError as error:
        return _fail(str(error))
    except (ExternalShutdownException, KeyboardInterrupt, RuntimeError) as error:
        if isinstance(error, RuntimeError) and rclpy.ok():
            raise
        print('interrupted', file=sys.stderr)  # before a goal was sent, or by SIGTERM
        return 130
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='isotruss', description=__doc__)
    kinds = parser.add_subparsers(required=True)
    pick = kinds.add_parser('pick', help='plan a grasp, close the grip, confirm the hold')
    pick.add_argument(
        '--squeeze', type=float, default=15.0, help='normal force of each member [N]'
    )
    pick.set_defaults(run=_pick)
    move = kinds.add_parser('move', help='move the held object straight to a pose')
    move.add_argument('x', type=float, help='x of the target [m]')
    move.add_argument('y', type=float, help='y of the target [m]')
    move.add_argument(
        '--angle', type=float, help='angle of the target [degrees] (default: the present angle)'
    )
    move.set_defaults(run=_move)
    kinds.add_parser('place', help='open the grip and retreat').set_defaults(run=_place)
    for name, service, words in SERVICES:
        kinds.add_parser(name, help=words).set_defaults(run=_call, service=service)
    for kind in kinds.choices.values():
        kind.add_argument('--namespace', default='', help='namespace of the robot, such as /left')
    return parser


def _pick(node: Node, options: argparse.Namespace) -> int:
    return _send(node, PickObject, 'pick_object', PickObject.Goal(squeeze=options.squeeze))


def _move(node: Node, options: argparse.Namespace) -> int:
    angle = _measure_pose(node).angle if options.angle is None else math.radians(options.angle)
    pose = Pose(options.x, options.y, angle)
    path = Path(poses=[PoseStamped(pose=to_pose_message(pose))])
    return _send(node, MoveObject, 'move_object', MoveObject.Goal(path=path))


def _measure_pose(node: Node) -> Pose:
    """Return the next measured pose of the object; raise SilenceError if there is none."""
    received: list[PoseStamped] = []
    node.create_subscription(PoseStamped, 'object_pose', received.append, NEWEST_MESSAGES)
    end = time.monotonic() + DISCOVERY_TIMEOUT
    while not received:
        if time.monotonic() > end:
            topic = node.resolve_topic_name('object_pose')
            raise SilenceError(f'{topic}: no pose in {DISCOVERY_TIMEOUT:g} s; give --angle')
        rclpy.spin_once(node, timeout_sec=TICK_PERIOD)
    return read_pose('object_pose', received[-1].pose)


def _place(node: Node, _options: argparse.Namespace) -> int:
    return _send(node, PlaceObject, 'place_object', PlaceObject.Goal())


def _send(node: Node, kind: Any, name: str, goal: Any) -> int:
    """Send a goal and wait for its result; Ctrl-C cancels the goal."""
    client = ActionClient(node, kind, name)
    if not client.wait_for_server(DISCOVERY_TIMEOUT):
        return _fail_to_find(node, 'action', name, 'pick_and_place')
    # A goal must not be sent twice, so the connection is tested by the result of no goal.
    _ask(node, name, unknown_goal(client).get_result_async)
    handle = _await(node, client.send_goal_async(goal))
    if not handle.accepted:
        return _fail(f'{name} was rejected: pick_and_place must be active, without another goal')
    ended = handle.get_result_async()
    try:
        result = _await(node, ended).result
    except KeyboardInterrupt:
        _await(node, handle.cancel_goal_async())
        print(f'{name}: {_await(node, ended).result.message}')
        return 130
    print(f'{name}: {result.message}{_describe_errors(result)}')
    return 0 if result.code == kind.Result.SUCCEEDED else 1  # type: ignore[attr-defined]


def _describe_errors(result: Any) -> str:
    """Return the errors in a result of a motion as words; empty if it has none."""
    errors = [getattr(result, name, 0.0) for name in ('position_error', 'angle_error')]
    if not any(errors):
        return ''
    return f'; {1e3 * errors[0]:.1f} mm and {math.degrees(errors[1]):.1f}° from the target'


def _call(node: Node, options: argparse.Namespace) -> int:
    """Call a service of the node `manipulation`."""
    client = node.create_client(Trigger, options.service)
    if not client.wait_for_service(DISCOVERY_TIMEOUT):
        return _fail_to_find(node, 'service', options.service, 'manipulation')

    def call() -> Trigger.Response:
        return _ask(node, options.service, lambda: client.call_async(Trigger.Request()))

    answer = call()
    if options.service == RELEASE and not answer.success:
        # The last message of the topic is true, as after a stop in the viewer.
        node.create_publisher(Bool, NAME, LATCHED).publish(Bool(data=False))
        end = time.monotonic() + RELEASE_TIMEOUT
        while not answer.success and time.monotonic() < end:
            answer = call()
    print(f'{options.service}: {answer.message}')
    return 0 if answer.success else 1


def _ask(node: Node, name: str, send: Callable[[], Future]) -> Any:
    """Repeat a request until there is a response, and return it."""
    steps, end = ask(send, lambda: None), time.monotonic() + RESPONSE_TIMEOUT
    while time.monotonic() < end:
        try:
            next(steps)
        except StopIteration as ended:
            return ended.value
        rclpy.spin_once(node, timeout_sec=TICK_PERIOD)
    full_name = node.resolve_topic_name(name)
    raise SilenceError(f'{full_name} has not responded in {RESPONSE_TIMEOUT:g} s')


def _await(node: Node, future: Future) -> Any:
    rclpy.spin_until_future_complete(node, future)
    return future.result()


def _fail_to_find(node: Node, kind: str, name: str, server: str) -> int:
    full_name = node.resolve_topic_name(name)
    return _fail(describe_absence(kind, full_name, server, DISCOVERY_TIMEOUT))


def _fail(why: str) -> int:
    print(f'isotruss: {why}', file=sys.stderr)
    return 1


if __name__ == '__main__':
    sys.exit(main())
