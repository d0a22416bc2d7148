# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A check whether anything waits for a callback; of a node whose entities stay the same."""

from __future__ import annotations

from isotruss_ros.nodes.framework.polling import PolledGroup
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.timer import Timer
from rclpy.waitable import NumberOfEntities

#: What a wait set has beside the events.
KINDS = ('subscription', 'guard_condition', 'timer', 'client', 'service')


class ReadyCheck:
    """
    The entities of a node, collected once; to be replaced when any are made or destroyed.

    :param node: whose entities they are; it has no guard conditions.
    :param cycle: the timer of its cycle, which does not count.
    """

    def __init__(self, node: Node, cycle: Timer) -> None:
        polled = PolledGroup
        self._subscriptions = [
            one for one in node.subscriptions if not isinstance(one.callback_group, polled)
        ]
        self._timers = [timer for timer in node.timers if timer is not cycle]
        self._clients, self._services = list(node.clients), list(node.services)
        self._waitables = list(node.waitables)
        count = NumberOfEntities(
            len(self._subscriptions), 0, len(self._timers), len(self._clients), len(self._services)
        )
        for waitable in self._waitables:
            count += waitable.get_num_entities()
        self._wait_set = rclpy_implementation.WaitSet(
            count.num_subscriptions,
            count.num_guard_conditions,
            count.num_timers,
            count.num_clients,
            count.num_services,
            count.num_events,
            node.context.handle,
        )

    def finds_any(self) -> bool:
        """Return whether anything waits, so that rclpy finds it too."""
        wait_set = self._wait_set
        wait_set.clear_entities()
        for subscription in self._subscriptions:
            wait_set.add_subscription(subscription.handle)
        for timer in self._timers:
            wait_set.add_timer(timer.handle)
        for client in self._clients:
            wait_set.add_client(client.handle)
        for service in self._services:
            wait_set.add_service(service.handle)
        for waitable in self._waitables:
            waitable.add_to_wait_set(wait_set)
        wait_set.wait(0)
        return any(map(wait_set.get_ready_entities, KINDS)) or any(
            waitable.is_ready(wait_set) for waitable in self._waitables
        )
