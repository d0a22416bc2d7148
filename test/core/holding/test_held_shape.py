# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Held shapes: lines, record and frequency; random grasps of polygons with many corners."""

from dataclasses import replace
from functools import cache
import gc
from itertools import product
import weakref

from held_grips import APART, BOX, CORNER, held, HOME, NINE
from isotruss_ros import core
from isotruss_ros.core.errors import ConfigurationError, GraspError, StructureError
from isotruss_ros.core.holding import held_shape
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.grip_record import GripRecord
from isotruss_ros.core.holding.roll_grip import roll_grip, with_tubes
from isotruss_ros.core.kinematics.depths import member_lines
from isotruss_ros.core.kinematics.robot import Robot
from nightly import some_now
import numpy as np
import pytest
from robots import preset
import scipy.linalg
from shapes import random_polygon, random_shape, sampled
from skin_depths import contact_loads, hidden_depth

ROBOT = preset('nine_member')
DIAMETER = 0.3


@pytest.fixture(params=[0.0, 0.1], ids=['home', 'elsewhere'])
def grip(request):
    """Return the equilibrium of a disc, at home and in another configuration."""
    travel = request.param * np.linspace(-1.0, 1.0, len(ROBOT.roller_names))
    config = ROBOT.configuration(travel)
    center = core.tangent_center(config, 'north/Z', DIAMETER, 0.01)
    body = core.ConvexObject.disc(center, DIAMETER)
    return core.settle_grasp(config, body, 2.0, (0.5, -0.3, 0.0)).equilibrium


def test_drawn_ends_of_members_agree_with_the_deformation_under_the_contact_forces(grip):
    deformed = core.deform(grip.config, {}, tube_loads=contact_loads(grip))
    lines, straight = grip.member_lines()[1], member_lines(grip.config)
    for name, line, ends in zip(ROBOT.member_names, lines, straight, strict=True):
        tube, _, joints = name.partition('/')
        for joint, node, drawn, before in zip(
            joints.split('-'), 'BC', line[[0, -1]], ends, strict=True
        ):
            moved = deformed.displacement(f'{tube}/{joint}/{node}')[:2] @ (1.0, 1.0j)
            assert drawn - before == pytest.approx(moved, abs=1e-8)


def test_force_arrows_end_on_the_object_and_are_in_balance(grip):
    arrows = held_shape.force_lines(grip, 0.02)
    center = complex(*grip.pose[:2])
    assert np.abs(arrows[:, 1] - center) == pytest.approx(0.5 * DIAMETER)
    forces = np.diff(arrows)[:, 0] / 0.02
    assert forces.sum() == pytest.approx(-0.5 + 0.3j, abs=1e-8)
    assert np.abs(forces) == pytest.approx(np.hypot(grip.normal_forces, grip.friction_forces))


def test_regions_are_on_the_object_and_as_long_as_the_contact(grip):
    regions = held_shape.region_lines(grip)
    assert np.abs(regions - complex(*grip.pose[:2])) == pytest.approx(0.5 * DIAMETER)
    lengths = np.abs(np.diff(regions)).sum(axis=1)
    assert lengths == pytest.approx(grip.patches.lengths, rel=0.03)


FILE = preset('nine_member').description
TRAPEZOID = core.Polygon([(-0.12, -0.1), (0.14, -0.1), (0.12, 0.1), (-0.12, 0.1)], 0.02)
STEP = 1e-3


def grip_of(module_mass, tube_mass, **options):
    """Return the equilibrium of a box of 2 kg between two tubes."""
    module = replace(FILE.module, mass=module_mass)
    robot = core.Robot(replace(FILE, module=module, mass_per_length=tube_mass))
    config = robot.configuration(0.1 * np.linspace(-1.0, 1.0, 6))
    body = core.place_between(config, CORNER, TRAPEZOID, 0.4, 0.01).body
    return attach_grip(config, core.ConvexObject(TRAPEZOID, body.pose, mass=2.0, **options))


def moved_parts(grip, wrench):
    """Return the pose of an object, and the displacements of pinch points, under a wrench."""
    rolled = roll_grip(grip, grip.config, wrench)
    bent, points = core.deform(grip.config, {}, tube_loads=contact_loads(rolled)), {}
    for name in grip.config.robot.module_names:
        for node in 'BC':
            points[f'{name}/{node}'] = bent.displacement(f'{name}/{node}')[:2]
    return rolled.state.unknowns[:3], points


def frequency(grip):
    """Return the lowest frequency by differences of rolled equilibria, with masses at points."""
    robot, body, flexibility, columns = grip.config.robot, grip.body, [], []
    for unit in np.eye(3):
        ends = (moved_parts(grip, sign * STEP * unit) for sign in (1.0, -1.0))
        (ahead, points), (behind, before) = ends
        pose = (ahead - behind) / (2.0 * STEP)
        flexibility.append(pose)
        moved = {name: (points[name] - before[name]) / (2.0 * STEP) for name in points}
        own = body.shape.centroid if body.center_of_mass is None else complex(*body.center_of_mass)
        away = body.turn * own
        column = [np.sqrt(body.mass) * (pose[:2] + pose[2] * np.array([-away.imag, away.real]))]
        column.append(np.sqrt(body.mass) * body.shape.gyration * pose[2:])
        for name in robot.module_names:
            middle = 0.5 * (moved[f'{name}/B'] + moved[f'{name}/C'])
            column.append(np.sqrt(robot.description.module.mass) * middle)
        for name, length in zip(robot.member_names, grip.config.member_lengths, strict=True):
            tube, _, joints = name.partition('/')
            half = np.sqrt(0.5 * robot.description.mass_per_length * length)
            for joint, node in zip(joints.split('-'), 'BC', strict=True):
                column.append(half * moved[f'{tube}/{joint}/{node}'])
        columns.append(np.concatenate(column))
    energy, work = np.array(columns) @ np.array(columns).T, np.array(flexibility)
    return np.sqrt(scipy.linalg.eigvalsh(0.5 * (work + work.T), energy)[0])


@pytest.mark.parametrize(
    ('masses', 'options'),
    [((1.5, 0.6), {'center_of_mass': (0.05, -0.04)}), ((1e-9, 1e-9), {})],
    ids=['robot-off', 'object alone-even'],
)
def test_lowest_frequency_agrees_with_differences_of_equilibria(masses, options):
    grip = grip_of(*masses, **options)
    assert held_shape.lowest_frequency(grip) == pytest.approx(frequency(grip), rel=1e-3)


def test_without_masses_there_is_no_lowest_frequency():
    home = core.Robot(FILE).home
    grip = attach_grip(home, core.place_between(home, CORNER, TRAPEZOID).body)
    assert held_shape.lowest_frequency(grip) is None


def test_a_computed_frequency_keeps_no_grip_in_memory():
    grip = grip_of(1.5, 0.6)
    assert held_shape.lowest_frequency(grip) > 0.0
    reference = weakref.ref(grip)
    del grip
    gc.collect()
    assert reference() is None


TRAVEL = [0.0012, -0.002, 0.0008, 0.0016, 0.0004, -0.0008]
PRESSURES = (30e3, 31e3, 32e3)


@pytest.mark.parametrize(
    ('shape', 'angle', 'pressures'),
    [(core.Disc(0.3), 0.4, None), (BOX, 0.2, None), (BOX, 0.0, None), (BOX, 0.2, PRESSURES)],
)
def test_restored_grip_has_the_margins_of_the_original_and_rolls_as_it(shape, angle, pressures):
    grip = with_tubes(held(shape, angle, APART), pressures)
    for _ in range(4):  # so that its friction is not that of unknown history
        there = grip.config.roller_positions + TRAVEL
        grip = roll_grip(grip, grip.config.moved_to(there))
    restored = GripRecord.of(grip).restore(HOME, grip.body)
    assert restored.pressures == pytest.approx(grip.pressures)
    assert restored.pose == pytest.approx(grip.pose, abs=1e-12)
    assert restored.state.forces == pytest.approx(grip.state.forces, abs=1e-9)
    expected = held_shape.held_joints(grip)
    assert held_shape.held_joints(restored) == pytest.approx(expected, abs=1e-9)
    assert restored.sections.used == pytest.approx(grip.sections.used, abs=1e-5)
    assert restored.slip_margin(0.5) == pytest.approx(grip.slip_margin(0.5), rel=1e-3)
    there = grip.config.moved_to(grip.config.roller_positions + 0.003)
    original, copy = roll_grip(grip, there), roll_grip(restored, there)
    assert copy.pose == pytest.approx(original.pose, abs=1e-5)
    assert copy.squeeze == pytest.approx(original.squeeze, rel=1e-3)


def test_record_of_another_structure_or_object_is_refused():
    grip = held(BOX, 0.2, APART)
    record = GripRecord.of(grip)
    with pytest.raises(StructureError, match='must be 197'):
        record._replace(bent=record.bent[1:]).restore(HOME, grip.body)
    record.contacts.corners[:] = 7
    with pytest.raises(GraspError, match='no such corners'):
        record.restore(grip.config, grip.body)


NAMES = 'nine_member', 'triangle', 'open_chain', 'bow_tie', 'ring_of_four'
ROBOTS = [preset(name) for name in NAMES]
FRICTION = 1.3
#: Depth of a corner that the centre line between nodes of the frame does not resolve [m].
TOLERANCE = 1e-4
OPEN_CHAIN = ROBOTS[2].configuration([0.094, -0.015, -0.044, -0.089, 0.020, -0.094])
CORNERS = [(-15, 186), (-120, 143), (-187, -3), (-168, -82), (33, -184), (185, -26)]
HEXAGON = core.Polygon(1e-3 * np.array(CORNERS))
DEEP = core.place_between(OPEN_CHAIN, ('middle/F-B', 'middle/C-F'), HEXAGON, -1.183, 0.0205)
#: Seeds of random grasps and their numbers. In the first ones, corners are added in all tests.
SEEDS = some_now([(103, 6), *((seed, 24) for seed in range(100, 114))])


def random_grasps(seed, count):
    """Yield random polygons that are pressed between two members in random configurations."""
    rng = np.random.default_rng(seed)
    while count:
        robot = ROBOTS[rng.integers(len(ROBOTS))]
        travel = rng.uniform(-0.1, 0.1, len(robot.roller_names))
        names = [robot.member_names[i] for i in rng.permutation(len(robot.member_names))[:2]]
        shape = random_polygon(rng, rng.uniform(0.1, 0.35), rounded=bool(rng.integers(2)))
        place = rng.uniform(-3.0, 3.0), rng.uniform(0.003, 0.025)
        try:
            config = robot.configuration(travel)
            yield config, core.place_between(config, names, shape, *place)
        except (ConfigurationError, GraspError):
            continue
        count -= 1


def test_a_hexagon_with_a_corner_in_a_tube_rests_on_this_corner():
    settled = core.settle_grasp(OPEN_CHAIN, DEEP.body, FRICTION)
    assert settled.held
    assert hidden_depth(settled.equilibrium) < TOLERANCE


@pytest.mark.parametrize(('seed', 'count'), SEEDS)
def test_settled_and_rolling_polygons_have_no_hidden_corner(seed, count):
    holds, rolled = [], []
    for number, (config, grip) in enumerate(random_grasps(seed, count)):
        settled = core.settle_grasp(config, grip.body, FRICTION, members=grip.members)
        grasp, hold = settled.equilibrium, settled.hold
        holds.append(hold)
        if grasp is not None and hold is not core.HoldStatus.OTHER_CONTACT:
            assert hidden_depth(grasp) < TOLERANCE
        rng = np.random.default_rng(seed)
        step = 3e-3 * rng.uniform(-1.0, 1.0, len(config.roller_positions))
        for _ in range(4 if settled.held and number < count // 2 else 0):
            grasp = roll_grip(grasp, config.moved_to(grasp.config.roller_positions + step))
            rolled.append(grasp is not None)
            assert grasp is None or hidden_depth(grasp) < TOLERANCE
            if grasp is None or grasp.hold(FRICTION) is not core.HoldStatus.HELD:
                break
    assert holds.count(core.HoldStatus.HELD) > count * 10 / 24
    assert holds.count(core.HoldStatus.NO_BALANCE) < count * 3 / 24
    assert np.mean(rolled) > 0.9


SAMPLED_FRICTION = 0.9
MEMBERS = [('north/P-Z', 'north/Z-R'), ('south/P-Q', 'north/R-P'), ('east/R-Y', 'east/Q-R')]
SMOOTH = [core.Disc(0.3), core.Ellipse((0.15, 0.1)), core.Ellipse((0.1, 0.14))]
SQUEEZES = (0.003, 0.006, 0.012, 0.02)
#: Shift of the polygon's frame in the object [m].
AWAY = 0.05 - 0.02j


@cache
def hold(seed, shape):
    """Return a random configuration with a smooth object in it that is held, and its members."""
    random = np.random.default_rng(seed)
    while True:
        config = NINE.configuration(random.uniform(-0.15, 0.15, 6))
        members = MEMBERS[random.integers(len(MEMBERS))]
        angle, depth = random.uniform(0.0, 2.0 * np.pi), SQUEEZES[seed % len(SQUEEZES)]
        try:
            body = core.place_between(config, members, shape, angle, depth).body
        except GraspError:
            continue
        grasp = core.settle_grasp(config, body, SAMPLED_FRICTION, members=members)
        if grasp.equilibrium is not None and abs(grasp.slip_margin) > 0.1:
            return config, body, members, grasp, random.uniform(0.0, 2.0 * np.pi)


@pytest.mark.parametrize(
    ('count', 'seed', 'shape'),
    some_now(
        dict.fromkeys([*product([24], [3], SMOOTH), *product((24, 96), range(4), SMOOTH)]),
        len(SMOOTH),
    ),
    ids=repr,
)
def test_slip_margin_is_that_of_the_smooth_shape_within_one_percent(count, seed, shape):
    config, body, members, smooth, begin = hold(seed, shape)
    polygon = sampled(shape, count, begin, AWAY)
    center = body.center - body.turn * AWAY
    there = core.ConvexObject(polygon, (center.real, center.imag, body.pose.angle))
    grasp = core.settle_grasp(config, there, SAMPLED_FRICTION, members=members)
    assert grasp.hold is smooth.hold
    assert grasp.slip_margin == pytest.approx(smooth.slip_margin, rel=0.01)
    for name, force in smooth.normal_forces.items():
        assert grasp.normal_forces[name] == pytest.approx(force, rel=0.01)


SQUARE = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
PARAMETERS = ('stiffness_scale', 'friction', 'depth', 'x', 'angle')


def holds(robot, travel, members, shape, place, parameter, shares, friction=1.3):
    """Return the hold statuses of a grasp (angle, depth), a parameter of which is varied."""
    angle, depth = place
    config, kinds = robot.configuration(travel), []
    for share in shares.tolist():
        by = dict.fromkeys(PARAMETERS, 0.0) | {parameter: share}
        body = core.place_between(config, members, shape, angle, depth * (1.0 + by['depth'])).body
        body = body.moved_to(np.add(body.pose, (0.05 * by['x'], 0.0, by['angle'])))
        scale = 1.0 + by['stiffness_scale']
        then = Robot(replace(robot.description, stiffness_scale=scale)).configuration(travel)
        coefficient = friction * (1.0 + by['friction'])
        kinds.append(core.settle_grasp(then, body, coefficient, members=members).hold)
    return kinds


def test_a_box_whose_corner_crosses_a_guide_ring_is_held():
    # At a guide ring the centre line has a kink: with a discontinuous inclination there is no
    # equilibrium for scales from 1.25 to 1.36.
    travel = [0.0371, 0.0937, 0.0703, 0.0756, 0.0687, 0.0432]
    members, shares = ('left/A-B', 'left/B-E'), np.linspace(0.2, 0.45, 16)
    box = core.Polygon(0.5 * SQUARE * (0.169, 0.135))
    place = -0.3920863517142519, 0.013
    kinds = holds(ROBOTS[2], travel, members, box, place, 'stiffness_scale', shares)
    assert set(kinds) == {core.HoldStatus.HELD}


@pytest.mark.parametrize('seed', some_now(range(200), 0))
def test_families_of_grasps_have_no_holes(seed):
    rng = np.random.default_rng(seed)
    parameter, shares = PARAMETERS[seed % len(PARAMETERS)], np.arange(-0.2, 0.2, 0.005)
    while True:
        robot = ROBOTS[rng.integers(len(ROBOTS))]
        travel = rng.uniform(-0.1, 0.1, len(robot.roller_names))
        names = [robot.member_names[i] for i in rng.permutation(len(robot.member_names))[:2]]
        shape = random_shape(rng, rng.uniform(0.05, 0.17))
        place = rng.uniform(-3.0, 3.0), rng.uniform(0.004, 0.02)
        try:
            if not holds(robot, travel, names, shape, place, 'x', np.zeros(1))[0].at_rest:
                continue
            kinds = holds(robot, travel, names, shape, place, parameter, shares)
        except (ConfigurationError, GraspError):
            continue
        break
    at_rest = np.flatnonzero([hold.at_rest for hold in kinds])
    between = kinds[at_rest[0] : at_rest[-1]] if len(at_rest) else []  # noqa: E203
    assert core.HoldStatus.NO_BALANCE not in between
