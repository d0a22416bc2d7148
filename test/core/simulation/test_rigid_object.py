# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulated robot with faults of its rollers, and a rigid object on it."""

from grips import disc_grip
from held_grips import box_between, NINE
from isotruss_ros import core
from isotruss_ros.core.errors import ConfigurationError
import numpy as np
import pytest

N = len(NINE.roller_names)


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


def test_a_replaced_object_is_at_its_own_pose():
    robot, other = simulated(), core.ElasticObject(core.ConvexObject.disc((0.1, 0.2), 0.1), 0.5)
    robot.replace_object(other)
    assert robot.object_pose == (0.1, 0.2, 0.0)


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
