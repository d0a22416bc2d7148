"""The emergency stop: set by a topic, kept, and released by a service only."""

from __future__ import annotations

from collections.abc import Callable

from isotruss_ros.nodes.framework.subscriptions import subscribe_every
from rclpy.node import Node
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

TOPIC = 'emergency_stop'
SERVICE = 'release_emergency_stop'


class EmergencyStop:
    """
    Keep a stop until it is released, in whatever state the node is.

    :param node: subscribes and offers the service, until it is destroyed.
    :param required: returns whether nothing may move before a message was received.
    :param changed: called when `reason` is another one.
    :param service: name of the service that releases the stop.
    """

    def __init__(
        self,
        node: Node,
        required: Callable[[], bool],
        changed: Callable[[], None],
        service: str = SERVICE,
    ) -> None:
        self._required, self._changed = required, changed
        self._service = node.resolve_service_name(service)
        #: Last message of the topic; None before the first.
        self._last: bool | None = None
        self._stopped = self._lost = False
        subscribe_every(node, Bool, TOPIC, self._receive, self._record_loss)
        node.create_service(Trigger, service, self._release)

    @property
    def reason(self) -> str | None:
        """Return why the rollers are stopped; None if they are not."""
        if self._stopped:
            last = 'true' if self._last else 'false'
            return (
                f'stopped by the topic {TOPIC}; its last message is {last}; '
                f'released by the service {self._service} only'
            )
        if self._lost:
            return (
                f'messages of {TOPIC} were lost: one of them may have been true; '
                f'released by the service {self._service} only'
            )
        if self._last is None and self._required():
            return f'no message of {TOPIC} received yet, and require_emergency_stop is set'
        return None

    def _receive(self, messages: list[Bool]) -> None:
        before = self._last, self._stopped
        self._last = messages[-1].data
        self._stopped = self._stopped or any(message.data for message in messages)
        if (self._last, self._stopped) != before:
            self._changed()

    def _record_loss(self) -> None:
        """Stop: a lost message may have been true."""
        if not self._lost:
            self._lost = True
            self._changed()

    def _release(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._last:
            response.success = False
            response.message = f'the last message of {TOPIC} is true; publish false first'
            return response
        response.success = True
        stopped = self._stopped or self._lost
        response.message = 'released' if stopped else 'nothing was stopped'
        self._stopped = self._lost = False
        self._changed()
        return response
