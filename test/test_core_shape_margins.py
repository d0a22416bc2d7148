"""How far shapes are from trouble: against a full decomposition and brute-force distances."""

from hypothesis import assume, given
from isotruss_ros.core import (
    ConfigurationError,
    Cylinder,
    Grasp,
    GraspError,
    load_robot,
    shape_margins,
    ShapeBounds,
    ShapeGuard,
    snug_center,
)
from isotruss_ros.core.barriers import EVERYTHING, ObjectBarrier
from isotruss_ros.core.boundary import Boundary
from isotruss_ros.core.clearance import bodies
import numpy as np
import pytest
import robots


def smallest_singular_value(config):
    """Return that of (12), bisection rows times the rod length."""
    m = len(config.robot.member_names)
    bisection = slice(4 * m, 5 * m)
    matrix = config.matrix.copy()
    matrix[bisection] *= config.robot.description.module.rod_length
    return np.linalg.svd(matrix, compute_uv=False)[-1]


def moved(robot, rng, reach):
    """Return a state, if there is one."""
    try:
        return robots.random_state(robot, rng, reach)
    except ConfigurationError:
        assume(False)


@robots.examples(40)
@given(robots.robots(), robots.generators())
def test_rigidity_is_the_smallest_singular_value(robot, rng):
    config = moved(robot, rng, rng.uniform(0.0, 0.3))
    expected = smallest_singular_value(config) / smallest_singular_value(robot.home)
    assert shape_margins(config).rigidity == pytest.approx(expected, rel=2e-3)
    # Where it matters it is exact.
    if expected < 0.4:
        assert shape_margins(config).rigidity == pytest.approx(expected, rel=1e-6)


def test_rigidity_does_not_depend_on_the_size_of_the_robot():
    document = robots.example()
    small = robots.load(document)
    for joint, place in document['joints'].items():
        document['joints'][joint] = [3.0 * x for x in place]
    for key in ('pinch_separation', 'rod_length', 'guide_ring_distance'):
        document['module'][key] *= 3.0
    document['members']['max_length'] *= 3.0
    large = robots.load(document)
    travel = np.array([0.15, -0.1])
    one = smallest_singular_value(small.configuration(travel))
    assert smallest_singular_value(large.configuration(3.0 * travel)) == pytest.approx(one)
    assert shape_margins(large.configuration(3.0 * travel)).rigidity == pytest.approx(
        shape_margins(small.configuration(travel)).rigidity
    )


def test_flat_triangle_is_not_rigid():
    robot = load_robot('triangle')
    rigidity = [
        shape_margins(robot.configuration([travel, -travel])).rigidity
        for travel in (0.0, 0.1, 0.2, 0.3, 0.31)
    ]
    assert (np.diff(rigidity) < 0.0).all()
    assert rigidity[-1] < 0.25


def sides(robot, config):
    """Return begin and end, (m,) each, of the members' straight tubes, found by name."""
    places = dict(zip(robot.node_names, config.points, strict=True))
    begin, end = [], []
    for name in robot.member_names:
        tube, joints = name.split('/')
        here, there = joints.split('-')
        begin.append(places[f'{tube}/{here}/B'])
        end.append(places[f'{tube}/{there}/C'])
    return np.array(begin), np.array(end)


def middles(robot, config):
    places = dict(zip(robot.node_names, config.points, strict=True))
    return np.array([(places[f'{n}/B'] + places[f'{n}/C']) / 2 for n in robot.module_names])


def brute_force(robot, config):
    """Measure every pair that has no joint in common, by points along the tubes."""
    file = robot.description
    tube = file.tube_diameter / 2
    disc = max(file.module.pinch_separation / 2 + tube, file.module.rod_length)
    begin, end = sides(robot, config)
    share = np.linspace(0.0, 1.0, 4001)
    found = {}
    for name, middle in zip(robot.module_names, middles(robot, config), strict=True):
        joint = name.split('/')[1]
        for i, member in enumerate(robot.member_names):
            if joint not in member.split('/')[1].split('-'):
                line = begin[i] + share * (end[i] - begin[i])
                key = f'module {name} and member {member}'
                found[key] = np.abs(line - middle).min() - disc - tube
    neighbours = {
        frozenset(m.split('/')[1].split('-')) | {m.split('/')[0]} for m in robot.member_names
    }
    centers = middles(robot, config)
    for i, one in enumerate(robot.module_names):
        for j in range(i):
            two = robot.module_names[j]
            (tube_1, joint_1), (tube_2, joint_2) = one.split('/'), two.split('/')
            if joint_1 == joint_2 or (
                tube_1 == tube_2 and frozenset({joint_1, joint_2, tube_1}) in neighbours
            ):
                continue
            found[f'modules {two} and {one}'] = abs(centers[i] - centers[j]) - 2 * disc
    return found


@robots.examples(25)
@given(robots.robots(), robots.generators())
def test_distances_are_those_of_points_along_the_tubes(robot, rng):
    config = moved(robot, rng, 0.2)
    parts = bodies(robot)
    distances = parts.distances(config)
    names = parts.names(np.arange(len(distances)))
    expected = brute_force(robot, config)
    at_home = brute_force(robot, robot.home)
    left_out = {name for name, distance in at_home.items() if distance <= 0.0}
    assert set(parts.overlapping) == left_out
    assert set(ShapeGuard(robot, ShapeBounds()).unguarded) == left_out
    assert set(names) == set(expected) - left_out
    assert distances == pytest.approx([expected[name] for name in names], abs=1e-5)
    margins = shape_margins(config)
    if names:
        assert margins.clearance == distances.min()
        assert expected[margins.nearest] == pytest.approx(margins.clearance, abs=1e-5)
    else:
        assert margins.clearance == np.inf


@robots.examples(25)
@given(robots.robots(('arch', 'ring')), robots.generators())
def test_members_are_no_nearer_to_each_other_than_the_discs_of_modules_are(robot, rng):
    """It is enough to look at the ends of the tubes."""
    assume(not bodies(robot).overlapping)
    config = moved(robot, rng, 0.2)
    clearance = shape_margins(config).clearance
    assume(clearance > 0.0)
    begin, end = sides(robot, config)
    lines = begin + np.linspace(0.0, 1.0, 101)[:, None] * (end - begin)
    for i, one in enumerate(robot.member_names):
        for j in range(i):
            two = robot.member_names[j]
            common = set(one.split('/')[1].split('-')) & set(two.split('/')[1].split('-'))
            # Those that cross lie at different heights, or did not get there past the discs.
            if not common and not crosses(begin, end, i, j):
                gap = np.abs(lines[:, i, None] - lines[:, j]).min()
                assert gap - robot.description.tube_diameter >= clearance - 1e-9


def crosses(begin, end, i, j):
    """Tell whether two members cross."""

    def left(p, q, r):
        return ((q - p).conjugate() * (r - p)).imag > 0.0

    return left(begin[i], end[i], begin[j]) != left(begin[i], end[i], end[j]) and left(
        begin[j], end[j], begin[i]
    ) != left(begin[j], end[j], end[i])


@pytest.mark.parametrize('name', robots.PRESETS)
def test_presets_are_well_inside_at_home(name):
    robot = load_robot(name)
    margins = shape_margins(robot.home)
    assert margins.rigidity == pytest.approx(1.0)
    assert margins.clearance > 0.5
    assert margins.object_clearance == np.inf
    assert margins.nearest_to_object == ''
    assert bodies(robot).overlapping == ()


def test_object_that_lies_free_and_that_is_held():
    robot = load_robot('nine_member')
    cylinder = Cylinder(snug_center(robot.home, 'north/Z', 0.3), 0.3)
    held = shape_margins(robot.home, cylinder, 'north/Z')
    free = shape_margins(robot.home, cylinder)
    # It touches both sides: that is what the grip is for.
    assert free.object_clearance == pytest.approx(0.0, abs=1e-9)
    assert free.nearest_to_object.startswith('member north/')
    assert held.object_clearance > 0.1
    assert 'Z' not in held.nearest_to_object.split('/')[1]
    # A small one that lies over the grip's own arms is no nearer to anything else.
    small = Cylinder(snug_center(robot.home, 'north/Z', 0.1), 0.1)
    assert shape_margins(robot.home, small, 'north/Z').object_clearance > held.object_clearance
    # All of a triangle but the side across meets at the joint that holds.
    triangle = load_robot('triangle')
    module = triangle.module_names[0]
    cylinder = Cylinder(snug_center(triangle.home, module, 0.1), 0.1)
    joint = module.split('/')[1]
    assert joint not in shape_margins(triangle.home, cylinder, module).nearest_to_object.split('/')
    with pytest.raises(GraspError, match='no such module'):
        shape_margins(robot.home, cylinder, 'north/X')


@robots.examples(25)
@given(robots.robots(), robots.generators())
def test_object_distances_are_those_of_points_along_the_tubes(robot, rng):
    config = moved(robot, rng, 0.1)
    file = robot.description
    center = config.points[rng.integers(len(config.points))] + complex(*rng.uniform(-1, 1, 2))
    cylinder = Cylinder((center.real, center.imag), float(rng.uniform(0.05, 0.5)))
    tube, radius = file.tube_diameter / 2, cylinder.diameter / 2
    disc = max(file.module.pinch_separation / 2 + tube, file.module.rod_length)
    begin, end = sides(robot, config)
    share = np.linspace(0.0, 1.0, 4001)[:, None]
    members = np.abs(begin + share * (end - begin) - center).min(axis=0) - tube - radius
    modules = np.abs(middles(robot, config) - center) - disc - radius
    expected = min(members.min(), modules.min())
    assert shape_margins(config, cylinder).object_clearance == pytest.approx(expected, abs=1e-4)
    grip = str(rng.choice(robot.module_names))
    joint = grip.split('/')[1]
    others = [
        *(
            d
            for d, n in zip(members, robot.member_names, strict=True)
            if joint not in n.split('/')[1].split('-')
        ),
        *(d for d, n in zip(modules, robot.module_names, strict=True) if n.split('/')[1] != joint),
    ]
    found = bodies(robot).object_distances(config, cylinder, grip)
    assert found.min() == pytest.approx(min(others, default=np.inf), abs=1e-4)
    held = shape_margins(config, cylinder, grip)
    assert held.object_clearance == found.min()
    assert (held.nearest_to_object == '') == (not others)
    # It is what the guard goes by.
    barrier = ObjectBarrier(robot, Boundary(0.0, 1.0))
    grasp = Grasp(grip, cylinder.center, cylinder.diameter)
    assert (barrier.values(config, grasp, EVERYTHING) == found).all()
