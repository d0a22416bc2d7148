"""
Subscriptions to the newest message, to every message, and to what was published before.

rclpy takes one message of a queue in every turn of the executor; these take what is there at once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from isotruss_ros.nodes.framework.qos import EVERY, LATCHED, NEWEST
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile
from rclpy.subscription import Subscription

#: `subscribe_every` takes so many messages at once, within a millisecond; others get their turn.
MAX_BATCH = 200


def subscribe_newest(node: Node, kind: type, topic: str, callback: Callable[[Any], None]) -> None:
    """
    Call back with the newest message of a topic; older ones that wait are dropped.

    A queue for one message would do the same, but while its only message is being taken the next
    one has no room, and Fast DDS then loses the memory of that (some 100 bytes for each message of
    a flood).

    :param node: subscribes, best-effort.
    :param kind: type of the messages.
    :param topic: relative name of the topic.
    :param callback: called with a message, as the node's other callbacks are.
    """

    def take(message: Any) -> None:
        callback(_take_waiting(message, subscription, 1 + NEWEST.depth)[-1])

    def warn_of_type(_event: Any) -> None:
        node.get_logger().warning(
            f'{topic} has a publisher of another type than {kind.__name__}: its messages are '
            'not received'
        )

    # No quality of service is incompatible with this one. Every event that is waited for costs the
    # executor some microseconds in every cycle.
    events = SubscriptionEventCallbacks(
        incompatible_type=warn_of_type, use_default_callbacks=False
    )
    subscription = node.create_subscription(kind, topic, take, NEWEST, event_callbacks=events)


def subscribe_latched(node: Node, kind: type, topic: str, callback: Callable[[Any], None]) -> None:
    """
    Call back with the messages of every publisher, latched ones from before included.

    A subscription with transient-local durability never matches a volatile publisher, such as
    `ros2 topic pub` without options: a stop would not be received. So there are two subscriptions,
    and a message of a latching publisher is received twice.

    :param node: subscribes twice.
    :param kind: type of the messages.
    :param topic: relative name of the topic.
    :param callback: called with each message.
    """
    # One of the two not matching is as it should be: no warnings.
    quiet = SubscriptionEventCallbacks(use_default_callbacks=False)
    for profile in LATCHED:
        node.create_subscription(kind, topic, callback, profile, event_callbacks=quiet)


def subscribe_every(
    node: Node,
    kind: type,
    topic: str,
    callback: Callable[[list[Any]], None],
    lost: Callable[[], None],
) -> None:
    """
    Call back with every message of every publisher, or report that some were lost.

    :param node: subscribes twice, for the same reason as in `subscribe_latched`.
    :param kind: type of the messages.
    :param topic: relative name of the topic.
    :param callback: called with one or more messages, in the order in which they were received.
    :param lost: called when messages were lost, or may have been.
    """
    for profile in EVERY:
        _Queue(node, kind, topic, profile, callback, lost)


class _Queue:
    """One of the two subscriptions of `subscribe_every`; the node keeps it alive."""

    def __init__(
        self,
        node: Node,
        kind: type,
        topic: str,
        profile: QoSProfile,
        callback: Callable[[list[Any]], None],
        lost: Callable[[], None],
    ) -> None:
        self._callback, self._lost = callback, lost
        # A bounded queue that is full drops its oldest messages and raises no event.
        bounded = profile.history == HistoryPolicy.KEEP_LAST
        self._depth = profile.depth if bounded else None
        self._backlog = 0
        events = SubscriptionEventCallbacks(
            message_lost=lambda _: lost(), use_default_callbacks=False
        )
        self._subscription = node.create_subscription(
            kind, topic, self._take, profile, event_callbacks=events
        )

    def _take(self, first: Any) -> None:
        messages = _take_waiting(first, self._subscription, MAX_BATCH)
        self._callback(messages)
        # So many were received since the queue was empty: perhaps too many for it.
        self._backlog = self._backlog + MAX_BATCH if len(messages) == MAX_BATCH else 0
        if self._depth is not None and self._backlog >= self._depth:
            self._backlog = 0
            self._lost()


def _take_waiting(first: Any, subscription: Subscription, most: int) -> list[Any]:
    """
    Return a message with those that wait behind it, in order.

    :param first: the message with which the subscription called back.
    :param most: number of messages to return; a flood has no end.
    """
    messages = [first]
    while len(messages) < most:
        taken = subscription.handle.take_message(subscription.msg_type, False)
        if taken is None:
            break
        messages.append(taken[0])
    return messages
