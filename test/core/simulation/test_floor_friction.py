# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A held object that rubs on the floor: it stays up to a limit, and lags beyond."""

from dataclasses import replace

from grips import gripped
from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core import ElasticObject, Grip, Robot, solve_twist
from isotruss_ros.core.holding.loaded_frame import natural_modes
from isotruss_ros.core.simulation.floor_friction import limit_loads
from isotruss_ros.core.simulation.held_motion import STEP
import numpy as np
import pytest

CONFIG, CYLINDER = gripped(35.0, squeeze=0.1)
ROBOT = CONFIG.robot
FRICTION, LIMIT = 0.5, 0.4
EVEN = np.array([1.0, 1.0, CYLINDER.arm])


def held(limit=LIMIT):
    """Return the object on a floor."""
    made = ElasticObject(CYLINDER, FRICTION, ground_friction=limit)
    made.follow(CONFIG)
    assert made.grasp is not None
    return made


def pose(made):
    """Return where the object is (3,), its turn over the arm [m]."""
    return EVEN * np.array(made.pose(CONFIG))


def pull(made, *sizes, direction=(0.6, -0.8, 0.0)):
    """Pull with one force after the other [N]."""
    for size in sizes:
        made.external_wrench = EVEN * size * np.array(direction)
        made.follow(CONFIG)


def drag(made, direction, length=0.02, steps=40):
    """Move the robot so that a free object would go along a direction; return its shape."""
    config = CONFIG
    for _ in range(steps):
        grip = Grip.at_module(config.robot, 'north/Z', CYLINDER.moved_to(made.pose(config)))
        twist = np.array(direction) * length / steps
        config = config.moved_to(
            config.roller_positions + solve_twist(config, grip, twist).roller_velocities
        )
        made.follow(config)
    return config


@pytest.mark.parametrize('direction', [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)])
def test_a_push_below_the_limit_moves_nothing(direction):
    made = held()
    before = pose(made)
    pull(made, 0.1, 0.39, direction=direction)
    assert pose(made) == pytest.approx(before, abs=1e-9)


def test_a_push_beyond_the_limit_is_met_by_the_limit_against_the_motion():
    rubbing, free = held(), held(limit=0.0)
    before = pose(rubbing)
    pull(rubbing, 0.7)
    moved, friction = pose(rubbing) - before, rubbing._floor.loads
    assert friction == pytest.approx(-LIMIT * moved / np.linalg.norm(moved), abs=1e-3)
    pull(free, 1.0, direction=0.7 * np.array([0.6, -0.8, 0.0]) + friction)
    assert pose(rubbing) == pytest.approx(pose(free), abs=1e-8)


def test_what_was_pushed_stays_where_it_was_pushed_to_until_twice_the_limit_is_gone():
    made = held()
    pull(made, 0.7)
    away = pose(made)
    pull(made, 0.4, 0.0, -0.05)
    assert pose(made) == pytest.approx(away, abs=1e-9)
    pull(made, -0.2)
    assert np.linalg.norm(pose(made) - away) > 1e-5


def test_the_lag_of_a_dragged_object_is_the_limit_over_the_stiffness():
    rubbing = held()
    start = pose(rubbing)
    config = drag(rubbing, (0.0, 1.0, 0.0))
    lag = rubbing.grasp
    compliance = EVEN[:, None] * lag.response.pose
    free = ElasticObject(CYLINDER, FRICTION)
    free.follow(CONFIG)
    free.follow(config)
    motion = pose(rubbing) - start
    friction = -LIMIT * motion / np.linalg.norm(motion)
    assert pose(rubbing) - pose(free) == pytest.approx(compliance @ friction, rel=0.1, abs=2e-5)


def test_the_rate_does_not_count():
    slow, quick = held(), held()
    drag(slow, (0.0, 1.0, 0.0), steps=100)
    drag(quick, (0.0, 1.0, 0.0), steps=20)
    assert pose(slow) == pytest.approx(pose(quick), abs=1e-4)


@given(st.integers(0, 9999), st.floats(0.0, 3.0))
def test_what_stays_within_its_limit_stands_and_what_is_at_it_slides_against_it(seed, size):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(7, 7))
    compliance, away = root @ root.T + 0.1 * np.eye(7), size * rng.normal(size=7)
    limits = np.array([1.0, 0.5, 0.5])
    loads = limit_loads(away, compliance, limits, np.zeros(7))
    moved = away + compliance @ loads
    for block, limit in zip((slice(3), slice(3, 5), slice(5, 7)), limits, strict=True):
        friction, motion = np.linalg.norm(loads[block]), moved[block]
        assert friction <= limit * (1.0 + 1e-9)
        if friction < 0.999 * limit:
            assert motion == pytest.approx(np.zeros(len(motion)), abs=1e-5)
        assert loads[block] @ motion == pytest.approx(-friction * np.linalg.norm(motion), abs=1e-5)


def test_where_joints_hardly_rub_an_object_gives_a_little_less():
    gives = []
    for limit in (0.0, 0.01, 0.3, 50.0):
        made = ElasticObject(CYLINDER, FRICTION, module_friction=limit)
        made.follow(CONFIG)
        before = pose(made)
        pull(made, 1.0)
        gives.append(np.linalg.norm(pose(made) - before))
    assert gives == sorted(gives, reverse=True)
    assert gives[1] > 0.9 * gives[0]
    assert gives[3] < 0.8 * gives[0]


def test_joints_that_slide_are_held_back_by_the_limit_and_others_stand():
    made = ElasticObject(CYLINDER, FRICTION, module_friction=0.15)
    made.follow(CONFIG)
    before = made.joints(CONFIG)
    pull(made, 1.0)
    moved, friction = made.joints(CONFIG) - before, made._floor.loads[3:].reshape(-1, 2)
    slides = np.hypot(*moved.T) > 1e-6
    assert 0 < slides.sum() < len(moved)
    sizes = np.hypot(*friction.T)
    assert sizes[slides] == pytest.approx(0.15)
    assert sizes.max() <= 0.15 * (1.0 + 1e-6)
    along = moved[slides] / np.hypot(*moved[slides].T)[:, None]
    assert friction[slides] == pytest.approx(-0.15 * along, abs=1e-3)


def test_a_swing_on_the_floor_shrinks_by_the_same_length_each_half_of_it():
    # By 2 F / k, and by what the implicit steps damp: omega h / 2.
    module = replace(ROBOT.description.module, mass=1.0)
    robot = Robot(replace(ROBOT.description, damping_ratio=1e-6, module=module))
    config, limit = robot.home.moved_to(CONFIG.roller_positions), 0.02
    made = ElasticObject(replace(CYLINDER, mass=0.5), FRICTION, ground_friction=limit)
    made.follow(config)
    modes = natural_modes(made.grasp)
    omega, wrench, rest = modes.frequencies[0], modes.wrenches[:, 0], pose(made)
    shape = EVEN[:, None] * made.grasp.response.pose @ wrench
    size = np.linalg.norm(shape)
    made.external_wrench = EVEN * wrench / np.linalg.norm(wrench)
    made.follow(config)
    made.external_wrench = np.zeros(3)
    places = [(pose(made) - rest) @ shape / size]
    for _ in range(200):
        made.follow(config, 0.005)
        places.append((pose(made) - rest) @ shape / size)
    turns = 1 + np.flatnonzero(np.diff(places)[:-1] * np.diff(places)[1:] < 0.0)
    shift, damped = limit * (size / omega) ** 2, np.exp(-np.pi * omega * STEP / 2.0)
    swings = np.abs(np.array(places)[[0, *turns[:5]]])
    assert swings[1:] == pytest.approx((swings[:-1] - shift) * damped - shift, rel=0.05)
