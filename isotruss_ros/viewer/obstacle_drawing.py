# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Drawing of obstacles in the scene: prisms with their names, and parts of walls."""

from __future__ import annotations

from dataclasses import dataclass
import math

from isotruss_ros.core import Obstacle, Pose
from isotruss_ros.core.model.obstacle import HalfPlane
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Points
from isotruss_ros.viewer.meshes import prism
from isotruss_ros.viewer.room import Room
import numpy as np
import viser

#: Colours of obstacles, and of moving obstacles that are in no recent message.
COLOR, SILENT_COLOR = (0, 128, 128), (160, 200, 200)
#: Number of points along the outline of an obstacle of any size [-].
OUTLINE_POINTS = 100
#: Depth and half of the length of the drawn part of a wall [m]; the depth shows on which side the
#: wall is, also to those who have put the robot inside by a wrong sign.
WALL_DEPTH, WALL_LENGTH = 3.0, 3.0


@dataclass
class _Drawn:
    """Nodes of the scene that show an obstacle."""

    shape: Shape
    frame: viser.FrameHandle
    body: viser.MeshHandle
    pose: Pose | None = None
    color: tuple[int, int, int] = COLOR


class ObstacleDrawing:
    """
    Drawing of the obstacles of a room; only changes are sent to browsers.

    :param height: height of the obstacles [m].
    :param center: point x + iy next to which walls are drawn [m].
    """

    def __init__(self, scene: viser.SceneApi, height: float, center: complex) -> None:
        self._scene, self._height, self._center = scene, height, center
        self._drawn: dict[tuple[str, bool], _Drawn] = {}
        self._count = 0

    def update(self, room: Room, now: float) -> None:
        """Draw the current obstacles of a room."""
        # An obstacle at rest and a moving obstacle may have the same name.
        shown = {(o.name, o.stamp is None): (o, fresh) for o, fresh in room.list_obstacles(now)}
        for key in [key for key in self._drawn if key not in shown]:
            self._drawn.pop(key).frame.remove()
        for key, (obstacle, is_fresh) in shown.items():
            drawn = self._drawn.get(key)
            if drawn is None or drawn.shape != obstacle.body.shape:
                if drawn is not None:
                    drawn.frame.remove()
                drawn = self._drawn[key] = self._draw(obstacle)
            if drawn.pose != obstacle.body.pose:
                x, y, angle = drawn.pose = obstacle.body.pose
                drawn.frame.position = (x, y, 0.0)
                drawn.frame.wxyz = (math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle))
            color = COLOR if is_fresh else SILENT_COLOR
            if drawn.color != color:
                drawn.body.color = drawn.color = color

    def _draw(self, obstacle: Obstacle) -> _Drawn:
        """Add an obstacle to the scene, at the origin."""
        # Names of obstacles may have any characters.
        self._count += 1
        path, shape = f'/obstacles/{self._count}', obstacle.body.shape
        outline = self._outline(obstacle)
        vertices, faces = prism(outline, self._height)
        frame = self._scene.add_frame(path, show_axes=False)
        body = self._scene.add_mesh_simple(
            f'{path}/body', vertices.astype(np.float32), faces, color=COLOR, side='double'
        )
        middle = complex(outline.mean())
        if isinstance(shape, HalfPlane):
            middle = complex(outline.real.max(), middle.imag)
        self._scene.add_label(
            f'{path}/name',
            obstacle.name,
            position=(middle.real, middle.imag, 0.5 * self._height + 0.01),
            anchor='bottom-center',
        )
        return _Drawn(shape, frame, body)

    def _outline(self, obstacle: Obstacle) -> Points:
        """Return the outline (k,) in the obstacle's frame, of a wall next to the centre [m]."""
        shape, (x, y, angle) = obstacle.body.shape, obstacle.body.pose
        if not isinstance(shape, HalfPlane):
            return shape.outline(shape.perimeter / OUTLINE_POINTS)
        turn = complex(math.cos(angle), math.sin(angle))
        foot = ((self._center - complex(x, y)) / turn).imag
        low, high = foot - WALL_LENGTH, foot + WALL_LENGTH
        return np.array([-WALL_DEPTH + 1j * low, 1j * low, 1j * high, -WALL_DEPTH + 1j * high])
