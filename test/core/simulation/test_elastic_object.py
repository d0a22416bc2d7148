# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The elastic plant: the object is where the equilibrium puts it, rolls, slips and is dropped."""

from grips import backed_off, gripped
from isotruss_ros.core import ConvexObject, ElasticObject, Grip, HoldStatus, settle_grasp
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
import numpy as np
import pytest

CONFIG, CYLINDER = gripped(35.0, squeeze=0.1)
ROBOT = CONFIG.robot
N = len(ROBOT.roller_names)
FRICTION = 0.5


def held(**arguments):
    """Return an object that the robot holds."""
    held_object = ElasticObject(CYLINDER, arguments.pop('friction', FRICTION), **arguments)
    held_object.follow(CONFIG)
    assert held_object.grasp is not None
    return held_object


def walk(count, seed=0, step=4e-3):
    """Return roller positions of a random walk from the grip."""
    steps = np.random.default_rng(seed).uniform(-step, step, (count, N))
    return CONFIG.roller_positions + np.cumsum(steps, axis=0)


def follow(simulated, places):
    """Lead an object along roller positions."""
    for place in places:
        simulated.follow(CONFIG.moved_to(place))
    return simulated.pose(CONFIG)


def test_the_object_is_held_if_the_settled_grasp_is():
    settled = settle_grasp(CONFIG, CYLINDER, FRICTION)
    simulated = held()
    assert simulated.pose(CONFIG) == pytest.approx(settled.pose, abs=1e-9)
    assert simulated.slip_margin == pytest.approx(settled.slip_margin, rel=1e-6)
    forces = dict(
        zip(simulated.grasp.member_names, simulated.grasp.state.normal_forces, strict=True)
    )
    assert forces == pytest.approx(settled.normal_forces, rel=1e-6)


@pytest.mark.parametrize('scale', [1.0, 0.7])
def test_along_a_path_and_back_it_returns(scale):
    simulated = held(stiffness_scale=scale)
    start, places = simulated.pose(CONFIG), walk(20)
    away = follow(simulated, places)
    assert np.hypot(*np.subtract(away[:2], start[:2])) > 5e-3
    corner = CONFIG.roller_positions + np.array([0.01, -0.01, 0.0, 0.01, 0.0, -0.01])
    by_another = [corner, 0.5 * (corner + places[-1]), places[-1]]
    assert follow(held(stiffness_scale=scale), by_another) == pytest.approx(away, abs=1e-9)
    back = follow(simulated, [*places[::-1], CONFIG.roller_positions])
    assert back == pytest.approx(start, abs=1e-9)


def pull_until_dropped(simulated, direction, step=0.5):
    """Return the load at which the object is dropped [N]."""
    for number in range(1, 2000):
        simulated.external_wrench = number * step * direction
        simulated.follow(CONFIG)
        if simulated.grasp is None:
            return number * step
    raise AssertionError('not dropped')


def test_the_object_is_lost_beyond_the_slip_margin_with_the_reason():
    margin = held().slip_margin
    found = [
        pull_until_dropped(held(), np.array([np.cos(turn), np.sin(turn), 0.0]))
        for turn in np.linspace(0.0, 2.0 * np.pi, 4, endpoint=False)
    ]
    assert min(found) > 0.97 * margin
    simulated = held()
    simulated.external_wrench = (200.0, 0.0, 0.0)
    before = simulated.pose(CONFIG)
    simulated.follow(CONFIG)
    assert simulated.dropped in (HoldStatus.SLIPS, HoldStatus.NO_CONTACT, HoldStatus.NO_BALANCE)
    # It gave way until it slipped, out of the grip, and lies where the members end to push it.
    assert 0.0 < np.hypot(*np.subtract(simulated.pose(CONFIG)[:2], before[:2])) < 0.2
    lies = ConvexObject.disc(simulated.pose(CONFIG)[:2], CYLINDER.shape.diameter)
    assert member_depths(CONFIG, lies).max() == pytest.approx(0.0, abs=1e-8)
    simulated.external_wrench = (0.0, 0.0, 0.0)
    simulated.follow(CONFIG)
    assert simulated.grasp is None


def test_friction_just_above_what_is_required_holds_and_just_below_does_not():
    required = settle_grasp(CONFIG, CYLINDER, FRICTION).required_friction
    for share, scale, holds in ((1.001, 1.0, True), (0.999, 1.0, False), (0.0, 0.01, False)):
        simulated = ElasticObject(CYLINDER, share * required, stiffness_scale=scale)
        assert simulated.slip_margin == 0.0
        simulated.follow(CONFIG)
        assert (simulated.grasp is not None) == holds


@pytest.mark.parametrize('seed', range(4))
def test_along_a_path_it_is_dropped_within_five_percent_of_the_predicted_friction(seed):
    path = [CONFIG, *(CONFIG.moved_to(place) for place in walk(15, seed, step=8e-3))]
    rough, needed = held(friction=5.0), []
    for config in path:
        rough.follow(config)
        needed.append(rough.grasp.required_friction)
    for share in (1.05, 0.95):
        simulated, stays = ElasticObject(CYLINDER, share * max(needed)), []
        for config in path:
            simulated.follow(config)
            stays.append(simulated.grasp is not None)
        assert all(stays) == (share > 1.0)


def test_the_object_rests_until_two_members_press_on_it():
    simulated = ElasticObject(CYLINDER.moved_to((*CYLINDER.pose[:2], 0.4)), FRICTION)
    approach = backed_off(CONFIG, CYLINDER, 0.15)[::-1]
    held_at = []
    for config in approach:
        simulated.follow(config)
        held_at.append(simulated.grasp is not None)
        if not held_at[-1]:
            # The member that comes first pushes it a little.
            assert simulated.pose(config) == pytest.approx((*CYLINDER.pose[:2], 0.4), abs=5e-3)
    assert not held_at[0]
    assert held_at[-1]
    assert held_at == sorted(held_at)


@pytest.mark.parametrize('steps', [4, 10, 40])
def test_a_wedge_that_keeps_its_angle_carries_it_along_and_does_not_squeeze(steps):
    # However coarse the steps are: it is held from the first touch on, and not from the last step.
    simulated = ElasticObject(CYLINDER, FRICTION)
    for config in backed_off(CONFIG, CYLINDER, 0.15, steps=steps)[::-1]:
        simulated.follow(config)
    assert 0.0 < simulated.grasp.squeeze < 1.0


def test_a_wedge_too_wide_for_the_friction_pushes_it_out():
    config, cylinder = gripped(70.0, squeeze=0.02)
    simulated = ElasticObject(cylinder, FRICTION)
    simulated.follow(config)
    assert simulated.grasp is None
    lies = ConvexObject.disc(simulated.pose(config)[:2], cylinder.shape.diameter)
    assert np.sort(member_depths(config, lies))[-2:] == pytest.approx([0.0, 0.0], abs=1e-6)
    # Along the bisector, by 20 mm.
    out = abs(lies.center - cylinder.center)
    assert out == pytest.approx(0.02, rel=1e-3)


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        ({'friction': -0.1}, 'must be from 0 to 10'),
        ({'friction': np.inf}, 'friction'),
        ({'friction': 0.5, 'stiffness_scale': 0.0}, 'stiffness'),
        ({'friction': 0.5, 'stiffness_scale': -0.1}, 'stiffness'),
    ],
)
def test_bad_arguments_are_refused(arguments, words):
    with pytest.raises(GraspError, match=words):
        ElasticObject(ConvexObject.disc((0.0, 0.0), 0.3), **arguments)
    with pytest.raises(GraspError, match='external wrench'):
        held().external_wrench = (1.0, 2.0)


def test_in_one_long_step_an_object_slips_where_it_does_in_many():
    rows = grip_jacobian(CONFIG, Grip.at_module(CONFIG.robot, 'north/Z', CYLINDER))
    travel = np.linalg.pinv(rows) @ [-0.0155, 0.0401, -0.1125, 0.0749]
    angles = []
    for steps in (1, 64):
        simulated = ElasticObject(CYLINDER, 0.4)
        simulated.follow(CONFIG)
        for part in range(1, steps + 1):
            there = CONFIG.moved_to(CONFIG.roller_positions + part / steps * travel)
            simulated.follow(there)
            if simulated.grasp is None:
                break
        assert simulated.dropped is HoldStatus.SLIPS
        # Members push what slips, and do not turn it.
        angles.append(simulated.pose(there).angle)
    assert angles[1] == pytest.approx(-0.057, abs=1e-3)
    assert angles[0] == pytest.approx(angles[1], abs=2e-3)
