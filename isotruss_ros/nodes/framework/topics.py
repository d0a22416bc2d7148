# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Quality of service of each topic, and subscriptions to the newest message.

State and twists count only while they are new: subscribers take the newest and request no
retransmission, and so match reliable and best-effort publishers alike. What the nodes publish, and
the commands that the simulator takes, is reliable, as ros2_control's controllers have it. None of
it is kept for late joiners: the next message comes with the next cycle, and an old one would be
wrong once the node is inactive.

What holds until the next message, however late that comes, is latched.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

#: Not 1: while the only message is being taken the next one has no room, and Fast DDS then loses
#: the memory of that, some 100 bytes for each message of a flood.
NEWEST = QoSProfile(depth=2, reliability=ReliabilityPolicy.BEST_EFFORT)
#: For inputs of which each counts, such as joint states that come in parts: what a loop of 100 Hz
#: misses of ten publishers of 100 Hz.
EACH = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
#: With them: such a subscription matches every publisher, so that rclpy's warnings never come, but
#: would make each wait of `manipulation` a third longer.
NO_EVENTS = SubscriptionEventCallbacks(use_default_callbacks=False)
RELIABLE = QoSProfile(depth=1)
#: Subscribers have this long to acknowledge the last command.
ACKNOWLEDGE_TIME = Duration(seconds=0.5)
#: For all of what comes in bursts, with room for what waits.
EVENTS = QoSProfile(depth=100)
#: For what holds until the next message: late joiners receive it.
LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: For `SparseMessages`: all publishers, and what those that latch have published before. Reliable
#: both: what a publisher sends before a best-effort subscription has discovered it is lost. All
#: messages are kept, up to the 5000 of Fast DDS; then the publishers wait, and where they do not,
#: an event reports the loss.
EVERY = QoSProfile(history=HistoryPolicy.KEEP_ALL)
EVERY_LATCHED = QoSProfile(
    history=HistoryPolicy.KEEP_ALL, durability=DurabilityPolicy.TRANSIENT_LOCAL
)


def subscribe_newest(
    node: Node, kind: type, topic: str, callback: Callable[[Any], None]
) -> Subscription:
    """
    Call back with the newest messages of a topic; older ones that wait are dropped.

    :param node: subscribes, best-effort.
    :param kind: type of the messages.
    :param topic: relative name of the topic.
    :param callback: called with a message.
    """

    return _subscribe(node, kind, topic, NEWEST, lambda messages: callback(messages[-1]))


def subscribe_each(
    node: Node, kind: type, topic: str, callback: Callable[[Any], None]
) -> Subscription:
    """
    Call back with each message of a topic, in order; of a flood with the newest ones.

    :param node: subscribes, best-effort.
    :param kind: type of the messages.
    :param topic: relative name of the topic.
    :param callback: called with a message.
    """

    def take(messages: list[Any]) -> None:
        for message in messages:
            callback(message)

    return _subscribe(node, kind, topic, EACH, take)


def _subscribe(
    node: Node, kind: type, topic: str, profile: QoSProfile, callback: Callable[[list[Any]], None]
) -> Subscription:
    """Call back with all messages that wait."""

    def take(message: Any) -> None:
        # rclpy takes one message in every turn, and would stay behind a quick publisher.
        callback(take_waiting([message], subscription, 1 + profile.depth))

    subscription = node.create_subscription(kind, topic, take, profile, event_callbacks=NO_EVENTS)
    return subscription


def take_waiting(taken: list[Any], subscription: Subscription, most: int) -> list[Any]:
    """
    Return messages with those that wait behind them, in order.

    :param taken: the message with which the subscription called back, if it did.
    :param subscription: whose queue is emptied.
    :param most: number of messages to return; a flood has no end.
    """
    messages = list(taken)
    while len(messages) < most:
        taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
        if taken is None:
            break
        messages.append(taken[0])
    return messages
