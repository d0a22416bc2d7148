# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""An action server that executes one goal at a time, in the cycle of a node that never blocks."""

from __future__ import annotations

from collections.abc import Callable
import enum
import math
import time
from typing import Any

from action_msgs.msg import GoalInfo
from diagnostic_msgs.msg import DiagnosticStatus
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.topics import subscribe_newest
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.task import Future

#: Results and their goals are kept this long for clients that request them late [s].
RESULT_TIMEOUT = 60
#: Feedback is published at most this often [s].
FEEDBACK_PERIOD = 0.1
#: Clients publish here which goal ends with them, from before they send it.
SUPERVISION = 'supervised_goal'


class Ending(enum.Enum):
    """The states of the action in which a goal can end, by the methods of rclpy's handle."""

    SUCCEEDED = 'succeed'
    CANCELED = 'canceled'
    ABORTED = 'abort'


#: How a goal ends that came to no fault, by the name of the outcome.
ENDINGS = {'CANCELLED': Ending.CANCELED, 'PREEMPTED': Ending.ABORTED} | dict.fromkeys(
    ('FOUND', 'REACHED', 'SUCCEEDED'), Ending.SUCCEEDED
)


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
    :param begin: called with a new goal; may end it at once.
    :param cancelled: called when a client cancels the goal; must end it, at once or soon.
    :param ready: returns whether goals are accepted while the node is active; ever if left out.
    :param preempted: called before `begin` if another goal is active; must end it. Not needed
        where goals are accepted one after the other.
    :param supervised: whether a goal ends with the client that supervises it, if one does.
    """

    def __init__(
        self,
        node: ManagedNode,
        kind: type,
        name: str,
        begin: Callable[[Any], None],
        cancelled: Callable[[], None],
        ready: Callable[[], bool] = lambda: True,
        preempted: Callable[[], None] | None = None,
        supervised: bool = False,
    ) -> None:
        self.kind = kind
        self._node, self._ready, self._begin = node, ready, begin
        self._preempted, self._cancelled = preempted, cancelled
        self._handle: ServerGoalHandle | None = None
        self._ended: dict[bytes, Future] = {}
        self._feedback_time = -math.inf
        #: The goal that its client supervised last, and when [s].
        self._supervised = (b'', 0.0)
        if supervised:
            # Before the action: who has discovered that has discovered the subscription, too.
            subscribe_newest(node, GoalInfo, SUPERVISION, self._note_client)
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

    def publish_feedback(self, make: Callable[[], Any]) -> None:
        """
        Publish feedback on the active goal, unless it is too soon.

        :param make: returns the message of the action.
        """
        if time.monotonic() - self._feedback_time >= FEEDBACK_PERIOD:
            self._feedback_time = time.monotonic()
            self._handle.publish_feedback(make())

    def find_loss(self, timeout: float) -> str | None:
        """
        Return in words that the client that supervised the active goal has fallen silent.

        :param timeout: longest time between its messages, by the steady clock [s].
        :return: None if it has not.
        """
        goal, heard = self._supervised
        alive = (
            not self.active or goal != _key(self._handle) or time.monotonic() - heard <= timeout
        )
        if alive:
            return None
        return (
            f'the client that supervises the goal has not published on {SUPERVISION} for '
            f'{timeout} s: it has ended, or the machine is busy and command_timeout must be longer'
        )

    def end(self, ending: Ending, result: Any) -> None:
        """
        End the active goal; the client gets the result as soon as the executor spins again.

        :param ending: state of the action.
        :param result: message of the action.
        """
        if hasattr(result, 'stamp'):
            result.stamp = self._node.get_clock().now().to_msg()
        self._ended[_key(self._handle)].set_result((ending, result))
        self._handle = None

    def report_end(self, outcome: enum.Enum, result: Any, idle: str, prefix: str = '') -> None:
        """
        End the active goal, and report how in the diagnostics and the log.

        :param outcome: why it ends.
        :param result: message of the action, which says why.
        :param idle: what the node does from now on.
        :param prefix: of what is reported.
        """
        self.end(ENDINGS.get(outcome.name, Ending.ABORTED), result)
        text = f'{prefix}{outcome.name.lower().replace("_", " ")}: {result.message}'
        good, logger = outcome.name in ENDINGS, self._node.get_logger()
        level = DiagnosticStatus.OK if good else DiagnosticStatus.WARN
        self._node.diagnostics.set_status(level, f'{idle}; last goal {text}')
        if good:
            logger.info(text)
        else:
            logger.warning(text)

    def _decide(self, _goal: Any) -> GoalResponse:
        accepted = self._node.active and self._ready()
        return GoalResponse.ACCEPT if accepted else GoalResponse.REJECT

    def _accept(self, handle: ServerGoalHandle) -> None:
        if self.active:
            self._preempted()
        self._handle, self._feedback_time = handle, -math.inf
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
        getattr(handle, ending.value)()
        return result

    def _note_client(self, message: GoalInfo) -> None:
        goal = bytes(message.goal_id.uuid)
        if not self.active or goal == _key(self._handle):
            self._supervised = (goal, time.monotonic())


def _key(handle: ServerGoalHandle) -> bytes:
    return bytes(handle.goal_id.uuid)
