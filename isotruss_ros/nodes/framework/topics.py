# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Quality of service of the topics, and subscriptions that process the newest message.

States and twists are valid only while they are new. So subscriptions to them are best-effort with
a short queue; they match reliable and best-effort publishers. Publishers of the nodes and the
command subscription of the simulator are reliable, like the controllers of ros2_control. They are
volatile, because an old message would be wrong once its node is inactive.

Messages that are valid until the next message are latched.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from isotruss_ros.nodes.framework.rclpy_handles import take_message
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

#: Profile for the newest messages. The depth is 2, because at depth 1 Fast DDS leaks about 100
#: bytes for each message that arrives while another message is taken.
NEWEST_MESSAGES = QoSProfile(depth=2, reliability=ReliabilityPolicy.BEST_EFFORT)
#: Profile for all messages of a short interval, such as joint states from ten publishers at 100 Hz
#: for a loop at 100 Hz.
RECENT_MESSAGES = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
#: Settings without event callbacks. Event callbacks are not needed, because these subscriptions
#: match any publisher, and a subscriber that does not match a publisher warns itself. With them
#: each wait of `manipulation` would take a third longer, and each of `grasp_analysis` twice.
NO_EVENTS = SubscriptionEventCallbacks(use_default_callbacks=False)
NO_PUBLISHER_EVENTS = PublisherEventCallbacks(use_default_callbacks=False)
RELIABLE = QoSProfile(depth=1)
#: Longest wait until the subscribers acknowledge the last command.
ACKNOWLEDGE_TIME = Duration(seconds=0.5)
#: Profile for bursts of messages, all of which are processed.
EVENTS = QoSProfile(depth=100)
#: Profile for messages that are valid until the next message; late subscribers receive them.
LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: Number of cycles that are published without a subscriber: 5 s at 100 Hz, because on a busy
#: machine the discovery of a running recorder took 3 s.
FIRST_RECORDS = 500
#: Profile for the records of cycles. Its depth is twice that number, so that a late subscriber
#: receives the first records before later ones replace them.
RECORDS = QoSProfile(depth=2 * FIRST_RECORDS, durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: Profile for all messages of all publishers, for `SparseMessages`. It is reliable, because
#: best-effort subscriptions lose messages sent before discovery. Fast DDS stores up to 5000
#: messages; with more, publishers block, or an event reports the loss.
ALL_MESSAGES = QoSProfile(history=HistoryPolicy.KEEP_ALL)
ALL_LATCHED_MESSAGES = QoSProfile(
    history=HistoryPolicy.KEEP_ALL, durability=DurabilityPolicy.TRANSIENT_LOCAL
)


def subscribe_newest(
    node: Node, kind: type, topic: str, callback: Callable[[Any], None], every: bool = False
) -> Subscription:
    """
    Subscribe to the newest messages of a topic.

    :param node: subscribing node; its subscription is best-effort.
    :param every: True if the callback is to receive all queued messages in their order; the oldest
        may be lost if too many arrive at once. If false, it receives only the last message.
    """

    def take(messages: list[tuple[Any, int | None]]) -> None:
        for message, _ in messages if every else messages[-1:]:
            callback(message)

    return subscribe_numbered(node, kind, topic, take, every)


def subscribe_numbered(
    node: Node,
    kind: type,
    topic: str,
    callback: Callable[[list[tuple[Any, int | None]]], None],
    every: bool = False,
) -> Subscription:
    """
    Subscribe to the queued messages of a topic, with the numbers that their publishers gave them.

    :param callback: callback that receives all queued messages in their order, each with its
        number; None if the middleware has no numbers.
    :param every: True for a queue of `RECENT_MESSAGES`; false for `NEWEST_MESSAGES`.
    """
    profile = RECENT_MESSAGES if every else NEWEST_MESSAGES

    def take(message: Any, info: dict[str, Any]) -> None:
        # rclpy takes one message per turn, too slow for fast publishers.
        queued = take_queued(subscription, profile.depth)
        callback([(m, i['publication_sequence_number']) for m, i in ((message, info), *queued)])

    subscription = node.create_subscription(kind, topic, take, profile, event_callbacks=NO_EVENTS)
    return subscription


def take_waiting(taken: list[Any], subscription: Subscription, most: int) -> list[Any]:
    """Return a received message, followed by the messages queued behind it, in their order."""
    queued = take_queued(subscription, most - len(taken))
    return [*taken, *(message for message, _ in queued)]


def take_queued(subscription: Subscription, most: int) -> Iterator[tuple[Any, dict[str, Any]]]:
    """Yield the queued messages of a subscription, each with its information, in their order."""
    for _ in range(most):
        taken = take_message(subscription)
        if taken is None:
            return
        yield taken
