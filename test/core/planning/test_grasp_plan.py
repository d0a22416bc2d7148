# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plans of grasps: times of the path, closest violation, and summaries."""

from hypothesis import given
from isotruss_ros.core import ConvexObject, GraspRequirements, plan_grasps
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.paths.roller_trajectory import RollerTrajectory
from isotruss_ros.core.planning.grasp_plan import export_path, path_times
from isotruss_ros.core.planning.violations import (
    BOUNDS,
    SearchTally,
    SENTENCES_BY_REQUIREMENT,
    Violation,
)
import numpy as np
import pytest
from robots import examples, generators, preset

HOME = preset('nine_member').home
SIDES = ('south/P-Q', 'north/R-P')


@pytest.fixture(scope='module')
def grasp():
    """Plan one grasp."""
    needs = GraspRequirements(module='north/Z', squeeze=10.0, count=1)
    return plan_grasps(HOME, ConvexObject.disc((0.6, 0.3), 0.3), needs, thorough=False)[0]


@examples(50)
@given(generators())
def test_path_times_keep_the_acceleration_of_the_rollers(rng):
    robot = HOME.robot
    steps = rng.uniform(-0.1, 0.1, (rng.integers(1, 20), 6)) * 10.0 ** rng.uniform(-3.0, 0.0)
    path = np.vstack([np.zeros(6), np.cumsum(steps, axis=0)])
    times = path_times(path, robot.description, rng.random(len(steps)) < 0.3)
    RollerTrajectory(robot, path, times)


def test_a_path_is_slow_from_two_waypoints_before_the_touch_on(grasp):
    exported = export_path(grasp)
    assert exported['touch'] == grasp.touch > 2
    assert np.array(exported['path']) == pytest.approx(grasp.path)
    longest = np.abs(np.diff(grasp.path, axis=0)).max(axis=1)
    speeds = longest / np.diff(exported['times'])
    full = HOME.robot.description.max_speed
    fast = np.arange(len(speeds)) < grasp.touch - 2
    assert speeds == pytest.approx(np.minimum(np.where(fast, full, 0.25 * full), longest / 0.01))


def test_the_closest_violation_is_the_latest_one_and_of_bounds_the_nearest():
    ordered = [
        Violation('no step', 0.0, 0.0),
        Violation('free', -0.1, 0.0),
        Violation('reach', 0.1, 0.0),
        Violation('held', 0.0, 1.0),
        Violation('min_slip_margin', -1.0, 0.5),
        Violation('max_total_force', 16.0, 8.0),
        Violation('min_slip_margin', 0.2, 0.25),
    ]
    for several in (ordered, ordered[::-1]):
        tally = SearchTally()
        for violation in several:
            tally.add(SearchTally(2, 1, violation))
        assert tally == SearchTally(14, 7, ordered[-1])
    distances = [violation.distance for violation in ordered]
    assert distances == sorted(distances, reverse=True)


def test_every_violation_has_words():
    for name in SENTENCES_BY_REQUIREMENT | BOUNDS:
        words = str(Violation(name, 0.125, 0.25))
        assert words.startswith(f'{name}: ')
        assert ('12% of its path' in words) == (name == 'carry')
        assert '{' not in words


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({'friction': -0.1}, 'friction'),
        ({'min_slip_margin': float('inf')}, 'min_slip_margin'),
        ({'max_contact_force': -1.0}, 'max_contact_force'),
        ({'external_wrench': (0.0, 1.0)}, 'external_wrench'),
        ({'direction': (0.0, 0.0, 0.0), 'measure': 'stiffness'}, 'direction'),
        ({'measure': 'beauty'}, 'measure'),
        ({'squeeze': 0.0}, 'squeeze'),
        ({'count': 0}, 'count'),
        ({'min_length': '1'}, 'min_length'),
        ({'members': 'north/Z-R'}, 'members .*north/Z-R.*: must be two or three different'),
        (
            {'members': SIDES, 'module': 'north/Z'},
            "module: 'north/Z', and members .*: only one of the two",
        ),
    ],
)
def test_requirements_out_of_range_are_refused(values, words):
    with pytest.raises(GraspError, match=words):
        GraspRequirements(**values)
