"""Hear every message of a topic, whoever publishes it, or that some were lost."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from isotruss_ros.nodes.pending import with_pending
from isotruss_ros.nodes.qos import EVERY
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile

#: So many are taken at once, within a millisecond; a flood waits while others have their turn.
AT_ONCE = 200


def subscribe_every(
    node: Node,
    kind: type,
    topic: str,
    take: Callable[[list[Any]], None],
    lost: Callable[[], None],
) -> None:
    """
    Hear all that any publisher of a topic says, and from those that latch what they said before.

    :param node: subscribes twice, for the same reason as `subscribe_latched` does.
    :param kind: of the messages.
    :param take: gets one or more messages, in the order in which they came.
    :param lost: called when messages were lost, or may have been.
    """
    for profile in EVERY:
        _Queue(node, kind, topic, profile, take, lost)


class _Queue:
    """One of the two subscriptions; the node keeps it."""

    def __init__(
        self,
        node: Node,
        kind: type,
        topic: str,
        profile: QoSProfile,
        take: Callable[[list[Any]], None],
        lost: Callable[[], None],
    ) -> None:
        self._take, self._lost = take, lost
        # Where only so many are kept, the oldest make room for new ones, and nobody says so.
        bounded = profile.history == HistoryPolicy.KEEP_LAST
        self._room = profile.depth if bounded else None
        self._waited = 0
        events = SubscriptionEventCallbacks(
            message_lost=lambda _: lost(), use_default_callbacks=False
        )
        self._subscription = node.create_subscription(
            kind, topic, self._drain, profile, event_callbacks=events
        )

    def _drain(self, first: Any) -> None:
        """Take what waits, within bounds."""
        messages = with_pending(first, self._subscription, AT_ONCE)
        self._take(messages)
        # So many came since the queue was empty: there were too many for it, perhaps.
        self._waited = self._waited + AT_ONCE if len(messages) == AT_ONCE else 0
        if self._room is not None and self._waited >= self._room:
            self._waited = 0
            self._lost()
