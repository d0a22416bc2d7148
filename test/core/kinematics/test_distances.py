# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Depths of objects in members, and distances of parts from each other and from an object."""

from hypothesis import given
from isotruss_ros.core import ConvexObject, Disc, load_robot, Polygon
from isotruss_ros.core.kinematics.depths import member_depths, push_out
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.model.convex_object import segment_gaps
from isotruss_ros.core.safety.margins import object_distances
import numpy as np
import pytest
import robots
from shapes import SHAPES

ROBOT = load_robot('nine_member')
SHARE = np.linspace(0.0, 1.0, 4001)


def parts_of(robot, config):
    """Return name: (points along it, radius) of all parts and joints, identified by name."""
    file = robot.description
    tube = 0.5 * file.tube_diameter
    disc = 0.5 * file.module.pinch_separation + tube
    place = dict(zip(robot.node_names, config.points, strict=True))
    parts = {}
    for name in robot.member_names:
        t, joints = name.split('/')
        here, there = joints.split('-')
        begin, end = place[f'{t}/{here}/B'], place[f'{t}/{there}/C']
        parts[f'member {name}'] = begin + SHARE * (end - begin), tube
    for name in robot.module_names:
        joint = place[name.split('/')[1]]
        middle = 0.5 * (place[f'{name}/B'] + place[f'{name}/C'])
        parts[f'module {name}'] = np.array([middle]), disc
        parts[f'rod {name}'] = joint + SHARE * (middle - joint), 0.0
    for joint in robot.topology.joint_names:
        parts[f'joint {joint}'] = np.array([place[joint]]), 0.0
    return parts


def gap(parts, one, other):
    (first, first_radius), (second, second_radius) = parts[one], parts[other]
    return np.abs(first[:, None] - second).min() - first_radius - second_radius


def fixed_to_each_other(one, other):
    """Tell whether two parts meet by construction, and so cannot come apart or nearer."""
    (kind, name), (other_kind, other_name) = one.split(' '), other.split(' ')
    if other_kind == 'member':
        tube, joints = other_name.split('/')
        joint = name.split('/')[-1]
        return joint in joints.split('-') and (kind == 'joint' or name.split('/')[0] == tube)
    # Rods that share a joint meet there.
    return other_kind == 'rod' and name.split('/')[-1] == other_name.split('/')[1]


@robots.examples(25)
@given(robots.robots(), robots.generators())
def test_pairs_exclude_parts_fixed_to_each_other(robot, rng):
    model = collision_model(robot)
    names = model.names(np.arange(len(model.distances(robot.home))))
    points = [n for n in parts_of(robot, robot.home) if n.startswith(('module', 'joint'))]
    wanted = set()
    for i, one in enumerate(points):
        for other in model.part_names():
            new = not other.startswith('module') or other not in points[: i + 1]
            if one.startswith('joint') and other.startswith('module'):
                continue  # the joint is the end of a rod
            if new and not fixed_to_each_other(one, other):
                wanted.add(f'{one} and {other}')
    assert len(names) == len(set(names))
    assert set(names) == wanted


@robots.examples(25)
@given(robots.robots(), robots.generators())
def test_distances_are_those_of_points_along_the_parts(robot, rng):
    config = robots.far_state(robot, rng, 0.2)
    model, parts = collision_model(robot), parts_of(robot, config)
    distances = model.distances(config)
    wanted = [gap(parts, *name.split(' and ')) for name in model.names(np.arange(len(distances)))]
    # The nearest of the points is no nearer than the nearest of all, and not much farther.
    assert (distances <= np.array(wanted) + 1e-12).all()
    assert distances == pytest.approx(wanted, abs=3e-4)


@robots.examples(25)
@given(robots.robots(), robots.generators())
def test_object_distances_are_those_of_points_along_the_parts(robot, rng):
    config = robots.far_state(robot, rng, 0.1)
    center = config.points[rng.integers(len(config.points))] + complex(*rng.uniform(-1, 1, 2))
    body = ConvexObject.disc((center.real, center.imag), float(rng.uniform(0.05, 0.5)))
    model, parts = collision_model(robot), parts_of(robot, config)
    parts['object'] = np.array([center]), 0.5 * body.shape.diameter
    wanted = np.array([gap(parts, 'object', name) for name in model.part_names()])
    assert object_distances(config, body) == pytest.approx(wanted, abs=3e-4)


@pytest.mark.parametrize('shape', SHAPES)
def test_distance_gradients_agree_with_finite_differences(shape):
    body, rng = ConvexObject(shape, (0.72, 0.48, 0.33)), np.random.default_rng(2)
    model, step, home = collision_model(ROBOT), 1e-6, ROBOT.home
    _, by_nodes, by_pose = model.body_distances(home, body)
    by_rollers = by_nodes @ home.node_jacobian
    for _ in range(3):
        move, motion = rng.normal(size=len(home.roller_positions)), rng.normal(size=3)
        ahead, behind = (
            model.body_distances(
                home.moved_to(home.roller_positions + sign * step * move),
                body.moved_to(np.add(body.pose, sign * step * motion)),
            )
            for sign in (1, -1)
        )
        change = (ahead[0] - behind[0]) / (2.0 * step)
        assert by_rollers @ move + by_pose @ motion == pytest.approx(change, abs=1e-4)


HOME = ROBOT.home
TOPOLOGY = ROBOT.topology
BEGIN, END = HOME.points[TOPOLOGY.b], HOME.points[TOPOLOGY.end]
TUBE = 0.5 * ROBOT.description.tube_diameter
SIZE = 0.12
SLAB = Polygon([(-0.05, -0.04), (0.05, -0.04), (0.05, 0.04), (-0.05, 0.04)])


def test_closed_form_for_discs_agrees_with_the_general_search():
    rng = np.random.default_rng(0)
    for _ in range(200):
        body = ConvexObject.disc(rng.uniform(-1.0, 1.0, 2), rng.uniform(0.05, 0.8))
        expected = TUBE - segment_gaps(body, BEGIN, END).gaps
        assert member_depths(HOME, body) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize('member', range(len(BEGIN)))
@pytest.mark.parametrize('side', [1.0, -1.0])
def test_one_member_pushes_along_its_normal_until_the_surfaces_touch(member, side):
    along = (END[member] - BEGIN[member]) / abs(END[member] - BEGIN[member])
    middle, normal = 0.5 * (BEGIN[member] + END[member]), side * 1j * along
    touching = middle + (0.5 * SIZE + TUBE) * normal
    lying, away = touching - 0.03 * normal, touching + 0.001 * normal
    body = ConvexObject(Disc(SIZE), (lying.real, lying.imag, 0.4))
    moved = push_out(HOME, body)
    assert moved.center == pytest.approx(touching, abs=1e-9)
    assert moved.pose.angle == 0.4
    apart = body.moved_to((away.real, away.imag, 0.4))
    assert push_out(HOME, apart) == apart
    box = ConvexObject(SLAB, (lying.real, lying.imag, 0.4))
    moved = push_out(HOME, box)
    gaps = segment_gaps(moved, BEGIN, END).gaps - TUBE
    assert gaps[member] == pytest.approx(0.0, abs=2e-9)
    assert ((moved.center - box.center) * normal.conjugate()).imag == pytest.approx(0.0, abs=1e-9)
    assert moved.pose.angle == 0.4
