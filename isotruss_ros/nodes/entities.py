"""Which of a node's publishers, subscriptions, … were made in which of its states."""

from __future__ import annotations

from rclpy.action import ActionClient, ActionServer
from rclpy.lifecycle import LifecycleNode


class Entities:
    """
    Destroys what was made since a state began; what was there before stays.

    :param node: makes the entities, by the means of rclpy.
    """

    def __init__(self, node: LifecycleNode) -> None:
        self._node = node
        self._before: dict[str, dict[int, object]] = {}

    def begin(self, state: str) -> None:
        """Note what is there before a state begins."""
        self._before[state] = {id(entity): entity for entity, _ in self._all()}

    def end(self, state: str) -> None:
        """Destroy what was made since, what runs by itself first and publishers last."""
        before = self._before.pop(state, None)
        if before is None:
            return
        for entity, destroy in self._all():
            if id(entity) not in before:
                destroy(entity)
        # rclpy keeps a weak reference to everything that ever was in the group: without this, a
        # node that is configured anew again and again grows.
        known = self._node.default_callback_group.entities
        known -= {reference for reference in known if reference() is None}

    def _all(self) -> list[tuple[object, object]]:
        """Return every entity and how it is destroyed."""
        node = self._node
        actions = [w for w in node.waitables if isinstance(w, ActionServer | ActionClient)]
        return [
            *((timer, node.destroy_timer) for timer in node.timers),
            *((action, lambda action: action.destroy()) for action in actions),
            *((service, node.destroy_service) for service in node.services),
            *((client, node.destroy_client) for client in node.clients),
            *((heard, node.destroy_subscription) for heard in node.subscriptions),
            *((publisher, node.destroy_lifecycle_publisher) for publisher in node.publishers),
        ]
