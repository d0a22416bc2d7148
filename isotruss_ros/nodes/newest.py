"""Hear only the newest of what has come on a topic."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from isotruss_ros.nodes.pending import with_pending
from isotruss_ros.nodes.qos import NEWEST
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node


def subscribe_newest(node: Node, kind: type, topic: str, callback: Callable[[Any], None]) -> None:
    """
    Call back with the newest message that is there; older ones that wait are left out.

    A queue for one message would do the same, but while its only message is being taken the next
    one has no room, and Fast DDS then loses the memory of that (some 100 bytes for each message of
    a flood).

    :param node: subscribes, best-effort.
    :param kind: of the messages.
    :param callback: gets a message; called as the node's other callbacks are.
    """

    def take(message: Any) -> None:
        callback(with_pending(message, subscription, 1 + NEWEST.depth)[-1])

    def tell_of_type(_event: Any) -> None:
        node.get_logger().warning(
            f'somebody publishes another type than {kind.__name__} on {topic}: it is not heard'
        )

    # No quality of service is incompatible with this one. Every event that is waited for costs the
    # executor some microseconds in every cycle.
    events = SubscriptionEventCallbacks(
        incompatible_type=tell_of_type, use_default_callbacks=False
    )
    subscription = node.create_subscription(kind, topic, take, NEWEST, event_callbacks=events)
