# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Obstacles that a browser places in the room and drags."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core import ConvexObject, Obstacle
from isotruss_ros.viewer.drag import Drag
from isotruss_ros.viewer.requests import MAX_DRAG_DISTANCE, RequestError

#: Diameter of a placed obstacle [m].
DIAMETER = 0.15
#: Largest speed of a dragged obstacle [m/s], the largest roller speed of the presets.
MAX_SPEED = 0.1
#: Longest interval over which a velocity moves an obstacle, so that it stays before its target
#: after a pause or a jump of the clock [s].
MAX_STEP = 0.25
#: Largest number of placed obstacles [-], a choice.
MAX_PLACED = 10


@dataclass
class _PlacedDisc:
    """Obstacle in motion to the place to which it was dragged."""

    place: tuple[float, float]  #: centre [m]
    velocity: tuple[float, float] = (0.0, 0.0)  #: velocity since the last step [m/s]
    drag: Drag | None = None  #: active drag; None without one


class PlacedObstacles:
    """Discs that move to the places to which they are dragged, at most at `MAX_SPEED`."""

    def __init__(self) -> None:
        self._discs: dict[str, _PlacedDisc] = {}
        self._count, self._last = 0, 0.0

    def add(self, place: tuple[float, float]) -> str:
        """
        Add a disc at rest, and return its name.

        :param place: centre (x, y) in the robot frame [m].
        """
        if len(self._discs) >= MAX_PLACED:
            raise RequestError(
                f'add obstacle: {len(self._discs)} obstacles are placed; must be at most '
                f'{MAX_PLACED}'
            )
        self._count += 1
        name = f'placed {self._count}'
        self._discs[name] = _PlacedDisc(place)
        return name

    def drag_to(self, name: str, target: tuple[float, float], now: float) -> None:
        """
        Move a disc to a target; a name that is not known is ignored.

        :param target: centre (x, y) in the robot frame [m].
        :raises RequestError: a pose with this centre would be invalid.
        """
        if not all(abs(coordinate) <= MAX_DRAG_DISTANCE for coordinate in target):  # nor NaN
            raise RequestError(
                f'{name}: target {target}: must be at most {MAX_DRAG_DISTANCE:g} m away'
            )
        disc = self._discs.get(name)
        if disc is not None:
            disc.drag = Drag(target, now)

    def end_drags(self) -> None:
        """Stop all discs where they are."""
        for disc in self._discs.values():
            disc.drag = None

    def clear(self) -> None:
        """Remove all discs."""
        self._discs.clear()

    def find_target(self, name: str) -> tuple[float, float]:
        """Return the target of a disc, or its centre without a drag [m]."""
        disc = self._discs[name]
        return disc.place if disc.drag is None else disc.drag.target

    def advance(self, now: float) -> tuple[Obstacle, ...]:
        """
        Return the obstacles at a time, with the velocities that they have until the next call.

        :param now: time on the clock of the robot, the stamp of the obstacles [s].
        """
        step = min(max(now - self._last, 0.0), MAX_STEP)
        self._last = now
        obstacles = []
        for name, disc in self._discs.items():
            (x, y), (vx, vy) = disc.place, disc.velocity
            disc.place, disc.velocity = (x + step * vx, y + step * vy), (0.0, 0.0)
            if disc.drag is not None:
                disc.velocity = disc.drag.follow(disc.place, MAX_SPEED, now)
            body = ConvexObject.disc(disc.place, DIAMETER)
            obstacles.append(Obstacle(name, body, (*disc.velocity, 0.0), now))
        return tuple(obstacles)
