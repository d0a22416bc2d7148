# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Subscription to rare messages: the newest, or every message of a stop.

rclpy takes one queued message per turn of the executor; this class takes all of them.
"""

from __future__ import annotations

from collections.abc import Callable
import math
import time
from typing import Any, TYPE_CHECKING

from isotruss_ros.nodes.framework.topics import EVERY, EVERY_LATCHED, RELIABLE, take_waiting
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

if TYPE_CHECKING:
    from isotruss_ros.nodes.framework.managed import ManagedNode

#: Longest time between the callbacks of a message and of the match of its publisher [s].
MATCH_DELAY = 1.0
#: Largest number of messages per callback, processed within a millisecond [-].
MAX_BATCH = 200
#: Largest number of queued messages [-]; Fast DDS drops those beyond 5000 without an event.
MAX_BACKLOG = 1000


class SparseMessages:
    """
    Calls back with messages, and reports possible losses.

    A publisher that is discovered, publishes and exits at once may be gone before this side has
    matched it, and its message lost without an error. The departure of such a publisher is
    reported if no message was received since its arrival.

    With `every`, latched earlier messages are received as well, until the node is destroyed; lost
    messages and best-effort publishers are reported. A transient-local subscription does not match
    a volatile publisher, such as `ros2 topic pub` without options. So the first subscription is
    volatile; a second, transient-local one is added for a latching publisher, whose messages are
    then received twice.

    :param node: subscribing node, reliable.
    :param kind: type of the messages.
    :param topic: relative name of the topic.
    :param callback: function of one or more messages, in the order of reception.
    :param missing: callback with the reason of a possible loss.
    :param every: whether every message is required, not only the newest.
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
        #: Publishers matched after the last message.
        self._silent, self._received = 0, -math.inf
        self._subscriptions: list[Subscription] = []
        #: Messages received by each subscription since its queue was empty.
        self._backlogs = [0, 0]
        if every:
            # It matches all publishers of the other one, which needs no such events.
            unheard = (
                f'a publisher of {topic} is best-effort, and its messages are not received: it '
                'must publish with the reliability RELIABLE'
            )
            self._subscribe(
                EVERY, matched=self._follow, incompatible_qos=lambda _: missing(unheard)
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
            self._node.kept.add(subscription)

    def _subscribe_to_latched(self) -> None:
        """Subscribe to earlier messages of latching publishers, once."""
        # Discovery lists a publisher before the match.
        found = self._node.get_publishers_info_by_topic(self._topic)
        latching = any(p.qos_profile.durability == EVERY_LATCHED.durability for p in found)
        if latching and len(self._subscriptions) == 1:
            self._subscribe(EVERY_LATCHED)

    def _pass_on(self, index: int, taken: list[Any]) -> None:
        """Call back with a message of a subscription and the queued ones."""
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
        """Count a new publisher, or report the departure of one."""
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
