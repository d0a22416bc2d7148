# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Goals for `pick_and_place` from buttons: sent, and what becomes of them in words."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from isotruss_msgs.action import PickObject, PlaceObject
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.task import Future

ACTIONS = {'pick': (PickObject, 'pick_object'), 'place': (PlaceObject, 'place_object')}
STAGES = {
    PickObject.Feedback: ('planning', 'approaching', 'closing', 'confirming'),
    PlaceObject.Feedback: ('planning', 'opening', 'backing off', 'confirming'),
}


class ObjectGoals:
    """
    Clients of `pick_object` and `place_object`.

    :param node: has the clients.
    :param report: called with what is under way, in words.
    """

    def __init__(self, node: Node, report: Callable[[str], None]) -> None:
        self._report = report
        self._clients = {
            name: ActionClient(node, kind, action) for name, (kind, action) in ACTIONS.items()
        }

    def send(self, name: str, **values: float) -> None:
        """
        Send a goal.

        :param name: `pick` or `place`.
        :param values: fields of the goal.
        """
        client, (kind, action) = self._clients[name], ACTIONS[name]
        if not client.server_is_ready():
            self._report(f'{name}: no node offers the action {action}')
            return

        def note(message: Any) -> None:
            feedback = message.feedback
            stage = STAGES[type(feedback)][feedback.stage]
            self._report(f'{name}: {stage} {100.0 * feedback.progress:.0f} %')

        def finish(future: Future) -> None:
            self._report(f'{name}: {future.result().result.message}')

        def begin(future: Future) -> None:
            if future.result().accepted:
                future.result().get_result_async().add_done_callback(finish)
            else:
                self._report(f'{name}: rejected while another goal is executed')

        self._report(f'{name}: sent')
        client.send_goal_async(kind.Goal(**values), note).add_done_callback(begin)
