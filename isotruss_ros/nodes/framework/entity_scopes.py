# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Entities of a node that end with one of its states."""

from __future__ import annotations

from rclpy.action import ActionClient, ActionServer
from rclpy.lifecycle import LifecycleNode


class EntityScopes:
    """
    Destroy what was created since a state began; what was there before stays.

    :param node: creates the entities, by the methods of rclpy.
    """

    def __init__(self, node: LifecycleNode) -> None:
        self._node = node
        self._before: dict[str, dict[int, object]] = {}

    def begin(self, state: str) -> None:
        """
        Record what is there before a state begins.

        :param state: its label.
        """
        self._before[state] = {id(entity): entity for entity, _ in self._list()}

    def keep(self, entity: object) -> None:
        """
        Leave an entity there when the present states end.

        :param entity: of the node.
        """
        for before in self._before.values():
            before[id(entity)] = entity

    def end(self, state: str) -> None:
        """
        Destroy what was created since: timers first and publishers last.

        :param state: its label.
        """
        before = self._before.pop(state, None)
        if before is None:
            return
        for entity, destroy in self._list():
            if id(entity) not in before:
                destroy(entity)
        # rclpy keeps a weak reference to everything that ever was in the group: without this, a
        # node that is configured again and again grows.
        references = self._node.default_callback_group.entities
        references -= {reference for reference in references if reference() is None}

    def _list(self) -> list[tuple[object, object]]:
        """Return every entity and the method that destroys it."""
        node = self._node
        actions = [w for w in node.waitables if isinstance(w, ActionServer | ActionClient)]
        return [
            *((timer, node.destroy_timer) for timer in node.timers),
            *((action, lambda action: action.destroy()) for action in actions),
            *((service, node.destroy_service) for service in node.services),
            *((client, node.destroy_client) for client in node.clients),
            *((subscribed, node.destroy_subscription) for subscribed in node.subscriptions),
            *((publisher, node.destroy_lifecycle_publisher) for publisher in node.publishers),
        ]
