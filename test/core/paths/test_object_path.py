# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Paths of the object and of the rollers: by formulas, with the limits that they keep."""

import math
import re

from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core import load_robot, ObjectPath
from isotruss_ros.core.errors import ConfigurationError, PathError
from isotruss_ros.core.paths.roller_trajectory import RollerTrajectory
import numpy as np
import pytest
import robots
from robots import examples, generators

SPEED, TURN_RATE = 0.05, 0.4


def twist(path, time, step=1e-6):
    """Return the rate at which the pose changes from a time on (3,)."""
    return (path.pose(time + step) - path.pose(time)) / step


@pytest.mark.parametrize('smooth', [False, True])
def test_rests_at_its_ends(smooth):
    poses = [(0.2, 0.0, 1.6), (0.0, 0.2, 3.1), (-0.2, 0.0, 4.7)]
    path = ObjectPath(poses, SPEED, TURN_RATE, smooth)
    for time, pose in ((-1.0, path.poses[0]), (1e9, path.poses[-1])):
        assert path.pose(time) == pytest.approx(pose)
        assert not twist(path, time).any()
    assert not twist(path, path.duration).any()


def test_pose_at_nan_is_refused():
    path = ObjectPath([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], 0.1, 0.1)
    with pytest.raises(PathError, match='time nan s on the path: must be a number'):
        path.pose(np.nan)


def test_angles_are_unwrapped():
    angles = np.array([3.0, -3.0, 2.5, 0.0, -2.0, 1.9, 7.0])
    poses = np.column_stack([0.1 * np.arange(len(angles)), np.zeros((len(angles), 1)), angles])
    path = ObjectPath(poses, SPEED, TURN_RATE)
    assert path.poses[0, 2] == 3.0
    turns = np.diff(path.poses[:, 2])
    assert np.abs(turns).max() < math.pi
    assert np.exp(1j * path.poses[:, 2]) == pytest.approx(np.exp(1j * angles))
    assert turns[0] == pytest.approx(2.0 * math.pi - 6.0)


def test_repeated_poses_take_no_time():
    once = ObjectPath([(0, 0, 0), (0.1, 0, 0), (0.1, 0, 1)], SPEED, TURN_RATE)
    repeated = [(0, 0, 0)] * 3 + [(0.1, 0, 0)] * 2 + [(0.1, 1e-12, 0), (0.1, 0, 1), (0.1, 0, 1)]
    path = ObjectPath(repeated, SPEED, TURN_RATE)
    assert path.poses == pytest.approx(once.poses)
    assert path.times == pytest.approx(once.times)


def test_smooth_path_of_three_poses_is_the_parabola_of_the_centripetal_spline():
    poses = np.array([(0.0, 0.0, 0.0), (0.3, 0.1, 0.2), (0.4, -0.2, 0.5)])
    path = ObjectPath(poses, SPEED, TURN_RATE, smooth=True)
    # Knots are the roots of the times between poses; each segment has 64 pieces of about 5 mm.
    lengths = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    first, second = np.sqrt(lengths / SPEED)
    at = np.concatenate([np.linspace(0.0, first, 65)[:-1], np.linspace(first, first + second, 65)])
    parabola = np.polyfit([0.0, first, first + second], poses, 2)
    wanted = np.column_stack([np.polyval(parabola[:, i], at) for i in range(3)])
    assert path.poses == pytest.approx(wanted, abs=1e-9)


coordinates = st.floats(-2.0, 2.0)
paths = st.builds(
    ObjectPath,
    st.lists(
        st.tuples(coordinates, coordinates, st.floats(-1.5, 1.5)),
        min_size=2,
        max_size=8,
        unique_by=lambda pose: tuple(round(value, 3) for value in pose),
    ),
    st.floats(0.01, 1.0),
    st.floats(0.01, 2.0),
    st.booleans(),
)


@robots.examples(100)
@given(paths)
def test_one_of_the_limits_is_reached_on_every_piece(path):
    for before, after, begin, end in zip(
        path.poses, path.poses[1:], path.times, path.times[1:], strict=False
    ):
        used = math.hypot(*(after - before)[:2]) / path.speed
        turned = abs((after - before)[2]) / path.turn_rate
        assert end - begin == pytest.approx(max(used, turned), rel=1e-6, abs=1e-12)
        middle = path.pose(0.5 * (begin + end))
        assert middle == pytest.approx(0.5 * (before + after), abs=1e-9)


GOOD = [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0)]
BAD = {
    'no poses': (([], 0.1, 0.1), 'has 0 poses; must be two or more'),
    'nan': (([(0, 0, 0), (0, math.nan, 0)], 0.1, 0.1), 'must be 2 x 3 finite numbers'),
    'far': (([(0, 0, 0), (1e15, 0, 0)], 0.1, 0.1), 'at most 1e.12'),
    'half a turn': (([(0, 0, 0), (0, 0, math.pi)], 0.1, 0.1), 'pose in between'),
    'nowhere': (([(1, 1, 1)] * 5, 0.1, 0.1), 'two or more must differ'),
    'many': (([(0, 0, 0), (1, 0, 0)] * 5001, 0.1, 0.1), 'at most 10000'),
    'for ever': (([(0, 0, 0), (1, 0, 1), (2, 0, 0)], 0.1, 1e-6), 'must be at most 86400 s'),
    'no speed': ((GOOD, 0.0, 0.1), 'speed 0.0 m/s: must be from'),
    'speed of light': ((GOOD, 3e8, 0.1), 'to 10 m/s'),
    'no turn': ((GOOD, 0.1, 0.0), 'turn rate 0.0 rad/s'),
}


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('smooth', [False, True])
@pytest.mark.parametrize('case', BAD)
def test_infeasible_paths_are_refused(case, smooth):
    arguments, words = BAD[case]
    with pytest.raises(PathError, match=words):
        ObjectPath(*arguments, smooth=smooth)


ROBOT = load_robot('nine_member')
N = len(ROBOT.roller_names)
MAX_SPEED = ROBOT.description.max_speed
MAX_ACCELERATION = ROBOT.description.max_acceleration
ORIGIN = [0.0] * N


def random_path(rng, quick=1.0):
    """Return waypoints and times that take the rollers a share of their speed at most."""
    # Corners of twice the speed need so long to be rounded.
    rounding = 2.0 * quick * MAX_SPEED / MAX_ACCELERATION
    steps = rounding + 10.0 ** rng.uniform(-3.0, 1.0, rng.integers(1, 8))
    speeds = quick * MAX_SPEED * rng.uniform(-1.0, 1.0, (len(steps), N))
    begin = rng.normal(size=N)
    positions = begin + np.vstack([np.zeros(N), np.cumsum(speeds * steps[:, None], axis=0)])
    return positions, rng.choice([0.0, 1.7]) + np.append(0.0, np.cumsum(steps))


@examples(60)
@given(generators())
def test_passes_its_waypoints_but_for_rounded_corners(rng):
    positions, times = random_path(rng)
    path = RollerTrajectory(ROBOT, positions, times)
    first = np.abs(positions[1] - positions[0]).max() / (times[1] - times[0])
    late = max(0.5 * first / MAX_ACCELERATION - times[0], 0.0)
    for time, point in zip(times, positions, strict=True):
        away = np.abs(path.at(time + late).positions - point).max()
        assert away <= (2.0 * MAX_SPEED) ** 2 / (8.0 * MAX_ACCELERATION) + 1e-12
    for begin, end, before, after in zip(times, times[1:], positions, positions[1:], strict=False):
        halfway = path.at(0.5 * (begin + end) + late).positions
        assert halfway == pytest.approx(0.5 * (before + after), abs=1e-9)


@examples(60)
@given(generators())
def test_rollers_move_within_speed_and_acceleration_from_rest_to_rest(rng):
    positions, times = random_path(rng)
    path = RollerTrajectory(ROBOT, positions, times)
    for time in (-1e9, -1e-9, path.duration, path.duration + 1e-9, 1e9):
        assert path.at(time).velocities == pytest.approx(0.0, abs=1e-9)
    assert path.at(path.duration).positions == pytest.approx(positions[-1], abs=1e-12)
    assert path.at(-1.0).positions == pytest.approx(positions[0], abs=1e-12)
    small = 1e-4
    for time in [*times, *rng.uniform(-0.1, path.duration + 0.1, 30)]:
        speeds = path.at(time).velocities
        moved = path.at(time + small).positions - path.at(time - small).positions
        assert speeds == pytest.approx(moved / (2.0 * small), abs=MAX_ACCELERATION * small)
        assert np.abs(speeds).max() <= MAX_SPEED * (1.0 + 2e-6)
        step = 10.0 ** rng.uniform(-4.0, 0.0)
        change = path.at(time + step).velocities - speeds
        assert np.abs(change).max() <= MAX_ACCELERATION * step * (1.0 + 1e-6) + 1e-12


def test_refuses_more_acceleration_than_the_rollers_have():
    quick = [ORIGIN, [0.009] * N, ORIGIN]
    with pytest.raises(ConfigurationError, match=r'1\.35 m/s\^2 from point 0 to 1; must be at mo'):
        RollerTrajectory(ROBOT, quick, [0.0, 0.1, 0.2])
    RollerTrajectory(ROBOT, quick, [0.0, 0.2, 0.4])


SHORT = [0.0] * (N - 1)
PAIR, THREE = [0.0, 1.0], [ORIGIN] * 3
BAD_ROLLERS = {
    'no point': ([], PAIR, 'the trajectory has no points'),
    'too few': ([SHORT, SHORT], PAIR, f'must be {N} finite numbers'),
    'nan': ([ORIGIN, [np.nan] * N], PAIR, 'nan'),
    'too quick': ([ORIGIN, [*SHORT, -1.001 * MAX_SPEED]], PAIR, '0.1001 m/s; must be at most 0.1'),
    'without end': ([[1e308] * N, [-1e308] * N], PAIR, 'inf m/s; must be at most 0.1'),
    'too few times': (THREE, PAIR, 'must be 3 finite numbers'),
    'negative time': (THREE, [-1e-9, 1.0, 2.0], 'time -1e-09 s of point 0'),
    'the same time twice': (THREE, [0.0, 1.0, 1.0], 'time 1 s of point 2'),
    'back in time': (THREE, [0.0, 1.0, 0.5], 'time 0.5 s of point 2'),
    'a day and more': (THREE, [0.0, 1.0, 24.0 * 3600.0 + 1.0], 'from 0 to 86400 s'),
}


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize(('positions', 'times', 'words'), BAD_ROLLERS.values(), ids=BAD_ROLLERS)
def test_invalid_positions_and_times_are_refused(positions, times, words):
    with pytest.raises(ConfigurationError, match=re.escape(words)):
        RollerTrajectory(ROBOT, positions, times)
