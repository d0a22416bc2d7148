# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Subscription to rare messages, which reports if a message may have been lost.

rclpy executes the callback for one queued message at a time; this class takes all queued messages
at once.
"""

from __future__ import annotations

from collections.abc import Callable
import math
import time
from typing import Any, TYPE_CHECKING

from isotruss_ros.nodes.framework.topics import (
    ALL_LATCHED_MESSAGES,
    ALL_MESSAGES,
    RELIABLE,
    take_waiting,
)
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

if TYPE_CHECKING:
    from isotruss_ros.nodes.framework.managed import ManagedNode

#: Longest time between the event that a publisher is matched and the callback of its message [s].
MATCH_DELAY = 1.0
#: Largest number of messages per callback [-]; this number is processed within a millisecond.
MAX_BATCH = 200
#: Largest number of queued messages [-]; Fast DDS drops messages beyond 5000 without an event.
MAX_BACKLOG = 1000


class SparseMessages:
    """
    Subscription that passes on messages and reports that a message may have been lost.

    A publisher that publishes a message and exits at once may have ended before the subscription
    has matched it. Then the message is lost without an error. So a possible loss is reported if a
    publisher ends and no message was received since this publisher was matched.

    With `every`, messages that were latched earlier are received too. For this there are two
    subscriptions: a volatile one, which matches every publisher, and as soon as a publisher
    latches, a transient-local one, which matches only latching publishers. Then the messages of
    the latching publisher are received twice. Lost messages and best-effort publishers, whose
    messages may be lost, are reported.

    :param node: subscribing node; its subscription is reliable.
    :param every: True if every message is required; otherwise only the newest one is required.
    """

    def __init__(
        self,
        node: ManagedNode,
        kind: type,
        topic: str,
        callback: Callable[[list[Any]], None],
        missing: Callable[[str], None],
        every: bool = False,
    ) -> None:
        self._node, self._kind, self._topic = node, kind, topic
        self._callback, self._missing, self._every = callback, missing, every
        #: Number of publishers matched since the last message, and time of the last message [s].
        self._silent, self._received = 0, -math.inf
        self._subscriptions: list[Subscription] = []
        #: Number of messages that each subscription received since its queue was empty.
        self._backlogs = [0, 0]
        if every:
            # The first subscription matches all publishers, so only it needs these events.
            unheard = (
                f'a publisher of {topic} is best-effort, and its messages are not received: it '
                'must publish with the reliability RELIABLE'
            )
            self._subscribe(
                ALL_MESSAGES, matched=self._follow, incompatible_qos=lambda _: missing(unheard)
            )
            self._subscribe_to_latched()
        else:
            self._subscribe(RELIABLE, matched=self._follow)

    def _subscribe(self, profile: QoSProfile, **events: Any) -> None:
        index = len(self._subscriptions)
        if self._every:
            events['message_lost'] = lambda _: self._report_loss()
        events['use_default_callbacks'] = not self._every
        subscription = self._node.create_subscription(
            self._kind,
            self._topic,
            lambda first: self._pass_on(index, [first]),
            profile,
            event_callbacks=SubscriptionEventCallbacks(**events),
        )
        self._subscriptions.append(subscription)
        if self._every:
            self._node.permanent.add(subscription)

    def _subscribe_to_latched(self) -> None:
        """Subscribe to the earlier messages of latching publishers, once."""
        # Discovery lists a publisher before the match.
        publishers = self._node.get_publishers_info_by_topic(self._topic)
        latching = any(
            p.qos_profile.durability == ALL_LATCHED_MESSAGES.durability for p in publishers
        )
        if latching and len(self._subscriptions) == 1:
            self._subscribe(ALL_LATCHED_MESSAGES)

    def _pass_on(self, index: int, taken: list[Any]) -> None:
        """Pass on a message of a subscription and the messages queued behind it."""
        most = MAX_BATCH if self._every else 1 + RELIABLE.depth
        messages = take_waiting(taken, self._subscriptions[index], most)
        if messages:
            self._silent, self._received = 0, time.monotonic()
            self._callback(messages)
        full = len(messages) == MAX_BATCH
        self._backlogs[index] = self._backlogs[index] + MAX_BATCH if full else 0
        if self._backlogs[index] >= MAX_BACKLOG:
            self._backlogs[index] = 0
            self._report_loss()

    def _follow(self, event: Any) -> None:
        """Count a newly matched publisher, or report a publisher that ended without a message."""
        # The executor may call back with the message before the match.
        if time.monotonic() - self._received > MATCH_DELAY:
            self._silent += event.total_count_change
        if event.current_count_change != event.total_count_change:
            for index in range(len(self._subscriptions)):
                self._pass_on(index, [])
            if self._silent > 0:
                self._silent = 0
                self._missing(f'a publisher of {self._topic} left before a message was received')
        if self._every:
            self._subscribe_to_latched()

    def _report_loss(self) -> None:
        self._missing(f'messages of {self._topic} were lost')
