# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Exchange with mujoco-truss-gen: its triangles with a passive node are our tubes with their seams.

Its structures are two dictionaries: nodes by name, (x, y, z) [m], and triangles by name, three
nodes in the order of the tube and the passive one among them. Ours are planar; what it cannot
hold are modules, stiffness and supports of a robot file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.presets import find_robot_file
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.mujoco_plant.options import PlantError
import numpy as np
from ruamel.yaml import YAML

#: Nodes out of their plane by more than this are not planar [m].
PLANAR = 1e-6
#: Height of the plane above the ground, as of its presets [m].
HEIGHT = 0.1
#: Corners of a tube that it can hold.
CORNERS = 3


def to_truss_gen(robot: Robot) -> tuple[dict[str, list[float]], dict[str, list[str]]]:
    """
    Return a robot at home as nodes and triangles of mujoco-truss-gen.

    :param robot: its tubes must be triangles.
    :return: nodes, and triangles: what `get_mujoco_spec` takes.
    :raises PlantError: a tube is no triangle.
    """
    file = robot.description
    nodes = {name: [*map(float, place), HEIGHT] for name, place in file.joints.items()}
    triangles = {}
    for tube in file.tubes:
        if len(tube.joints) != CORNERS:
            raise PlantError(
                f'mujoco-truss-gen: tube {tube.name} has {len(tube.joints)} modules; must be '
                f'{CORNERS}'
            )
        triangles[tube.name] = [*tube.joints, tube.passive]
    return nodes, triangles


def from_truss_gen(
    nodes: Mapping[str, Sequence[float]],
    triangles: Mapping[str, Sequence[str]],
    name: str = 'truss_gen',
    like: str = 'nine_member',
    supports: Mapping[str, Sequence[str]] | None = None,
) -> dict[str, Any]:
    """
    Return the content of a robot file for a planar structure of mujoco-truss-gen.

    :param nodes: (x, y, z) by name [m], all in one plane.
    :param triangles: three nodes and the passive one among them, by name.
    :param name: of the robot.
    :param like: preset or path of the robot file that the rest is taken from.
    :param supports: grounded coordinates by node; where None, the lowest node is held and the
        lowest of the others cannot leave the height that it has.
    :raises PlantError: not planar, or not a structure of triangles.
    """
    places = _in_plane(nodes)
    tubes = {}
    for tube, route in triangles.items():
        corners, passive = list(route[:CORNERS]), list(route[CORNERS:])
        if len(set(corners)) != CORNERS or len(passive) != 1 or passive[0] not in corners:
            raise PlantError(
                f'mujoco-truss-gen: triangle {tube}: {list(route)}: must be three nodes and the '
                'passive one among them'
            )
        missing = [corner for corner in corners if corner not in places]
        if missing:
            raise PlantError(f'mujoco-truss-gen: triangle {tube}: there is no node {missing[0]}')
        tubes[tube] = {'joints': corners, 'passive': passive[0]}
    if supports is None:
        low, other = sorted(places, key=lambda node: (round(places[node][1], 6), places[node][0]))[
            :2
        ]
        supports = {low: ['x', 'y'], other: ['y']}
    content = YAML(typ='safe', pure=True).load(find_robot_file(like).read_text(encoding='utf-8'))
    content |= {
        'name': name,
        'joints': places,
        'tubes': tubes,
        'supports': {node: list(axes) for node, axes in supports.items()},
    }
    return content


def _in_plane(nodes: Mapping[str, Sequence[float]]) -> dict[str, list[float]]:
    """Return (x, y) of each node in the plane of all: x and y where that is level."""
    points = np.array([list(place) for place in nodes.values()], dtype=float)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < CORNERS:
        raise PlantError('mujoco-truss-gen: there must be three nodes or more, with x, y, z each')
    middle = points - points.mean(axis=0)
    normal = np.linalg.svd(middle)[2][-1]
    off = np.abs(middle @ normal).max()
    if not off <= PLANAR:
        raise PlantError(
            f'mujoco-truss-gen: nodes are up to {off:.3g} m out of one plane; robot files hold '
            'planar robots only'
        )
    x, y = _axes(normal)
    return {
        node: [float(point @ x), float(point @ y)]
        for node, point in zip(nodes, points, strict=True)
    }


def _axes(normal: Array) -> tuple[Array, Array]:
    """Return the axes of a plane: x and y where it is level, y upward where it stands."""
    upright = abs(normal[2]) < 0.5
    up = np.array([0.0, 0.0, 1.0]) if upright else np.array([0.0, 1.0, 0.0])
    y = up - (up @ normal) * normal
    y /= np.linalg.norm(y)
    x = np.cross(y, normal)
    return (x if x.sum() > 0.0 else -x), y
