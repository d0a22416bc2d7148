# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Clients of actions and services as generators; a node resumes them once in each tick.

A sequence of such steps does not block. To cancel a sequence, the node throws `CancelledError`
into the generator; then the current step ends its goal before it passes on the error.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import suppress
import enum
from itertools import islice
from typing import Any
from uuid import uuid4

from action_msgs.msg import GoalInfo, GoalStatus
from isotruss_ros.core import IsotrussError
from isotruss_ros.nodes.conversions.messages import request_parameters
from isotruss_ros.nodes.framework.supervision import describe_absence, ServerWatch
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.client import Client
from rclpy.node import Node
from rclpy.task import Future

#: Period of the ticks of a sequence [s].
TICK_PERIOD = 0.02
#: Number of ticks after which a request without response is repeated [-]. rmw_fastrtps sends no
#: response if the server has not discovered the client within 0.1 s, for example at the start on a
#: busy machine.
RETRY_TICKS = 50
#: Longest wait for the end of a cancelled goal [ticks].
CANCEL_TICKS = 100

#: Generator that yields the progress of the current stage, 0 to 1, and returns a result.
Steps = Generator[float, None, Any]


class StepOutcome(enum.IntEnum):
    """Outcome codes of a sequence, equal to those of PickObject, PlaceObject and MoveObject."""

    SUCCEEDED = 0
    CANCELLED = 1
    BAD_GOAL = 2
    NOT_READY = 3
    NO_MOTION_FOUND = 4
    STOPPED = 5
    #: The object is not held after PickObject or MoveObject, or still held after PlaceObject.
    NOT_HELD = 6


class CancelledError(IsotrussError):
    """Error that is thrown into the generator of a sequence if a client cancels the goal."""


class StepError(IsotrussError, RuntimeError):
    """Error: a sequence cannot continue."""

    def __init__(self, outcome: StepOutcome, message: str, **details: Any) -> None:
        super().__init__(message)
        self.outcome, self.details = outcome, details


class ActionStep:
    """
    Action of another node, used as a step of a sequence.

    DDS takes seconds to detect that a server was restarted during a goal. So the result is
    requested repeatedly: a restarted server does not know the goal and rejects the request. A
    server that sends no feedback for some time counts as lost.

    :param beat: function that publishes this client's heartbeat for a goal; called in each tick.
    :param silence: function that returns the longest accepted time without feedback [s].
    """

    def __init__(
        self,
        node: Node,
        kind: type,
        name: str,
        beat: Callable[[GoalInfo], None],
        silence: Callable[[], float],
    ) -> None:
        self._client, self._name = ActionClient(node, kind, name), name
        self._beat, self._silence = beat, silence

    def run(
        self,
        goal: Any,
        progress: Callable[[Any], float] = lambda feedback: feedback.progress,
        find_fault: Callable[[], StepError | None] = lambda: None,
    ) -> Steps:
        """
        Send a goal and return its result; cancel the goal if the sequence ends.

        :param find_fault: function that is called in each tick and returns an error for which the
            goal must be cancelled, or None.
        """
        # A goal is executed even if its response is lost, so it must not be sent twice. To test
        # the connection, the result of a nonexistent goal is requested first (not of this goal: a
        # late response would end its feedback).
        info = GoalInfo()
        info.goal_id.uuid = list(uuid4().bytes)
        yield from ask(
            unknown_goal(self._client).get_result_async,
            lambda: self._supervise(info, StepOutcome.NOT_READY),
        )
        made, server = 0.0, ServerWatch(self._name, self._silence())

        def note(message: Any) -> None:
            nonlocal made
            made = progress(message.feedback)
            server.note()

        def check() -> float:
            fault = find_fault()
            if fault is None and (loss := server.find_loss()) is not None:
                raise StepError(StepOutcome.STOPPED, loss)
            if fault is not None:
                raise CancelledError from fault
            return made

        sent = self._client.send_goal_async(goal, note, info.goal_id)
        try:
            return (yield from self._await_result(sent, info, check))
        except CancelledError as cancelled:
            sent.add_done_callback(_cancel_goal)  # at once where it is answered already
            with suppress(StepError, CancelledError):
                yield from islice(self._await_result(sent, info, lambda: made), CANCEL_TICKS)
            raise cancelled.__cause__ or cancelled from None
        except (GeneratorExit, StepError):
            sent.add_done_callback(_cancel_goal)
            raise

    def _await_result(self, sent: Future, info: GoalInfo, progress: Callable[[], float]) -> Steps:
        """Wait for the result of a sent goal, and return the result."""

        def supervise() -> None:
            self._supervise(info, StepOutcome.STOPPED)

        for _ in range(RETRY_TICKS):
            if sent.done():
                break
            supervise()
            yield progress()
        wanted = ClientGoalHandle(self._client, info.goal_id, None)
        ended = yield from ask(wanted.get_result_async, supervise, progress)
        if ended.status != GoalStatus.STATUS_UNKNOWN:
            return ended.result
        if sent.done() and not sent.result().accepted:
            raise StepError(
                StepOutcome.NOT_READY,
                f'the action {self._name} rejected the goal: its node must be active',
            )
        raise StepError(
            StepOutcome.STOPPED,
            f'the node that offers the action {self._name} was restarted and has lost the goal',
        )

    def _supervise(self, info: GoalInfo, missing: StepOutcome) -> None:
        """Publish this client's heartbeat if the server supervises its clients."""
        if not self._client.server_is_ready():
            raise StepError(missing, describe_absence('action', self._name, 'its node'))
        self._beat(info)


def unknown_goal(client: ActionClient) -> ClientGoalHandle:
    """Return a goal that no server knows; the response to a request about it is harmless."""
    return ClientGoalHandle(client, GoalInfo().goal_id, None)


def _cancel_goal(sent: Any) -> None:
    handle = sent.result()
    if handle.accepted:
        handle.cancel_goal_async()


def ask(
    send: Callable[[], Future],
    require_server: Callable[[], None],
    progress: Callable[[], float] = lambda: 0.0,
) -> Steps:
    """Repeat a request until a response arrives, and return the response."""
    sent: list[Future] = []
    while True:
        require_server()
        sent.append(send())
        for _ in range(RETRY_TICKS):
            for future in sent:
                if future.done():
                    return future.result()
            require_server()
            yield progress()


def set_parameters(client: Client, values: dict[str, float | str]) -> Steps:
    """Set parameters of another node, as a step of a sequence."""

    def require_service() -> None:
        if not client.service_is_ready():
            raise StepError(
                StepOutcome.NOT_READY,
                describe_absence('service', client.srv_name, 'its node'),
            )

    request = request_parameters(values)
    answer = yield from ask(lambda: client.call_async(request), require_service)
    for name, result in zip(values, answer.results, strict=True):
        if not result.successful:
            raise StepError(StepOutcome.NOT_READY, f'{client.srv_name}: {name}: {result.reason}')
    return None
