"""Take what waits in a subscription's queue at once, rather than one message in every turn."""

from __future__ import annotations

from typing import Any

from rclpy.subscription import Subscription


def with_pending(first: Any, subscription: Subscription, most: int) -> list[Any]:
    """
    Return a message with those that came after it, in order.

    :param first: what the callback of the subscription was called with.
    :param most: of all messages: a flood has no end, and others are to have their turn.
    """
    messages = [first]
    while len(messages) < most:
        taken = subscription.handle.take_message(subscription.msg_type, False)
        if taken is None:
            break
        messages.append(taken[0])
    return messages
