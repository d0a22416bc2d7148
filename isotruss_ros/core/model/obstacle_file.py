# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Reading of obstacles from YAML, given as a file or as the text of a parameter.

Each obstacle has a name, the keys of a shape as in object files, and a pose in the robot frame. A
wall is a half plane, see `HalfPlane`.

    post: {shape: disc, diameter: 0.1, pose: [1.3, 0.8, 0]}
    table: {shape: polygon, vertices: [[0, 0], [0.6, 0], [0.6, 0.4], [0, 0.4]], pose: [2, 1, 0.3]}
    south wall: {shape: half_plane, pose: [0, -1.5, 1.5708]}
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from isotruss_ros.core.errors import GraspError, ObjectFileError, quote
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.object_file import make_shape, read_content, SHAPES
from isotruss_ros.core.model.obstacle import HalfPlane, MAX_OBSTACLES, Obstacle

#: Shape classes of obstacles by name.
OBSTACLE_SHAPES: dict[str, type] = {**SHAPES, 'half_plane': HalfPlane}


def read_obstacles(path_or_text: str | Path) -> tuple[Obstacle, ...]:
    """
    Read obstacles at rest from a YAML file or text.

    :param path_or_text: path of a file, or a text that begins with `{`.
    :raises ObjectFileError: the file is missing, is not YAML 1.2, or does not describe obstacles.
        The message names file, obstacle, key and valid range.
    """
    content, source = read_content(path_or_text, 'obstacles')
    if not isinstance(content, Mapping):
        raise ObjectFileError(
            f'{source}: {quote(repr(content))}: must be obstacles by their names, such as '
            'post: {shape: disc, diameter: 0.1, pose: [1, 0, 0]}'
        )
    if len(content) > MAX_OBSTACLES:
        raise ObjectFileError(
            f'{source}: {len(content)} obstacles; must be at most {MAX_OBSTACLES}'
        )
    return tuple(_make_obstacle(name, entry, source) for name, entry in content.items())


def _make_obstacle(name: Any, content: Any, source: str) -> Obstacle:
    """Return the obstacle of a name with keys and values."""
    words = f'{source}: {quote(str(name))}'
    shape = make_shape(content, words, ('pose',), OBSTACLE_SHAPES)
    if 'pose' not in content:
        raise ObjectFileError(f"{words}: key 'pose' (x, y, angle) [m, rad] is missing")
    try:
        return Obstacle(name, ConvexObject(shape, content['pose']))
    except GraspError as error:
        raise ObjectFileError(f'{words}: {error}') from error
