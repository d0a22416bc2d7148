"""The emergency stop: heard on a topic, kept, and released by a service only."""

from __future__ import annotations

from collections.abc import Callable

from isotruss_ros.nodes.qos import subscribe_latched
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
        self._kept = False
        subscribe_latched(node, Bool, TOPIC, self._take)
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
        if self._said is None and self._required():
            return f'the topic {TOPIC} has not been heard yet, and require_emergency_stop is set'
        return None

    def _take(self, message: Bool) -> None:
        before = self._said, self._kept
        self._said = message.data
        self._kept = self._kept or message.data
        if (self._said, self._kept) != before:
            self._changed()

    def _release(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._said:
            response.success = False
            response.message = f'the topic {TOPIC} still says true; let it say false first'
            return response
        response.success = True
        response.message = 'released' if self._kept else 'nothing was stopped'
        self._kept = False
        self._changed()
        return response
