# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Paths of the rollers: straight between waypoints, at rest before and after, or refused."""

import re

from hypothesis import given
from isotruss_ros.core import load_robot
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.paths.roller_trajectory import RollerTrajectory
import numpy as np
import pytest
from robots import examples, generators

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
BAD = {
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
@pytest.mark.parametrize(('positions', 'times', 'words'), BAD.values(), ids=BAD)
def test_invalid_positions_and_times_are_refused(positions, times, words):
    with pytest.raises(ConfigurationError, match=re.escape(words)):
        RollerTrajectory(ROBOT, positions, times)
