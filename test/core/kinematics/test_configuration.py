# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forward kinematics: the robot at home, its shape at given roller travel, and distances."""

import re

from hypothesis import given
from isotruss_ros.core import Configuration, ConvexObject, Disc, load_robot, Polygon
from isotruss_ros.core.errors import ConfigurationError, RobotFileError
from isotruss_ros.core.kinematics.depths import member_depths, push_out
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.kinematics.rigidity import rigidity_index
from isotruss_ros.core.model.convex_object import segment_gaps
from isotruss_ros.core.safety.margins import object_distances
import numpy as np
import pytest
import robots
from robots import refusal
from shapes import SHAPES


def roller_matrix(robot):
    """Return C, with L = L0 + C phi, from the names: the roller at j feeds the member from j."""
    matrix = np.zeros((len(robot.member_names), len(robot.roller_names)))
    for column, roller in enumerate(robot.roller_names):
        tube, joint = roller.split('/')
        for row, member in enumerate(robot.member_names):
            own, ends = member.split('/')
            start, end = ends.split('-')
            if own == tube:
                matrix[row, column] = (start == joint) - (end == joint)
    return matrix


def residual(robot, travel, points):
    """Return the constraints at a shape, written out again from names and distances."""
    place = dict(zip(robot.node_names, points, strict=True))
    module = robot.description.module
    lengths = robot.home.member_lengths + roller_matrix(robot) @ travel
    home = dict(zip(robot.node_names, robot.home.points, strict=True))
    rows = []
    for tube in robot.description.tubes:
        n = len(tube.joints)
        for i, joint in enumerate(tube.joints):
            after, before = tube.joints[(i + 1) % n], tube.joints[i - 1]
            name, a = f'{tube.name}/{joint}', place[joint]
            b, c = place[f'{name}/B'], place[f'{name}/C']
            ahead = place[f'{tube.name}/{after}/C'] - b
            back = place[f'{tube.name}/{before}/B'] - c
            rod = 0.5 * (b + c) - a
            bend = -ahead * back / rod**2
            # B faces the next joint, C the previous one; the rod points between the sides.
            to_next, to_previous = place[after] - a, place[before] - a
            to_next, to_previous = to_next / abs(to_next), to_previous / abs(to_previous)
            assert (np.conj(b - c) * (to_next - to_previous)).real > 0.0
            assert (np.conj(rod) * (to_next + to_previous)).real > 0.0
            assert (np.conj(rod) * ahead).real > 0.0
            arm = np.hypot(module.rod_length, 0.5 * module.pinch_separation)
            member = robot.member_names.index(f'{name}-{after}')
            rows += [
                abs(ahead) - lengths[member],
                abs(b - a) - arm,
                abs(c - a) - arm,
                abs(b - c) - module.pinch_separation,
                (bend / abs(bend)).imag,
            ]
    for joint, axes in robot.description.supports.items():
        moved = place[joint] - home[joint]
        rows += [moved.real if axis == 'x' else moved.imag for axis in axes]
    return np.array(rows)


def check_shape(robot, rng):
    config = robots.random_state(robot, rng)
    for each in (robot.home, config):
        rows = residual(robot, each.roller_positions, each.points)
        assert np.abs(rows).max() < 1e-11
    wanted = robot.home.member_lengths + roller_matrix(robot) @ config.roller_positions
    assert config.member_lengths == pytest.approx(wanted, abs=1e-11)


@robots.examples(30)
@given(robots.robots(), robots.generators())
def test_configuration_fulfils_independently_written_constraints(robot, rng):
    check_shape(robot, rng)


def test_large_robots_have_the_same_kinematics():
    """Beyond a number of coordinates the matrix of (12) is sparse."""
    robot, rng = robots.random_robot(5, 'ring', 16), np.random.default_rng(5)
    check_shape(robot, rng)
    check_rates(robot, rng)


@robots.examples(20)
@given(robots.robots(), robots.generators())
def test_configuration_is_independent_of_path_and_steps(robot, rng):
    config = robots.random_state(robot, rng)
    travel = config.roller_positions
    assert config.moved_to(0.0 * travel).points == pytest.approx(robot.home.points, abs=1e-10)
    middle = robot.home
    for share in np.sort(rng.uniform(0.0, 1.0, 7)):
        middle = middle.moved_to(share * travel)
    assert middle.moved_to(travel).points == pytest.approx(config.points, abs=1e-10)


def check_rates(robot, rng):
    config = robots.random_state(robot, rng)
    rates = rng.standard_normal(len(robot.roller_names))
    step = 1e-5
    ahead = config.moved_to(config.roller_positions + step * rates)
    behind = config.moved_to(config.roller_positions - step * rates)
    wanted = (ahead.nodes - behind.nodes) / (2.0 * step)
    scale = np.abs(wanted).max()
    speeds = (config.node_jacobian @ rates).reshape(-1, 2)
    assert speeds == pytest.approx(wanted, abs=1e-6 * scale + 1e-6)
    predicted = config.predict(step * rates)
    linear = (predicted.nodes - config.nodes) / step
    assert linear == pytest.approx(speeds, abs=1e-9 * (scale + 1.0))
    rows = rng.standard_normal((3, speeds.size))
    expected = rows @ config.node_jacobian
    assert config.roller_rows(rows) == pytest.approx(expected, abs=1e-8 * np.abs(expected).max())


@robots.examples(25)
@given(robots.robots(), robots.generators())
def test_node_jacobian_agrees_with_finite_differences(robot, rng):
    check_rates(robot, rng)


def test_configurations_at_several_travels_are_those_at_each():
    home, rng = load_robot('nine_member').home, np.random.default_rng(3)
    travels = rng.uniform(-1.0, 1.0, (12, 6)) * np.repeat([0.0, 0.01, 0.05, 0.2], 3)[:, None]
    for travel, moved in zip(travels, home.moved_together(travels), strict=True):
        assert moved.roller_positions == pytest.approx(travel)
        assert moved.points == pytest.approx(home.moved_to(travel).points, abs=1e-11)


def test_travel_without_a_configuration_is_an_error_among_others():
    home = load_robot('triangle').home
    reached, refused = home.moved_together(np.array([[0.01, 0.0], [0.9, 0.9]]))
    assert reached.points == pytest.approx(home.moved_to([0.01, 0.0]).points, abs=1e-11)
    with pytest.raises(ConfigurationError, match='no configuration exists beyond'):
        raise refused


@pytest.mark.parametrize(
    ('travel', 'message'),
    [
        ([0.0], r'for main/R, main/T: \[0.0\]: must be 2 finite numbers'),
        ([5.0, -5.0], r'make member main/L-R -3\.98 m long; must be positive'),
        ([0.9, 0.9], r'no configuration exists beyond \d+(\.\d+)? % of the way'),
    ],
)
def test_unreachable_travel_is_refused(travel, message):
    robot = load_robot('triangle')
    with pytest.raises(ConfigurationError, match=message) as caught:
        robot.configuration(travel)
    assert 'roller positions' in str(caught.value)


@robots.examples(40)
@given(robots.robots(), robots.generators())
def test_branches_end_at_singular_configurations_only(robot, rng):
    travel = rng.standard_normal(len(robot.roller_names))
    travel *= 0.5 * robot.home.member_lengths.min() / np.abs(roller_matrix(robot) @ travel).max()
    try:
        robot.configuration(travel)
        return
    except ConfigurationError as error:
        said = float(re.search(r'beyond ([\d.e-]+) %', str(error))[1]) / 100.0
    config, low, high = robot.home, 0.0, 1.0
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        try:
            config, low = robot.configuration(middle * travel, near=config), middle
        except ConfigurationError:
            high = middle
    assert said == pytest.approx(low, abs=0.005)
    # At a fold the smallest singular value goes with the square root of the distance from it.
    near, nearer = (robot.configuration(share * low * travel) for share in (0.99, 0.999))
    gains = [np.linalg.svd(robots.dense_matrix(c), compute_uv=False)[-1] for c in (near, nearer)]
    assert gains[1] / gains[0] < 0.6


def test_singular_configuration_has_no_node_jacobian():
    robot = load_robot('triangle')
    # All joints in line: nothing in (12) holds them there.
    flat = robot.home.points.real.astype(complex)
    config = Configuration(robot, np.zeros(2), flat)
    with pytest.raises(ConfigurationError, match='is singular; choose other roller positions'):
        config.predict(np.array([1e-3, 0.0]))


def pinched(opening, module):
    """Return an isosceles triangle with this angle [deg] at its top, and this module."""
    document = robots.example()
    half = np.deg2rad(0.5 * opening)
    document['joints'] = {'P': [-np.sin(half), 0], 'Q': [np.sin(half), 0], 'X': [0, np.cos(half)]}
    document['module'].update(module, guide_ring_distance=0.001)
    document['members'] = {'min_length': 1e-3, 'max_length': 10.0}
    return document


@pytest.mark.parametrize(
    ('opening', 'size', 'message'),
    [
        # The rod at the blunt top is longer than the triangle is high: its end comes out below.
        (150.0, {'pinch_separation': 0.1, 'rod_length': 0.25}, 'leave it at -.* must be more'),
        # The modules at the short base are wider than it.
        (10.0, {'pinch_separation': 0.1, 'rod_length': 0.1}, 'no angle of its rod bisects'),
        (0.95, {'pinch_separation': 1e-5, 'rod_length': 1e-3}, '0.95 degrees; must be between 1'),
    ],
)
def test_module_that_does_not_fit_its_corner_is_refused(opening, size, message):
    with pytest.raises(RobotFileError, match=f'does not fit its corner: .*{message}'):
        robots.load(pinched(opening, size))


def slender_example():
    """Return the document of a small robot whose modules fit where they are close together."""
    document = robots.example()
    document['module']['pinch_separation'], document['tube']['diameter'] = 0.05, 0.02
    return document


@pytest.mark.parametrize(
    ('supports', 'message'),
    [
        ({'P': ['x', 'y']}, 'supports: too few: 2 grounded coordinates; must be 3'),
        ({'P': ['x', 'y'], 'Q': ['x', 'y']}, 'supports: too many: 4 grounded coordinates'),
        ({'P': ['y'], 'Q': ['y'], 'X': ['y']}, 'these joints can still move: P, Q, X'),
        # Q can only move at a right angle to PQ: along y, which grounding its x does not stop.
        ({'P': ['x', 'y'], 'Q': ['x']}, 'rollers locked: these joints can still move: Q, X'),
    ],
)
def test_supports_that_do_not_hold_the_robot_are_refused(supports, message):
    document = robots.example()
    document['supports'] = supports
    assert message in refusal(document)


def test_only_moving_joints_of_a_mechanism_are_named():
    document = slender_example()
    # A second triangle that hangs on one joint of the first, and turns about it.
    document['joints'].update({'U': [2.0, 0.0], 'V': [1.6, 0.9]})
    document['tubes']['loose'] = {'joints': ['Q', 'U', 'V'], 'passive': 'U'}
    assert 'these joints can still move: U, V; 1 more members or supports' in refusal(document)
    document['supports']['U'] = ['y']
    robots.load(document)


def test_hinges_in_line_are_refused():
    # A three-hinged arch whose hinges are in line moves a little, whatever its lengths.
    document = slender_example()
    document['members']['min_length'] = 0.2
    document['joints'].update({'H': [0.5, 0.0], 'U': [0.25, -0.45], 'V': [0.75, -0.45]})
    document['tubes']['left'] = {'joints': ['P', 'H', 'U'], 'passive': 'U'}
    document['tubes']['right'] = {'joints': ['Q', 'H', 'V'], 'passive': 'V'}
    message = refusal(document)
    assert 'can still move: H, U, V' in message
    document['joints'].update({'H': [0.5, -0.3], 'U': [0.15, -0.6], 'V': [0.85, -0.6]})
    robots.load(document)


def scaled_matrix(config):
    """Return the matrix of (12), its rows of angles times the rod length."""
    m, matrix = config.robot.topology.n_modules, robots.dense_matrix(config)
    matrix[slice(4 * m, 5 * m)] *= config.robot.description.module.rod_length
    return matrix


def least_singular_value(config):
    """Return the smallest singular value of that matrix."""
    return np.linalg.svd(scaled_matrix(config), compute_uv=False)[-1]


@pytest.mark.parametrize('case', [*robots.PRESETS, 0, 1, 2])
def test_modes_agree_with_a_singular_value_decomposition(case):
    robot = load_robot(case) if isinstance(case, str) else robots.random_robot(case)
    measure = rigidity_index(robot)
    rng = np.random.default_rng(1)
    for _ in range(3):
        config = robots.random_state(robot, rng, 0.1)
        modes = measure.modes(config)
        expected = least_singular_value(config) / least_singular_value(robot.home)
        assert modes.values[0] == pytest.approx(expected, rel=1e-5)


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
