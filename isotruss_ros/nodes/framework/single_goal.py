# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""An action server that executes one goal at a time, in the cycle of a node that never blocks."""

from __future__ import annotations

from collections.abc import Callable
import enum
import math
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from isotruss_ros.core import IsotrussError
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.supervision import ClientWatch, FEEDBACK_PERIOD
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.task import Future

#: Results and their goals are kept this long for clients that request them late [s].
RESULT_TIMEOUT = 60


class Ending(enum.Enum):
    """The states of the action in which a goal can end, by the methods of rclpy's handle."""

    SUCCEEDED = 'succeed'
    CANCELED = 'canceled'
    ABORTED = 'abort'


#: How a goal ends that came to no fault, by the name of the outcome.
ENDINGS = {'CANCELLED': Ending.CANCELED, 'PREEMPTED': Ending.ABORTED} | dict.fromkeys(
    ('FOUND', 'REACHED', 'SUCCEEDED'), Ending.SUCCEEDED
)


class BusyError(IsotrussError):
    """A node carries out another goal."""


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
    :param read: returns what a goal asks for, before it is accepted; raises IsotrussError for one
        that is unusable, or for which the node is not ready. The active goal goes on then.
    :param refuse: returns the result that tells the client of such an error; None rejects the
        goal, of which the log alone gives the reason.
    :param begin: called with what was read; may end the goal at once.
    :param cancelled: called when a client cancels the goal; must end it, at once or soon.
    :param preempted: called before `begin` if another goal is active; must end it. Not needed
        where `read` refuses goals while one is.
    :param supervised: whether a goal ends with the client that supervises it, if one does.
    """

    def __init__(
        self,
        node: ManagedNode,
        kind: Any,
        name: str,
        read: Callable[[Any], Any],
        refuse: Callable[[IsotrussError], Any],
        begin: Callable[[Any], None],
        cancelled: Callable[[], None],
        preempted: Callable[[], None] | None = None,
        supervised: bool = False,
    ) -> None:
        self.kind = kind
        self._node, self._name, self._begin = node, name, begin
        self._read, self._refuse = read, refuse
        self._preempted, self._cancelled = preempted, cancelled
        #: What was read of a goal that is accepted next, or the result that refuses it.
        self._asked: Any = None
        self._refusal: Any = None
        self._handle: ServerGoalHandle | None = None
        self._ended: dict[bytes, Future] = {}
        self._feedback_time = -math.inf
        # Before the action: who has discovered that has discovered the subscription, too.
        self._client = ClientWatch(node) if supervised else None
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
        return self._client.find_loss(timeout)

    def end(self, ending: Ending, result: Any) -> None:
        """
        End the active goal; the client gets the result as soon as the executor spins again.

        :param ending: state of the action.
        :param result: message of the action.
        """
        self._ended[_key(self._handle)].set_result((ending, self._stamp(result)))
        self._set_active(None)

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

    def _set_active(self, handle: ServerGoalHandle | None) -> None:
        self._handle, self._feedback_time = handle, -math.inf
        if self._client is not None:
            self._client.goal = None if handle is None else _key(handle)

    def _stamp(self, result: Any) -> Any:
        """Return a result with the time at which the goal ends, where it has a stamp."""
        if hasattr(result, 'stamp'):
            result.stamp = self._node.get_clock().now().to_msg()
        return result

    def _decide(self, goal: Any) -> GoalResponse:
        if not self._node.active:
            return GoalResponse.REJECT
        self._refusal = None
        try:
            self._asked = self._read(goal)
        except IsotrussError as error:
            self._node.warn(self._name, f'{self._name}: goal refused: {error}')
            self._refusal = self._refuse(error)
            return GoalResponse.REJECT if self._refusal is None else GoalResponse.ACCEPT
        return GoalResponse.ACCEPT

    def _accept(self, handle: ServerGoalHandle) -> None:
        ended = self._ended[_key(handle)] = Future()
        if self._refusal is not None:
            ended.set_result((Ending.ABORTED, self._stamp(self._refusal)))
            handle.execute()
            return
        if self.active:
            self._preempted()
        self._set_active(handle)
        handle.execute()
        self._begin(self._asked)

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


def _key(handle: ServerGoalHandle) -> bytes:
    return bytes(handle.goal_id.uuid)
