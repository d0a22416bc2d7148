# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Obstacles that a browser has placed, each with a handle to drag it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from isotruss_ros.viewer.names import MOVED
from isotruss_ros.viewer.placed_obstacles import PlacedObstacles
import viser

#: Radius [m] and colour of the handles.
HANDLE, COLOR = 0.04, (0, 60, 70)


class ObstacleControls:
    """
    Placed obstacles and their handles.

    :ivar placed: the obstacles.
    :param height: height of the handles above the plane of the robot [m].
    :param queue: function that queues a drag, called in the thread of the server with number of
        the browser, `MOVED`, and name of the obstacle, whether the drag begins, and the points at
        which the handle was grabbed and is now.
    """

    def __init__(
        self, scene: viser.SceneApi, height: float, queue: Callable[[int, str, object], None]
    ) -> None:
        self.placed = PlacedObstacles()
        self._scene, self._height, self._queue = scene, height, queue
        self._handles: dict[str, Any] = {}
        self._grip = (0.0, 0.0)

    def add(self, place: tuple[float, float]) -> None:
        """
        Add an obstacle and its handle.

        :param place: centre (x, y) of the obstacle in the robot frame [m].
        """
        name = self.placed.add(place)
        handle = self._scene.add_icosphere(
            f'/obstacle_handles/{name}', HANDLE, color=COLOR, position=(*place, self._height)
        )
        handle.on_drag('left')(partial(self._queue_drag, name))
        self._handles[name] = handle

    def move(
        self,
        name: str,
        begins: bool,
        grabbed: tuple[float, float],
        pointer: tuple[float, float],
        now: float,
    ) -> None:
        """Drag an obstacle so that the point at which its handle was grabbed is at the pointer."""
        if name not in self._handles:  # cleared while it was dragged
            return
        if begins:
            x, y, _ = self._handles[name].position
            self._grip = (x - grabbed[0], y - grabbed[1])
        target = (pointer[0] + self._grip[0], pointer[1] + self._grip[1])
        self.placed.drag_to(name, target, now)

    def clear(self) -> None:
        """Remove all placed obstacles and their handles."""
        self.placed.clear()
        for handle in self._handles.values():
            handle.remove()
        self._handles.clear()

    def update(self, shown: bool) -> None:
        """
        Put the handles at the targets of their obstacles.

        :param shown: whether a browser is in control.
        """
        for name, handle in self._handles.items():
            place = (*self.placed.find_target(name), self._height)
            if tuple(handle.position) != place:
                handle.position = place
            handle.visible = shown

    async def _queue_drag(self, name: str, event: viser.SceneNodeDragEvent) -> None:
        begins = event.phase == 'start'
        drag = (name, begins, event.start_position[:2], event.end_position[:2])
        self._queue(event.client_id, MOVED, drag)
