# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulated objects, elastically held or rigid, on a robot with faults of its rollers."""

from dataclasses import replace

from grips import backed_off, disc_grip, gripped
from held_grips import box_between, NINE
from isotruss_ros import core
from isotruss_ros.core import ConvexObject, ElasticObject, HoldStatus, Robot, settle_grasp
from isotruss_ros.core.errors import ConfigurationError, GraspError
from isotruss_ros.core.kinematics.depths import member_depths
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


@pytest.mark.parametrize('scale', [1.0, 0.7])
def test_the_object_is_held_if_the_settled_grasp_is(scale):
    robot = Robot(replace(ROBOT.description, stiffness_scale=scale))
    settled = settle_grasp(robot.configuration(CONFIG.roller_positions), CYLINDER, FRICTION)
    simulated = held(stiffness_scale=scale)
    assert simulated.pose(CONFIG) == pytest.approx(settled.pose, abs=1e-9)
    assert simulated.slip_margin == pytest.approx(settled.slip_margin, rel=1e-6)
    forces = dict(zip(simulated.grasp.member_names, simulated.grasp.normal_forces, strict=True))
    assert forces == pytest.approx(settled.normal_forces, rel=1e-6)


@pytest.mark.parametrize('scale', [1.0, 0.7])
def test_the_pose_depends_on_the_configuration_and_not_on_the_path(scale):
    simulated, other = held(stiffness_scale=scale), held(stiffness_scale=scale)
    for one in (simulated, other):
        one.external_wrench = (0.5, -0.3, 0.01)
    start, places = follow(simulated, [CONFIG.roller_positions]), walk(20)
    away = follow(simulated, places)
    assert np.hypot(*np.subtract(away[:2], start[:2])) > 5e-3
    corner = CONFIG.roller_positions + np.array([0.01, -0.01, 0.0, 0.01, 0.0, -0.01])
    by_another = [corner, 0.5 * (corner + places[-1]), places[-1]]
    assert follow(other, by_another) == pytest.approx(away, abs=1e-9)
    back = follow(simulated, [*places[::-1], CONFIG.roller_positions])
    assert back == pytest.approx(start, abs=1e-9)


def test_a_lost_object_is_pushed_out_of_the_grip_and_stays_lost():
    simulated = held()
    before = follow(simulated, walk(20))
    config = simulated.grasp.config
    simulated.external_wrench = (200.0, 0.0, 0.0)
    simulated.follow(config)
    assert simulated.dropped in (HoldStatus.SLIPS, HoldStatus.NO_CONTACT, HoldStatus.NO_BALANCE)
    assert 0.0 < np.hypot(*np.subtract(simulated.pose(config)[:2], before[:2])) < 0.2
    assert simulated.pose(config).angle == pytest.approx(before.angle, abs=0.01)
    lost = ConvexObject.disc(simulated.pose(config)[:2], CYLINDER.shape.diameter)
    assert member_depths(config, lost).max() == pytest.approx(0.0, abs=1e-8)
    simulated.external_wrench = (0.0, 0.0, 0.0)
    simulated.follow(config)
    assert simulated.grasp is None


@pytest.mark.parametrize('seed', range(3))
def test_an_object_is_lost_within_five_percent_of_the_required_friction(seed):
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


@pytest.mark.parametrize('steps', [4, 40])
def test_an_object_is_held_from_the_first_contact_with_two_members_on(steps):
    simulated = ElasticObject(CYLINDER, FRICTION)
    for config in backed_off(CONFIG, CYLINDER, 0.15, steps=steps)[::-1]:
        simulated.follow(config)
        if simulated.grasp is None:
            # One member pushes the object a little.
            assert simulated.pose(config) == pytest.approx(CYLINDER.pose, abs=0.01)
    # A wedge that keeps its angle carries the object and does not squeeze it.
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


@pytest.mark.parametrize('stiffness_scale', [0.0, -0.1, np.nan])
def test_a_stiffness_scale_is_positive(stiffness_scale):
    with pytest.raises(GraspError, match='stiffness'):
        ElasticObject(CYLINDER, 0.5, stiffness_scale)


def test_an_object_that_leaves_its_grip_stays_at_its_last_pose():
    thing = core.RigidObject(core.RollingGrip.attach(NINE.home, box_between()))
    apart = np.array([0.25, -0.3, 0.3, 0.2, -0.3, 0.25])
    near, far = (NINE.home.moved_to(share * apart) for share in (0.1, 1.0))
    thing.follow(near)
    last = thing.pose(near)
    thing.follow(far)
    assert thing.rolling is None
    assert thing.pose(far) == pytest.approx(last)
    assert last != pytest.approx(box_between().body.pose, abs=1e-3)


GRASP = disc_grip(NINE.home, 'north/Z')
SPEEDS = np.linspace(-0.02, 0.03, N)


def simulated(**faults):
    """Return a robot at home with the object in its grip."""
    held = core.RigidObject(core.RollingGrip.attach(NINE.home, GRASP))
    return core.SimulatedRobot(NINE.home, held, core.RollerFaults(**faults), seed=3)


def test_travel_is_speed_times_time_for_any_steps():
    whole, cut = simulated(), simulated()
    for robot, steps in ((whole, 1), (cut, 200)):
        robot.command(SPEEDS)
        for _ in range(steps):
            robot.advance(2.0 / steps)
    assert whole.config.roller_positions == pytest.approx(2.0 * SPEEDS, abs=1e-12)
    assert cut.config.roller_positions == pytest.approx(2.0 * SPEEDS, abs=1e-12)
    assert cut.config.points == pytest.approx(whole.config.points, abs=1e-11)
    assert tuple(cut.object_pose) == pytest.approx(tuple(whole.object_pose), abs=1e-9)


def test_stuck_rollers_rest_and_others_keep_the_speed_limit():
    robot = simulated(speed_limit=0.01, stuck=frozenset({NINE.roller_names[0]}))
    robot.command(10.0 * SPEEDS)
    robot.advance(1.0)
    assert robot.roller_velocities[0] == 0.0
    assert np.abs(robot.roller_velocities).max() == 0.01


def test_noise_of_moving_rollers_has_its_deviation():
    robot = simulated(noise=0.004)
    robot.command(1e-9 * (np.arange(N) == 1))
    speeds = []
    for _ in range(500):
        robot.advance(1e-4)
        speeds.append(robot.roller_velocities)
    speeds = np.array(speeds)
    assert not np.delete(speeds, 1, axis=1).any()
    # The deviation of 500 draws is known to 3 %; five of these are 16 %.
    assert speeds[:, 1].std() == pytest.approx(0.004, rel=0.16)
    assert abs(speeds[:, 1].mean()) < 5 * 0.004 / np.sqrt(500)


def test_encoders_do_not_measure_slip():
    robot, perfect = simulated(slip=0.1), simulated()
    for one in (robot, perfect):
        one.command(SPEEDS)
        one.advance(2.0)
    assert robot.roller_positions == pytest.approx(perfect.roller_positions, abs=1e-15)
    assert robot.roller_velocities == pytest.approx(SPEEDS)
    moves = SPEEDS != 0.0
    shares = 1.0 - robot.config.roller_positions[moves] / robot.roller_positions[moves]
    assert shares.min() >= 0.05
    assert shares.max() <= 0.15
    assert len(set(shares.round(9))) == moves.sum()  # each roller has its own
    # The object is where the tubes took it, and the way back leads home.
    assert (
        robot.object_pose == core.RollingGrip.attach(NINE.home, GRASP).moved_to(robot.config).pose
    )
    robot.command(-SPEEDS)
    robot.advance(2.0)
    assert robot.config.roller_positions == pytest.approx(np.zeros(N), abs=1e-15)


@pytest.mark.parametrize('bad', [[0.0] * (N + 1), [np.nan] * N, 'fast', None])
def test_a_bad_command_changes_nothing(bad):
    robot = simulated()
    robot.command(SPEEDS)
    with pytest.raises(ConfigurationError, match='roller velocities'):
        robot.command(bad)
    robot.advance(1.0)
    assert robot.roller_velocities == pytest.approx(SPEEDS)


def test_rollers_block_where_no_configuration_exists():
    robot = simulated()
    robot.command(SPEEDS)
    robot.advance(0.1)
    before = robot.config
    robot.command(-10.0 * (np.arange(N) == 0))
    with pytest.raises(ConfigurationError):
        robot.advance(1.0)
    assert robot.config is before
    assert not robot.roller_velocities.any()
