# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Matches of a subscription, by which the middleware tells that publishers came and left."""

from types import SimpleNamespace

from rclpy.event_handler import QoSSubscriptionEventType
from rclpy.node import Node


def follow(node: Node, topic: str, *events: tuple[int, int]) -> None:
    """
    Call a node back with matches of its subscriptions.

    :param node: the node.
    :param topic: of the subscriptions.
    :param events: how many publishers came, and how many left.
    """
    handlers = [
        handler
        for subscription in node.subscriptions
        if subscription.topic_name == f'/{topic}'
        for handler in subscription.event_handlers
        if handler.event_type == QoSSubscriptionEventType.RCL_SUBSCRIPTION_MATCHED
    ]
    assert len(handlers) == 1
    for came, left in events:
        handlers[0].callback(
            SimpleNamespace(total_count_change=came, current_count_change=came - left)
        )
