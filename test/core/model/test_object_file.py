# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Shapes, robots of the package, objects from YAML, and obstacles."""

from functools import partial
import math

from contracts import check_shape, directions
from held_grips import BOX
from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros import core
from isotruss_ros.core import (
    ConvexObject,
    Disc,
    Ellipse,
    Obstacle,
    Polygon,
    Pose,
    read_object,
    read_obstacles,
    ShapeGuard,
)
from isotruss_ros.core.errors import GraspError, ObjectFileError
from isotruss_ros.core.model.convex_object import segment_gaps
from isotruss_ros.core.model.obstacle import HalfPlane
from isotruss_ros.core.model.presets import preset_names
from isotruss_ros.core.model.scaled_shape import ScaledShape
from isotruss_ros.core.model.separation import separate
from isotruss_ros.core.model.shapes import PLANNED_DEPTH
from isotruss_ros.core.model.smooth_outline import SmoothOutline
import numpy as np
import pytest
import robots
from robots import examples, generators, preset
from shapes import dense_outline, random_polygon, random_shape, regular_polygon, sampled, SHAPES

BOX_TEXT = """
shape: polygon
vertices: [[0, 0], [0.3, 0], [0.3, 0.2], [0, 0.2]]
corner_radius: 0.01
mass: 1.5
center_of_mass: [0.15, 0.1]
friction: 0.4
"""
VERTICES = ((0.0, 0.0), (0.3, 0.0), (0.3, 0.2), (0.0, 0.2))


def test_reads_a_box_from_a_file(tmp_path):
    path = tmp_path / 'box.yaml'
    path.write_text(BOX_TEXT, encoding='utf-8')
    box = ConvexObject(Polygon(VERTICES, 0.01), mass=1.5, center_of_mass=(0.15, 0.1), friction=0.4)
    assert read_object(path) == read_object(str(path)) == box


def test_reads_objects_from_text():
    assert read_object('{shape: disc, diameter: 0.2}') == ConvexObject(Disc(0.2))
    ellipse = read_object('{shape: ellipse, semi_axes: [0.2, 0.1], friction: 0}')
    assert ellipse == ConvexObject(Ellipse((0.2, 0.1)), friction=0.0)


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('{}', "key 'shape' is missing; it is one of disc, polygon, ellipse"),
        ('{shape: box}', "shape: 'box': must be one of"),
        ('{shape: disc}', "'diameter' is missing; a disc needs it"),
        ('{shape: disc, diametre: 0.1}', 'did you mean diameter'),
        ('{shape: disc, diameter: 0.1, vertices: []}', "unknown key 'vertices'"),
        ('{shape: polygon, vertices: [[0, 0], [1, 0]]}', 'at least 3'),
        ('{shape: polygon, vertices: [[0, 0], [1, 0], [1, [0]]]}', 'vertex 3'),
        ('{shape: disc, diameter: 30}', 'diameter 30 m: .* if it is in cm, it is 0.3 m'),
        ('{shape: disc, diameter: 0.3, mass: 800}', 'mass 800 kg: .* if it is in g, it is 0.8 kg'),
        (
            '{shape: ellipse, semi_axes: [200, 90]}',
            'semi_axes 200.0 m: must be from .* if it is in mm, it is 0.2 m',
        ),
        ('{shape: disc', 'not YAML'),
        ('{shape: &a disc}', 'anchors and aliases are not used in object files'),
        *((given, 'must be the path of a file, or a text') for given in (None, 5, ['a'], '', ' ')),
    ],
)
def test_invalid_object_descriptions_are_refused(text, words):
    with pytest.raises(ObjectFileError, match=words):
        read_object(text)


def test_refuses_files_with_their_name(tmp_path):
    path = tmp_path / 'none.yaml'
    with pytest.raises(GraspError, match=r'none\.yaml: cannot be read'):
        read_object(path)
    path.write_text('- 1', encoding='utf-8')
    with pytest.raises(ObjectFileError, match=r'none\.yaml: .* must be keys and values'):
        read_object(path)
    path.write_bytes(b'\xff')
    with pytest.raises(ObjectFileError, match='not UTF-8'):
        read_object(path)


#: Number of rollers, and a module whose grip moves an object in this many directions.
PRESETS = {
    'bow_tie': (4, 'upper/D', 3),
    'nine_member': (6, 'north/Z', 3),
    'open_chain': (6, 'right/G', 2),
    'ring_of_four': (8, 'north/T', 3),
    'triangle': (2, 'main/T', 1),
}


def test_all_presets_are_tested():
    assert preset_names() == sorted(PRESETS)


@pytest.mark.parametrize('name', PRESETS)
def test_a_preset_is_rigid_and_moves_an_object_by_each_roller(name):
    robot = core.load_robot(name)
    rollers, module, directions = PRESETS[name]
    assert np.linalg.matrix_rank(robot.home.node_jacobian) == len(robot.roller_names) == rollers
    top = robot.topology.joint_names[-1]
    assert np.isfinite(core.deform(robot.home, {top: (1.0, -1.0)}).displacement(top)).all()
    body = core.ConvexObject.disc(core.tangent_center(robot.home, module, 0.3), 0.3)
    grip = core.Grip.at_module(robot, module, body)
    twists = core.reachable_twists(robot.home, grip)
    assert len(twists) == directions
    assert core.solve_twist(robot.home, grip, 0.01 * twists[0]).status is core.Status.OK


BOX_SHAPE = Polygon(((-0.2, -0.1), (0.2, -0.1), (0.2, 0.1), (-0.2, 0.1)))
WALL = Obstacle('wall', ConvexObject(HalfPlane(), (0.0, -1.0, 0.5 * math.pi)))


def random_pair(generator, reach):
    """Return two objects whose origins are at most `reach` apart [m]."""
    bodies = []
    for _ in range(2):
        shape = random_shape(generator)
        pose = (*generator.uniform(-0.5 * reach, 0.5 * reach, 2), generator.uniform(-3.0, 3.0))
        bodies.append(ConvexObject(shape, pose))
    return bodies


def outline_of(body, count=1500):
    return body.center + body.turn * dense_outline(body.shape, count)


@given(generator=generators())
@examples(60)
def test_separation_is_the_least_distance_of_the_outlines(generator):
    first, second = random_pair(generator, 1.2)
    apart = separate(first, second)
    ones, others = outline_of(first), outline_of(second)
    least = np.abs(ones[:, None] - others).min()
    if apart.distance > 0.0:
        assert apart.distance == pytest.approx(least, abs=1e-4)
        foot = apart.point - apart.distance * apart.normal
        assert first.nearest(np.array([foot])).gaps[0] == pytest.approx(0.0, abs=1e-7)
    else:
        # Overlapping outlines cross, or one object is within the other.
        within = first.nearest(others).gaps.min() < 0.0 or second.nearest(ones).gaps.min() < 0.0
        assert within


@given(generator=generators())
@examples(60)
def test_penetration_is_the_shortest_translation_that_separates_two_objects(generator):
    first, second = random_pair(generator, 0.3)
    apart = separate(first, second)
    normals = np.exp(2j * np.pi * np.arange(20_000) / 20_000)
    along = ((second.center - first.center) * normals.conj()).real
    depths = along - first.support(normals) - second.support(-normals)
    assert apart.distance == pytest.approx(depths.max(), abs=1e-4)
    assert apart.distance >= depths.max() - 1e-12
    x, y, angle = second.pose
    away = (1e-9 - apart.distance) * apart.normal
    moved = second.moved_to((x + away.real, y + away.imag, angle))
    assert separate(first, moved).distance == pytest.approx(1e-9, abs=1e-9)


def test_distances_from_a_wall_are_heights_above_its_line():
    starts, ends = np.array([0.3 + 0.5j, -1.0 - 1.5j]), np.array([1.0 + 0.2j, 2.0 + 1.0j])
    gaps = segment_gaps(WALL.body, starts, ends)
    assert gaps.gaps == pytest.approx([1.2, -0.5])
    assert gaps.shares.tolist() == [1.0, 0.0]
    assert gaps.normals == pytest.approx(1j)
    for shape, lowest in ((BOX_SHAPE, 0.1), (Disc(0.3), 0.15), (Ellipse((0.2, 0.05)), 0.05)):
        above = separate(WALL.body, ConvexObject(shape, (90.0, 0.3, 0.0)))
        assert above.distance == pytest.approx(1.3 - lowest)
        assert above.normal == pytest.approx(1j)


def test_obstacle_moves_by_its_velocity_from_the_time_of_its_stamp():
    hand = Obstacle('hand', ConvexObject(BOX_SHAPE, (1.0, 0.0, 0.1)), (0.2, -0.1, 0.5), 10.0)
    later = hand.at(12.0)
    assert later.body.pose == pytest.approx(Pose(1.4, -0.2, 1.1))
    assert later.stamp == 12.0
    assert hand.velocity_at(np.array([1.0 + 1.0j])) == pytest.approx([-0.3 - 0.1j])
    post = Obstacle('post', ConvexObject(BOX_SHAPE, (1.0, 0.0, 0.1)))
    assert post.at(100.0) is post


ROOM = """
post: {shape: disc, diameter: 0.1, pose: [1.3, 0.8, 0]}
table: {shape: polygon, vertices: [[0, 0], [0.6, 0], [0.6, 0.4], [0, 0.4]], pose: [2, 1, 0.3]}
south wall: {shape: half_plane, pose: [0, -1.5, 1.5708]}
"""


def test_reads_obstacles_from_a_file(tmp_path):
    path = tmp_path / 'room.yaml'
    path.write_text(ROOM, encoding='utf-8')
    post, table, wall = read_obstacles(path)
    assert post == Obstacle('post', ConvexObject.disc((1.3, 0.8), 0.1))
    assert (table.name, table.body.pose) == ('table', (2.0, 1.0, 0.3))
    assert (wall.name, wall.body.shape) == ('south wall', HalfPlane())
    assert read_obstacles('{}') == ()
    home = preset('nine_member').home
    limits = ShapeGuard(home.robot, obstacles=(post, table, wall)).watch(home, None).limits
    assert all((limit.margins > 0.0).all() for limit in limits)


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('{a: {shape: disc, diameter: 0.1}}', "'a': key 'pose' .* is missing"),
        ('{a: {diameter: 0.1, pose: [0, 0, 0]}}', "'a': key 'shape' is missing; .* half_plane"),
        ('{a: {shape: wall, pose: [0, 0, 0]}}', "'a': shape: 'wall': must be one of"),
        ('{a: {shape: disc, diameter: 10000, pose: [0, 0, 0]}}', "'a': .* if it is in mm"),
        ('{a: {shape: disc, diameter: 0.1, pose: [0, 0]}}', "'a': the object's pose .* must be 3"),
        ('{a: {shape: disc, diameter: 0.1, pose: [0, 0, 90]}}', 'if it is in degrees'),
        ('{a: {shape: disc, diameter: 0.1, pose: [0, .nan, 0]}}', "'a': the object's .*finite"),
        ('{a: {shape: disc, diameter: 0.1, mass: 1, pose: [0, 0, 0]}}', "unknown key 'mass'"),
        ('{1: {shape: disc, diameter: 0.1, pose: [0, 0, 0]}}', "'1': name of an obstacle 1: "),
        ('{a: 3}', "'a': '3': must be keys and values"),
        ('[{a: 3}]', 'obstacles: .*: must be obstacles by their names'),
    ],
)
def test_invalid_obstacles_are_refused_with_name_key_and_range(text, words):
    with pytest.raises(ObjectFileError, match=words):
        read_obstacles(text)


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        ({'name': ''}, "name of an obstacle '': must be a text of 1 to 80"),
        ({'velocity': (0.0, 50.0, 0.0)}, "obstacle 'post': velocity .* at most 5 m/s"),
        ({'velocity': (0.0, 0.0, math.inf)}, "obstacle 'post': velocity .*finite"),
    ],
)
def test_obstacles_with_numbers_out_of_range_are_refused(change, words):
    fields = {'name': 'post', 'body': ConvexObject(Disc(0.1))} | change
    with pytest.raises(GraspError, match=words):
        Obstacle(**fields)


SEEDS = st.integers(0, 10**6)
SQUARE = ((-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1))
BEAM = Polygon(((-0.4, -0.02), (0.4, -0.02), (0.4, 0.02), (-0.4, 0.02)))
PENTAGRAM = [(np.cos(4 * np.pi * i / 5), np.sin(4 * np.pi * i / 5)) for i in range(5)]


@robots.examples(100)
@given(SEEDS)
def test_shapes_and_scaled_shapes_keep_the_contract_of_shapes(seed):
    generator = np.random.default_rng(seed)
    shape = random_shape(generator)
    check_shape(shape, generator)
    check_shape(ScaledShape(shape, 1.1), generator)


@robots.examples(100)
@given(SEEDS)
def test_vertices_may_have_either_orientation(seed):
    generator = np.random.default_rng(seed)
    polygon = random_polygon(generator)
    again = Polygon(polygon.vertices[::-1], tuple(polygon.radii[::-1]))
    points = 0.3 * directions(generator)
    one, other = polygon.nearest(points), again.nearest(points)
    assert one.gaps == pytest.approx(other.gaps, abs=1e-14)
    assert one.normals == pytest.approx(other.normals, abs=1e-12)
    assert hash(again) == hash(Polygon(again.vertices, again.corner_radius))


@given(st.floats(0.01, 1.0), st.floats(-4.0, 4.0))
def test_arcs_may_take_whole_sides(half, angle):
    square = half * np.exp(1j * (angle + 0.5 * np.pi * np.arange(4)))
    shape = Polygon(np.column_stack([square.real, square.imag]), half / np.sqrt(2.0))
    assert shape.perimeter == pytest.approx(np.sqrt(2.0) * np.pi * half)


#: Vertices of polygons that are not convex, and radii of corners that do not fit.
POLYGONS = [
    (3, 0.0, 'must be a list'),
    (((0, 0), (1, 0)), 0.0, 'of 2 vertices: must have at least 3'),
    (((0, 0), (1, [0]), (0, 1)), 0.0, 'vertex 2'),
    (((0, 0), (1, float('nan')), (0, 1)), 0.0, 'vertex 2'),
    (((0, 0), (1e10, 0), (0, 1)), 0.0, 'vertex 2 .* within'),
    (((0, 0), (1, 0), (1, 0), (0, 1)), 0.0, r'vertex 2 \(1, 0\) m: .* same position'),
    (((0, 0), (1, 0), (2, 0), (0, 1)), 0.0, r'vertex 2 \(1, 0\) m: on one line'),
    (((0, 0), (2, 0), (1, 0.2), (1, 2)), 0.0, r'vertex 3 \(1, 0.2\) m: .* concave'),
    (((0, 0), (1, 1), (1, 0), (0, 1)), 0.0, 'vertex 1 .* cross each other'),
    (PENTAGRAM, 0.0, 'cross each other'),
    (((0, 0), (1.2e-9, 0), (0, 1.2e-9)), 0.0, 'must be 1e-18 m\\^2 or more'),
    (SQUARE, -0.01, 'corner_radius -0.01 m: must be from 0 to 10 m'),
    (SQUARE, 0.11, 'does not fit: the side of 0.2 m that begins at vertex 1'),
    (SQUARE, (0.0, 0.15, 0.06, 0.0), r'that begins at vertex 2 \(0.1, -0.1\) m'),
    (SQUARE, (0.01, 0.01), 'must be 4 finite numbers'),
]


@pytest.mark.parametrize(
    ('make', 'words'),
    [
        *((partial(Polygon, vertices, radius), words) for vertices, radius, words in POLYGONS),
        (lambda: Disc(-1.0), 'must be from'),
        (lambda: Disc(0.99e-9), 'must be from'),
        (lambda: Ellipse((0.1, 0.0)), 'semi_axes'),
        (lambda: Ellipse((0.1, 1e-5)), 'factor'),
        (lambda: ConvexObject(Disc(0.1), (0.0, 0.0)), 'pose'),
        (lambda: ConvexObject(Disc(0.1), (1e13, 0.0, 0.0)), 'within'),
        (lambda: ConvexObject(Disc(0.1), mass=0.0), 'mass'),
        (lambda: ConvexObject(Disc(0.1), center_of_mass=(0.06, 0.0)), 'within the object'),
        (lambda: ConvexObject.disc((1.01e12, 0.0), 0.1), 'must be within'),
        (lambda: ConvexObject.disc((0.0, 0.0), 10.1), 'must be from'),
        (lambda: ConvexObject.disc((0.0, 0.0), np.inf), "the object's diameter .* finite number"),
    ],
)
def test_invalid_shapes_and_objects_are_refused_with_the_number(make, words):
    with pytest.raises(GraspError, match=words):
        make()


@pytest.mark.parametrize('shape', [*SHAPES, BEAM, Ellipse((0.3, 0.08))])
def test_gaps_of_segments_are_those_of_their_points(shape):
    rng = np.random.default_rng(1)
    share = np.linspace(0.0, 1.0, 4001)
    for _ in range(40):
        body = ConvexObject(shape, (*rng.normal(size=2), rng.uniform(0.0, 6.0)))
        start, end = body.middle + 0.4 * (rng.normal(size=2) + 1j * rng.normal(size=2))
        actual = segment_gaps(body, np.array([start]), np.array([end]))
        points = body.nearest(start + share * (end - start)).gaps
        if points.min() > 1e-3:
            assert actual.gaps[0] == pytest.approx(points.min(), abs=1e-4)
            place = start + actual.shares[0] * (end - start)
            nearest = body.nearest(np.array([place]))
            assert nearest.gaps[0] == pytest.approx(actual.gaps[0], abs=1e-9)
            assert actual.normals[0] == pytest.approx(nearest.normals[0], abs=1e-6)
        else:
            assert actual.gaps[0] < 2e-3


ANGLES = np.linspace(-7.0, 7.0, 1001)
NORMALS = np.exp(1j * ANGLES)
NONE = np.zeros(len(ANGLES), dtype=np.intp)
ELLIPSES = [Ellipse((0.15, 0.1)), Ellipse((0.09, 0.12))]
#: Shift of the frame [m].
AWAY = 0.2 - 0.1j


def curve_of(ellipse, count, away=0j):
    """Return the curve through corners on an ellipse, written in a frame away from its middle."""
    return sampled(ellipse, count, 0.3, away).smoothed(1.0)


@pytest.mark.parametrize('ellipse', ELLIPSES)
@pytest.mark.parametrize(('count', 'place', 'radius'), [(24, 2e-6, 3e-4), (96, 1e-8, 1e-6)])
def test_points_and_radii_are_those_of_the_ellipse(ellipse, count, place, radius):
    curve = curve_of(ellipse, count, AWAY)
    points, radii = curve.surface_at(NONE, NORMALS)
    wanted, exact = ellipse.surface_at(NONE, NORMALS)
    assert np.abs(points - wanted - AWAY).max() < place
    assert np.abs(radii / exact - 1.0).max() < radius
    assert curve.support_points(NORMALS) == pytest.approx(points, abs=1e-15)
    assert curve.perimeter == pytest.approx(ellipse.perimeter, rel=1e-6)


def test_polygons_with_few_or_sharp_corners_or_long_faces_stay_polygons():
    few, many = regular_polygon(12, 0.02), regular_polygon(24, 0.15)
    face = many.faces_at(0)[0].length
    assert few.smoothed(1.0) is few
    assert many.smoothed(0.999 * face) is many
    assert isinstance(many.smoothed(1.001 * face), SmoothOutline)
    # One sharp corner.
    pointed = np.append(sampled(Disc(0.3), 48, 0.0).corners[:40], 0.1455 - 0.0972j)
    polygon = Polygon(tuple(zip(pointed.real, pointed.imag, strict=True)))
    assert polygon.smoothed(1.0) is polygon


def test_a_scaled_box_has_the_contacts_of_the_box_with_scaled_corners():
    scaled = ScaledShape(BOX, 1.1)
    corners = (1.1 * np.array(BOX.vertices)).tolist()
    larger = core.Polygon(corners, corner_radius=1.1 * BOX.corner_radius)
    for angle in np.linspace(0.0, 6.0, 13):
        ends, expected = (s.contact_patch(np.exp(1j * angle), 0.05) for s in (scaled, larger))
        assert [end.corner for end in ends] == [end.corner for end in expected]
        assert [end.along for end in ends] == pytest.approx([end.along for end in expected])


@pytest.mark.parametrize('depth', [1e-4, 1e-3, 3e-3, 6e-3, 1.2e-2, 2e-2])
@pytest.mark.parametrize('tilt', [1e-7, 1e-5, 1e-3, 5e-3, 1e-2, 2e-2, 5e-2])
def test_both_corners_of_a_face_touch_if_they_are_within_the_depth_or_the_planned_depth(
    tilt, depth
):
    radius = 0.051
    for length, sign in ((0.24, 1.0), (0.24, -1.0), (0.95 * radius, 1.0)):
        shape = Polygon([(-0.5 * length, 0.0), (0.5 * length, 0.0), (0.0, 0.3)])
        normal = -1j * np.exp(1j * sign * tilt)
        skin = shape.support(np.array([normal]))[0] - depth
        patch = shape.contact_patch(normal, radius, skin)
        is_within = length * np.sin(tilt) <= max(depth, PLANNED_DEPTH * radius)
        assert len(patch) == 1 + (is_within and length > radius)
