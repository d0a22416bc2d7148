# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a control cycle reads itself: subscriptions that wake no executor, and simulated time."""

from __future__ import annotations

from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.subscription import Subscription


class PolledGroup(CallbackGroup):
    """
    Subscriptions whose messages wait until `take` is called.

    A wait of rclpy's executor costs a multiple of what reading a message does.
    """

    def take(self) -> None:
        """Call back with the messages that wait."""
        for subscription in self._subscriptions():
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if taken is not None:
                subscription.callback(taken[0])

    def can_execute(self, entity: Any) -> bool:
        """
        Return whether the executor waits for an entity: for events, but for no messages.

        :param entity: of the group.
        """
        return not isinstance(entity, Subscription)

    def beginning_execution(self, entity: Any) -> bool:
        """
        Return whether a callback may begin.

        :param entity: of the group.
        """
        return True

    def ending_execution(self, entity: Any) -> None:
        """
        Do nothing: callbacks of the group do not exclude each other.

        :param entity: of the group.
        """

    def _subscriptions(self) -> list[Subscription]:
        entities = (reference() for reference in self.entities)
        return [entity for entity in entities if isinstance(entity, Subscription)]


def read_clock(node: Node) -> None:
    """
    Set the node's clock to the simulated time that waits, if any.

    Inputs that were just read may have later stamps than the last time that the executor took.

    :param node: whose clock it is; nothing happens where it goes by the system's time.
    """
    subscription = node._time_source._clock_sub
    if subscription is None:
        return
    taken = subscription.handle.take_message(subscription.msg_type, False)
    if taken is not None:
        subscription.callback(taken[0])
