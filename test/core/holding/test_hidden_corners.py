# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random grasps: polygons with many or hidden corners, and families without holes."""

from dataclasses import replace
from functools import cache
from itertools import product

from held_grips import NINE
from isotruss_ros import core
from isotruss_ros.core.errors import ConfigurationError, GraspError
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.kinematics.robot import Robot
from nightly import some_now
import numpy as np
import pytest
from robots import preset
from shapes import random_polygon, random_shape, sampled
from skin_depths import hidden_depth

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
def held(seed, shape):
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
    config, body, members, smooth, begin = held(seed, shape)
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
