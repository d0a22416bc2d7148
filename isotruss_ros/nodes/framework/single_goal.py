# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Action server that executes one goal at a time, in the cycle of a node and without blocking."""

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

#: Time for which a result is kept for clients that request it late [s].
RESULT_TIMEOUT = 60


class Ending(enum.Enum):
    """Final states of an action goal; the values are methods of rclpy's goal handle."""

    SUCCEEDED = 'succeed'
    CANCELED = 'canceled'
    ABORTED = 'abort'


#: Final states of goals for the names of some outcomes; the outcome zero is success, all others
#: abort the goal.
ENDINGS = {'CANCELLED': Ending.CANCELED, 'PREEMPTED': Ending.ABORTED}


class BusyError(IsotrussError):
    """Error: the node is executing another goal."""


class SingleGoal:
    """
    Action server with at most one active goal, which the cycle of the node executes.

    The coroutine of the action does nothing but wait for the result. If the result message has a
    stamp, it is set to the time at which the goal ended.

    :ivar client: detector for the loss of the goal's client; None if goals are not supervised.
    :param read: function that checks a goal and converts it before it is accepted. It raises
        IsotrussError if the goal is invalid or the node is not ready; then the active goal
        continues.
    :param refuse: function that converts an error of `read` to a result for the client. If it
        returns None, the goal is rejected, and the reason is only in the log.
    :param begin: callback that receives the converted goal and starts it; it may also end the goal
        at once.
    :param cancelled: callback after a client's cancel; it must end the goal soon.
    :param preempted: callback that ends the active goal before `begin` of another one; not needed
        if `read` refuses a second goal.
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
        #: Converted goal that will be accepted next, or the result with which it will be refused.
        self._asked: Any = None
        self._refusal: Any = None
        self._handle: ServerGoalHandle | None = None
        self._ended: dict[bytes, Future] = {}
        self._feedback_time = -math.inf
        # Before the action: a client that has discovered the action has discovered the
        # subscription.
        self.client = ClientWatch(node) if supervised else None
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
        """Return whether a goal of the action is active."""
        return self._handle is not None

    @property
    def request(self) -> Any:
        """Return the message of the active goal, as the client sent it."""
        return self._handle.request

    def publish_feedback(self, make: Callable[[], Any]) -> None:
        """Publish feedback on the active goal at a limited rate."""
        if time.monotonic() - self._feedback_time >= FEEDBACK_PERIOD:
            self._feedback_time = time.monotonic()
            self._handle.publish_feedback(make())

    def end(self, ending: Ending, result: Any) -> None:
        """End the active goal; the client receives the result when the executor spins next."""
        self._ended[_key(self._handle)].set_result((ending, self._stamp(result)))
        self._set_active(None)

    def report_end(self, outcome: enum.IntEnum, result: Any, prefix: str = '') -> None:
        """End the active goal, and report its result in the diagnostics and the log."""
        good, logger = outcome == 0 or outcome.name in ENDINGS, self._node.get_logger()
        ending = ENDINGS.get(outcome.name, Ending.ABORTED)
        self.end(Ending.SUCCEEDED if outcome == 0 else ending, result)
        text = f'{prefix}{outcome.name.lower().replace("_", " ")}: {result.message}'
        level = DiagnosticStatus.OK if good else DiagnosticStatus.WARN
        self._node.diagnostics.set_status(f'{self._node.idle}; last goal {text}', level)
        if good:
            logger.info(text)
        else:
            logger.warning(text)

    def _set_active(self, handle: ServerGoalHandle | None) -> None:
        self._handle, self._feedback_time = handle, -math.inf
        if self.client is not None:
            self.client.goal = None if handle is None else _key(handle)

    def _stamp(self, result: Any) -> Any:
        """Return a result message, with its stamp (if any) set to the end of the goal."""
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
            self._node.reasons.note(self._name, f'{self._name}: goal refused: {error}')
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
