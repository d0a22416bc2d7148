# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Requests to other nodes that buttons of the browser trigger, and reports of their results."""

from __future__ import annotations

from collections.abc import Callable, Generator
from functools import partial
from typing import Any

from isotruss_msgs.action import PickObject, PlaceObject
from isotruss_ros.nodes.conversions.messages import request_parameters
from isotruss_ros.nodes.framework.supervision import describe_absence
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Parameter
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.task import Future

ACTIONS = {'pick': (PickObject, 'pick_object'), 'place': (PlaceObject, 'place_object')}
STAGES = {
    'pick': ('planning', 'approaching', 'closing', 'confirming'),
    'place': ('planning', 'opening', 'backing off', 'confirming'),
}
SIMULATOR, MANIPULATION = 'simulator', 'manipulation'
#: Names of the simulator's parameters that define whether its object is free, and its grip.
IS_FREE, *GRIP = ('object_is_free', 'grip', 'grip_module')
#: Nodes other than the simulator with the parameters `object`, `object_diameter` and `friction`.
OBJECT_NODES = (
    'grasp_analysis',
    MANIPULATION,
    'path_follower',
    'pick_and_place',
    'state_estimator',
)
#: Nodes other than the simulator with the parameter `object`.
OTHER_NODES = (*OBJECT_NODES, 'grasp_planner')

#: Generator that yields service calls and receives their responses.
Calls = Generator[Callable[[], Future], Any, None]


def make_calls(calls: Calls, answer: Any = None) -> None:
    """
    Make the next service call of a sequence; its response triggers the call after it.

    :param answer: response of the previous call; None before the first.
    """
    try:
        call = calls.send(answer)
    except StopIteration:
        return
    call().add_done_callback(lambda future: make_calls(calls, future.result()))


class ObjectGoals:
    """Clients of the actions `pick_object` and `place_object`."""

    def __init__(self, node: Node, report: Callable[[str], None]) -> None:
        self._report = report
        self._clients = {
            name: ActionClient(node, kind, action) for name, (kind, action) in ACTIONS.items()
        }

    def send(self, name: str, **values: float) -> None:
        """Send a goal to pick or place the object."""
        kind, action = ACTIONS[name]
        if self._clients[name].server_is_ready():
            self._report(f'{name}: sent')
            make_calls(self._send(name, kind.Goal(**values)))
        else:
            self._report(f'{name}: {describe_absence("action", action, "pick_and_place")}')

    def _send(self, name: str, goal: Any) -> Calls:
        def note(message: Any) -> None:
            stage, progress = STAGES[name][message.feedback.stage], message.feedback.progress
            self._report(f'{name}: {stage} {100.0 * progress:.0f} %')

        handle = yield partial(self._clients[name].send_goal_async, goal, note)
        if handle.accepted:
            answer = yield handle.get_result_async
            self._report(f'{name}: {answer.result.message}')
        else:
            self._report(f'{name}: rejected while another goal is executed')


class NodeRestart:
    """
    Reconfiguration of the simulator and other nodes by their life-cycle services.

    :ivar setters: client of the service `set_parameters` for the name of each node.
    """

    def __init__(self, node: Node, report: Callable[[str], None]) -> None:
        self._report = report
        self._change, self.setters = (
            {
                name: node.create_client(kind, f'{name}/{service}')
                for name in (SIMULATOR, *OTHER_NODES)
            }
            for kind, service in ((ChangeState, 'change_state'), (SetParameters, 'set_parameters'))
        )
        self._get = node.create_client(GetParameters, f'{SIMULATOR}/get_parameters')
        self._calls = self._restart('', 0.0, [], {})

    def restart_simulator(self, squeeze: float, plant: str = '') -> None:
        """
        Reconfigure the simulator, so that its robot starts again at home.

        A restart in progress is abandoned.

        :param squeeze: value of the parameter `squeeze_force` of `manipulation` after the restart
            [N].
        :param plant: parameter `plant` of the simulator; empty: unchanged.
        """
        name = f'plant {plant}' if plant else 'reset'
        self._begin(name, squeeze, [SIMULATOR], {'plant': plant} if plant else {})

    def change_object(self, squeeze: float, kind: str, description: str) -> None:
        """
        Reconfigure all running nodes for another object, so that the robot starts again at home.

        :param squeeze: value of the parameter `squeeze_force` of `manipulation` after the restart
            [N].
        """
        others = [name for name in OTHER_NODES if self._change[name].service_is_ready()]
        self._begin(f'object {kind}', squeeze, [SIMULATOR, *others], {'object': description})

    def _begin(self, what: str, squeeze: float, names: list[str], values: dict[str, str]) -> None:
        clients = self._change[SIMULATOR], self.setters[SIMULATOR]
        if not all(client.service_is_ready() for client in clients):
            self._report(f'{what}: the node simulator is not running')
            return
        self._calls.close()
        self._report(f'{what}: sent')
        self._calls = self._restart(what, squeeze, names, values)
        make_calls(self._calls)

    def _restart(
        self, what: str, squeeze: float, names: list[str], values: dict[str, str]
    ) -> Calls:
        # These fail if a node is already inactive or unconfigured.
        for name in reversed(names):
            yield self._transition(name, Transition.TRANSITION_DEACTIVATE)
            yield self._transition(name, Transition.TRANSITION_CLEANUP)
        for name in names if values else ():
            answer = yield partial(self.setters[name].call_async, request_parameters(values))
            if not answer.results[0].successful:
                self._report(f'{what} cannot be set: {answer.results[0].reason}')
                return
        for name in names:
            for done, transition in (
                ('configured', Transition.TRANSITION_CONFIGURE),
                ('activated', Transition.TRANSITION_ACTIVATE),
            ):
                answer = yield self._transition(name, transition)
                if not answer.success:
                    self._report(f'{what} cannot be {done}: see the log of {name}')
                    return
        rejected = ''
        if self.setters[MANIPULATION].service_is_ready():
            rejected = yield from self._restore_grip(squeeze)
        self._report(f'{what}: {rejected or "active"}')

    def _restore_grip(self, squeeze: float) -> Generator[Callable[[], Future], Any, str]:
        """Reset the grip of `manipulation`, which a pick may have changed, to the simulator's."""
        names = [IS_FREE, *GRIP]
        answer = yield partial(self._get.call_async, GetParameters.Request(names=names))
        is_free, *grip = answer.values
        request = request_parameters({'squeeze_force': squeeze})
        if not is_free.bool_value:
            request.parameters += [
                Parameter(name=name, value=value) for name, value in zip(GRIP, grip, strict=True)
            ]
        # Changed parameters also acknowledge a slip or loss, as the manipulation requires.
        answer = yield partial(self.setters[MANIPULATION].call_async, request)
        return '; '.join(result.reason for result in answer.results if not result.successful)

    def _transition(self, name: str, which: int) -> Callable[[], Future]:
        request = ChangeState.Request(transition=Transition(id=which))
        return partial(self._change[name].call_async, request)
