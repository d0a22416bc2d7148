# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""An action server that executes one goal at a time, in the cycle of a node that never blocks."""

from __future__ import annotations

from collections.abc import Callable
import enum
import time
from typing import Any

from action_msgs.msg import GoalInfo
from isotruss_ros.nodes.framework.subscriptions import subscribe_newest
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node
from rclpy.task import Future

#: Results and their goals are kept this long for clients that request them late [s].
RESULT_TIMEOUT = 60
#: Clients publish here which goal ends with them, from before they send it.
SUPERVISION = 'supervised_goal'


class Ending(enum.Enum):
    """The states of the action in which a goal can end."""

    SUCCEEDED = enum.auto()
    CANCELED = enum.auto()
    ABORTED = enum.auto()


class SingleGoal:
    """
    The active goal, if any; a timer of the node works on it.

    The coroutine of the action only waits for the result: it is resumed when the executor spins
    anyhow, and so takes no time.

    Results that have a stamp get the time at which the goal ends.

    :ivar kind: type of the action.
    :param node: offers the action, until it is destroyed.
    :param kind: type of the action.
    :param name: relative name of the action.
    :param ready: returns whether goals are accepted.
    :param begin: called with a new goal; may end it at once.
    :param cancelled: called when a client cancels the goal; must end it, at once or soon.
    :param preempted: called before `begin` if another goal is active; must end it. Not needed
        where goals are accepted one after the other.
    """

    def __init__(
        self,
        node: Node,
        kind: type,
        name: str,
        ready: Callable[[], bool],
        begin: Callable[[Any], None],
        cancelled: Callable[[], None],
        preempted: Callable[[], None] | None = None,
    ) -> None:
        self.kind = kind
        self._clock = node.get_clock()
        self._ready, self._begin = ready, begin
        self._preempted, self._cancelled = preempted, cancelled
        self._handle: ServerGoalHandle | None = None
        self._ended: dict[bytes, Future] = {}
        ActionServer(
            node,
            kind,
            name,
            self._wait,
            goal_callback=self._decide,
            handle_accepted_callback=self._accept,
            cancel_callback=self._cancel,
            result_timeout=RESULT_TIMEOUT,
        )

    @property
    def active(self) -> bool:
        """Return whether there is a goal."""
        return self._handle is not None

    @property
    def request(self) -> Any:
        """Return the active goal, a message."""
        return self._handle.request

    def publish_feedback(self, feedback: Any) -> None:
        """
        Publish feedback on the active goal.

        :param feedback: message of the action.
        """
        self._handle.publish_feedback(feedback)

    def end(self, ending: Ending, result: Any) -> None:
        """
        End the active goal; the client gets the result as soon as the executor spins again.

        :param ending: state of the action.
        :param result: message of the action.
        """
        if hasattr(result, 'stamp'):
            result.stamp = self._clock.now().to_msg()
        self._ended[_key(self._handle)].set_result((ending, result))
        self._handle = None

    def _decide(self, _goal: Any) -> GoalResponse:
        return GoalResponse.ACCEPT if self._ready() else GoalResponse.REJECT

    def _accept(self, handle: ServerGoalHandle) -> None:
        if self.active:
            self._preempted()
        self._handle = handle
        self._ended[_key(handle)] = Future()
        handle.execute()
        self._begin(handle.request)

    def _cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        if self._handle is None or handle != self._handle:
            return CancelResponse.REJECT
        self._cancelled()
        return CancelResponse.ACCEPT

    async def _wait(self, handle: ServerGoalHandle) -> Any:
        ending, result = await self._ended[_key(handle)]
        del self._ended[_key(handle)]
        if ending is Ending.SUCCEEDED:
            handle.succeed()
        elif ending is Ending.CANCELED:
            handle.canceled()
        else:
            handle.abort()
        return result


class SupervisedGoal(SingleGoal):
    """
    A goal that ends with the client that supervises it, if one does.

    :param node: as for `SingleGoal`.
    :param options: likewise.
    :param callbacks: likewise.
    """

    def __init__(self, node: Node, *options: Any, **callbacks: Any) -> None:
        #: The goal that its client supervised last, and when [s].
        self._supervised = (b'', 0.0)
        # Before the action: who has discovered that has discovered the subscription, too.
        subscribe_newest(node, GoalInfo, SUPERVISION, self._note_client)
        super().__init__(node, *options, **callbacks)

    def has_lost_client(self, timeout: float) -> bool:
        """
        Return whether the client that supervised the active goal has fallen silent.

        :param timeout: longest time between its messages, by the steady clock [s].
        """
        goal, heard = self._supervised
        return self.active and goal == _key(self._handle) and time.monotonic() - heard > timeout

    def _note_client(self, message: GoalInfo) -> None:
        goal = bytes(message.goal_id.uuid)
        if not self.active or goal == _key(self._handle):
            self._supervised = (goal, time.monotonic())


def describe_lost_client(timeout: float) -> str:
    """
    Return in words that the client of a goal has fallen silent.

    :param timeout: longest time between its messages [s].
    """
    return (
        f'the client that supervises the goal has not published on {SUPERVISION} for {timeout} s: '
        'it has ended, or the machine is busy and command_timeout must be longer'
    )


def _key(handle: ServerGoalHandle) -> bytes:
    return bytes(handle.goal_id.uuid)
