# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Subscriptions to what is published seldom: once and now, or every message of a stop.

rclpy takes one message of a queue in every turn of the executor; these take what waits at once.
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
#: `EveryMessage` takes so many messages at once, within a millisecond; others get their turn.
MAX_BATCH = 200
#: So many messages may wait; Fast DDS keeps 5000, and drops more than that without an event.
MAX_BACKLOG = 1000


class NewestMessage:
    """
    Call back with the newest message of what may be published only once, and now.

    Nothing is kept for late joiners. A publisher that is discovered, publishes and exits at once
    may be gone before this side has matched it: then its message is lost, and nothing else tells
    so. That is reported where no message was received since it came.

    :param node: subscribes, reliable.
    :param kind: type of the messages.
    :param topic: relative name of the topic.
    :param callback: called with a message.
    :param missing: called with the reason when a message may have been lost.
    """

    def __init__(
        self,
        node: ManagedNode,
        kind: type,
        topic: str,
        callback: Callable[[Any], None],
        missing: Callable[[str], None],
    ) -> None:
        self._node, self._kind, self._topic = node, kind, topic
        self._callback, self._missing = callback, missing
        #: Publishers that came after the last message.
        self._silent, self._received = 0, -math.inf
        self._subscriptions: list[Subscription] = []
        self._begin()

    def _begin(self) -> None:
        self._subscribe(RELIABLE, matched=self._follow)

    def _subscribe(self, profile: QoSProfile, **events: Any) -> Subscription:
        index = len(self._subscriptions)
        subscription = self._node.create_subscription(
            self._kind,
            self._topic,
            lambda first: self._pass_on(index, [first]),
            profile,
            event_callbacks=SubscriptionEventCallbacks(**events),
        )
        self._subscriptions.append(subscription)
        return subscription

    def _pass_on(self, index: int, taken: list[Any]) -> None:
        """Call back with messages of a subscription and those that wait behind them."""
        messages = take_waiting(taken, self._subscriptions[index], 1 + RELIABLE.depth)
        if messages:
            self._silent, self._received = 0, time.monotonic()
            self._callback(messages[-1])

    def _follow(self, event: Any) -> None:
        """Count a publisher that came, or report one that left."""
        # The executor may call back with a message before it does so with the match.
        if time.monotonic() - self._received > MATCH_DELAY:
            self._silent += event.total_count_change
        if event.current_count_change == event.total_count_change:
            return
        for index in range(len(self._subscriptions)):
            self._pass_on(index, [])
        if self._silent > 0:
            self._silent = 0
            self._missing(f'a publisher of {self._topic} left before a message was received')


class EveryMessage(NewestMessage):
    """
    Call back with every message of every reliable publisher, or report that some may be missing.

    That is a list of one or more messages, in the order in which they were received, also of what
    was published before. Reported are lost messages too, and a publisher that is best-effort.

    A subscription with transient-local durability never matches a volatile publisher, such as
    `ros2 topic pub` without options, which is then told that no messages will be sent. So the
    first subscription is volatile, and there is a second one, for what was published before, once
    there is a latching publisher; from then on its messages are received twice. Both are there
    until the node is destroyed.
    """

    def _begin(self) -> None:
        #: How many each subscription has received since its queue was empty.
        self._backlogs = [0, 0]
        # It matches all publishers that the other one matches, which needs no events of that kind.
        self._subscribe(
            EVERY, incompatible_qos=lambda _: self._report_best_effort(), matched=self._follow
        )
        self._subscribe_to_latched()

    def _subscribe(self, profile: QoSProfile, **events: Any) -> Subscription:
        subscription = super()._subscribe(
            profile,
            message_lost=lambda _: self._report_loss(),
            use_default_callbacks=False,
            **events,
        )
        self._node.keep(subscription)
        return subscription

    def _follow(self, event: Any) -> None:
        super()._follow(event)
        self._subscribe_to_latched()

    def _subscribe_to_latched(self) -> None:
        """Subscribe to what latching publishers hold, if there is one and it was not done yet."""
        # Discovery lists a publisher before it is matched.
        found = self._node.get_publishers_info_by_topic(self._topic)
        latching = any(p.qos_profile.durability == EVERY_LATCHED.durability for p in found)
        if latching and len(self._subscriptions) == 1:
            self._subscribe(EVERY_LATCHED)

    def _pass_on(self, index: int, taken: list[Any]) -> None:
        messages = take_waiting(taken, self._subscriptions[index], MAX_BATCH)
        if messages:
            self._silent, self._received = 0, time.monotonic()
            self._callback(messages)
        full = len(messages) == MAX_BATCH
        self._backlogs[index] = self._backlogs[index] + MAX_BATCH if full else 0
        if self._backlogs[index] >= MAX_BACKLOG:
            self._backlogs[index] = 0
            self._report_loss()

    def _report_loss(self) -> None:
        self._missing(f'messages of {self._topic} were lost')

    def _report_best_effort(self) -> None:
        self._missing(
            f'a publisher of {self._topic} is best-effort, and its messages are not received: it '
            'must publish with the reliability RELIABLE'
        )
