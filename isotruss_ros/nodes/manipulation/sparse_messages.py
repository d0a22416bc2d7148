# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
A subscription to what is published seldom: once and now, or every message of a stop.

rclpy takes one message of a queue in every turn of the executor; this takes what waits at once.
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

#: Between the callbacks with a message and with the match of its publisher, at most [s].
MATCH_DELAY = 1.0
#: So many messages are taken at once, within a millisecond; others get their turn.
MAX_BATCH = 200
#: So many messages may wait; Fast DDS keeps 5000, and drops more than that without an event.
MAX_BACKLOG = 1000


class SparseMessages:
    """
    Call back with messages, or report that some may be missing.

    A publisher that is discovered, publishes and exits at once may be gone before this side has
    matched it: then its message is lost, and nothing else tells so. That is reported where no
    message was received since it came.

    Where every message counts, so do those that were published before, until the node is
    destroyed. Reported are lost messages too, and a publisher that is best-effort. A subscription
    with transient-local durability never matches a volatile publisher, such as `ros2 topic pub`
    without options, which is then told that no messages will be sent. So the first subscription is
    volatile, and there is a second one, for what was published before, once there is a latching
    publisher; from then on its messages are received twice.

    :param node: subscribes, reliable.
    :param kind: type of the messages.
    :param topic: relative name of the topic.
    :param callback: called with one or more messages, in the order in which they were received.
    :param missing: called with the reason when a message may have been lost.
    :param every: whether every message counts, not only the newest that is published now.
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
        #: Publishers that came after the last message.
        self._silent, self._received = 0, -math.inf
        self._subscriptions: list[Subscription] = []
        #: How many each subscription has received since its queue was empty.
        self._backlogs = [0, 0]
        if every:
            # It matches all publishers that the other one matches, which needs no such events.
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
        """Subscribe to what latching publishers hold, if there is one and it was not done yet."""
        # Discovery lists a publisher before it is matched.
        found = self._node.get_publishers_info_by_topic(self._topic)
        latching = any(p.qos_profile.durability == EVERY_LATCHED.durability for p in found)
        if latching and len(self._subscriptions) == 1:
            self._subscribe(EVERY_LATCHED)

    def _pass_on(self, index: int, taken: list[Any]) -> None:
        """Call back with messages of a subscription and those that wait behind them."""
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
        """Count a publisher that came, or report one that left."""
        # The executor may call back with a message before it does so with the match.
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
