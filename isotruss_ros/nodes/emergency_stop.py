"""The emergency stop: heard on a topic, kept, and released by a service only."""

from __future__ import annotations

from collections.abc import Callable

from isotruss_ros.nodes.every_message import subscribe_every
from rclpy.node import Node
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

TOPIC = 'emergency_stop'
SERVICE = 'release_emergency_stop'


class EmergencyStop:
    """
    Keeps a stop until it is released, in whatever state the node is.

    :ivar reason: why the rollers stand still; None if they need not.
    :param node: listens and answers, from now until it is destroyed.
    :param required: tells whether nothing moves before the topic has been heard.
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
        #: What the topic said last; None before the first message.
        self._said: bool | None = None
        self._kept = self._missed = False
        subscribe_every(node, Bool, TOPIC, self._take, self._miss)
        node.create_service(Trigger, service, self._release)

    @property
    def reason(self) -> str | None:
        """Return why the rollers stand still."""
        if self._kept:
            still = 'it still says true' if self._said else 'it says false again'
            return (
                f'stopped by the topic {TOPIC}; {still}; '
                f'released by the service {self._service} only'
            )
        if self._missed:
            return (
                f'messages of {TOPIC} were lost: one of them may have said true; '
                f'released by the service {self._service} only'
            )
        if self._said is None and self._required():
            return f'the topic {TOPIC} has not been heard yet, and require_emergency_stop is set'
        return None

    def _take(self, messages: list[Bool]) -> None:
        before = self._said, self._kept
        self._said = messages[-1].data
        self._kept = self._kept or any(message.data for message in messages)
        if (self._said, self._kept) != before:
            self._changed()

    def _miss(self) -> None:
        """Stop on doubt."""
        if not self._missed:
            self._missed = True
            self._changed()

    def _release(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._said:
            response.success = False
            response.message = f'the topic {TOPIC} still says true; let it say false first'
            return response
        response.success = True
        stopped = self._kept or self._missed
        response.message = 'released' if stopped else 'nothing was stopped'
        self._kept = self._missed = False
        self._changed()
        return response
