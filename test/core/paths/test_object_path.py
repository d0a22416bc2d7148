# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Paths of the object: where it should be when, by formulas, and the limits that it keeps."""

import math

from hypothesis import given, strategies
from isotruss_ros.core import ObjectPath
from isotruss_ros.core.errors import PathError
import numpy as np
import pytest
import robots

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


coordinates = strategies.floats(-2.0, 2.0)
paths = strategies.builds(
    ObjectPath,
    strategies.lists(
        strategies.tuples(coordinates, coordinates, strategies.floats(-1.5, 1.5)),
        min_size=2,
        max_size=8,
        unique_by=lambda pose: tuple(round(value, 3) for value in pose),
    ),
    strategies.floats(0.01, 1.0),
    strategies.floats(0.01, 2.0),
    strategies.booleans(),
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


@robots.examples(150)
@given(
    strategies.lists(
        strategies.tuples(*[strategies.floats() | strategies.sampled_from([0.0, 5e-10, 1e9])] * 3),
        max_size=5,
    ),
    strategies.floats(),
    strategies.floats(),
    strategies.booleans(),
)
def test_any_numbers_are_a_path_or_are_refused(poses, speed, turn_rate, smooth):
    try:
        path = ObjectPath(poses, speed, turn_rate, smooth)
    except PathError:
        return
    assert 0.0 < path.duration < math.inf
    for time in np.linspace(0.0, path.duration, 9):
        assert np.isfinite(path.pose(time)).all()
