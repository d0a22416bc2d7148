# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Subscriptions to the newest message."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from isotruss_ros.nodes.framework.qos import NEWEST
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.subscription import Subscription


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

    def take(message: Any) -> None:
        # rclpy takes one message in every turn, and would stay behind a quick publisher.
        callback(take_waiting([message], subscription, 1 + NEWEST.depth)[-1])

    def warn_of_type(_event: Any) -> None:
        node.get_logger().warning(
            f'{topic} has a publisher of another type than {kind.__name__}: its messages are '
            'not received'
        )

    # No quality of service is incompatible with this one.
    events = SubscriptionEventCallbacks(
        incompatible_type=warn_of_type, use_default_callbacks=False
    )
    subscription = node.create_subscription(kind, topic, take, NEWEST, event_callbacks=events)
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
