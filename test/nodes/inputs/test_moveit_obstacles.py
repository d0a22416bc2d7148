# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Code of the page on obstacles that converts collision objects of MoveIt."""

import math
from pathlib import Path
import re
from types import SimpleNamespace

from geometry_msgs.msg import Point, Pose, Quaternion
from isotruss_ros.nodes.conversions.messages import make_header
from isotruss_ros.nodes.conversions.obstacle_messages import read_obstacles
import numpy as np
import pytest

PAGE = Path(__file__).parents[3] / 'docs' / 'obstacles.md'


@pytest.fixture(scope='module')
def convert():
    """Return the function of the page from a collision object to obstacles."""
    names = {}
    (code,) = re.findall(r'```py\n(.*?)```', PAGE.read_text('utf-8'), re.DOTALL)
    exec(compile(code, PAGE.name, 'exec'), names)
    return lambda **fields: read_obstacles(names['to_obstacles'](collision(**fields)))


def at(x=0.0, y=0.0, angle=0.0):
    """Return a pose in the plane."""
    turn = Quaternion(z=math.sin(0.5 * angle), w=math.cos(0.5 * angle))
    return Pose(position=Point(x=x, y=y), orientation=turn)


def solid(kind, *dimensions):
    """Return a stand-in for shape_msgs/SolidPrimitive."""
    kinds = {'BOX': 1, 'SPHERE': 2, 'CYLINDER': 3, 'CONE': 4}
    return SimpleNamespace(type=kinds[kind], dimensions=dimensions, **kinds)


def collision(solids=(), meshes=(), pose=None, poses=()):
    """Return a stand-in for moveit_msgs/CollisionObject, whose shapes have poses."""
    count = len(solids)
    return SimpleNamespace(
        header=make_header(5.0, 'world'),
        id='table',
        pose=pose or at(),
        primitives=solids,
        primitive_poses=poses[:count],
        meshes=meshes,
        mesh_poses=poses[count:],
    )


def corners(obstacle):
    """Return the vertices of a polygon in the robot frame from the leftmost one, x + iy."""
    points = obstacle.body.outline()
    return np.roll(points, -int(points.real.argmin()))


def test_box_becomes_a_polygon_at_the_pose_of_the_collision_object(convert):
    box, pose, inner = solid('BOX', 0.4, 0.2, 1.0), at(1.0, 2.0, 0.5 * math.pi), at(0.3, 0.0, 0.1)
    (table,) = convert(solids=[box], pose=pose, poses=[inner])
    own = np.array([-0.2 - 0.1j, 0.2 - 0.1j, 0.2 + 0.1j, -0.2 + 0.1j])
    expected = 1.0 + 2.0j + 1j * (0.3 + own * np.exp(0.1j))
    assert corners(table) == pytest.approx(np.roll(expected, -int(expected.real.argmin())))
    assert table.name == 'table 0'


def test_tilted_box_becomes_its_footprint(convert):
    tilted = Pose(orientation=Quaternion(y=math.sin(0.15), w=math.cos(0.15)))
    (table,) = convert(solids=[solid('BOX', 0.4, 0.2, 1.0)], poses=[tilted])
    half = 0.2 * math.cos(0.3) + 0.5 * math.sin(0.3)
    assert np.abs(corners(table).real) == pytest.approx(half)


def test_upright_cylinder_and_sphere_become_discs(convert):
    solids = [solid('CYLINDER', 2.0, 0.1), solid('SPHERE', 0.2)]
    post, ball = convert(solids=solids, pose=at(1.0, 0.0), poses=[at(0.5), at(0.0, 0.7)])
    assert (post.body.shape.diameter, ball.body.shape.diameter) == (0.2, 0.4)
    assert (post.body.center, ball.body.center) == (1.5, 1.0 + 0.7j)


def test_mesh_becomes_the_convex_polygon_around_it(convert):
    vertices = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 3.0), (0.1, 0.9, 1.0)]
    mesh = SimpleNamespace(
        vertices=[Point(x=float(x), y=float(y), z=float(z)) for x, y, z in vertices]
    )
    (table,) = convert(meshes=[mesh], poses=[at(2.0)])
    assert sorted(corners(table), key=lambda p: (p.real, p.imag)) == pytest.approx(
        [2.0, 2.0 + 1.0j, 3.0, 3.0 + 1.0j]
    )


def test_cone_is_refused_with_the_name_of_the_object(convert):
    with pytest.raises(ValueError, match='table: solid of type 4'):
        convert(solids=[solid('CONE', 1.0, 0.2)], poses=[at()])
