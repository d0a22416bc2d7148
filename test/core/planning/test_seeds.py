# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What the search for grasps tries: which modules, how far open, which sides, toward what."""

import math

import closings
from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core import Cylinder, GraspError, GraspRequirements, load_robot
from isotruss_ros.core.planning.seeds import find_seeds
import numpy as np
import pytest
import robots

NINE = load_robot('nine_member')
INSIDE = Cylinder((0.716, 0.5), 0.2)
LATER = range(1, 5)
SCENES = st.integers(0, 24)


def meeting_at(robot, module):
    """Return the members that meet at a module, by their names."""
    tube, joint = module.split('/')
    return {
        i
        for i, name in enumerate(robot.member_names)
        if name.startswith(f'{tube}/') and joint in name.split('/')[1].split('-')
    }


def around(config, point):
    """Return the tubes whose loops go around a point: a ray from it leaves them an odd time."""
    begin, end, _ = closings.parts(config)
    topology, found = config.robot.topology, set()
    for tube in range(len(config.robot.description.tubes)):
        members = np.flatnonzero(topology.tube == tube)
        corners = np.column_stack([begin[members], end[members]]).ravel() - point
        others = np.roll(corners, -1)
        passing = (corners.imag > 0.0) != (others.imag > 0.0)
        with np.errstate(divide='ignore', invalid='ignore'):
            share = corners.imag / (corners.imag - others.imag)
            right = (corners + share * (others - corners)).real > 0.0
        if (passing & right).sum() % 2:
            found.add(tube)
    return found


@robots.examples(20)
@given(seed=SCENES, friction=st.floats(0.0, 3.0))
def test_first_round_opens_every_module_around_the_object_twice(seed, friction):
    config, cylinder, tube = closings.scene(seed)
    robot, needs = config.robot, GraspRequirements(friction=friction)
    found = find_seeds(config, cylinder, needs, 0, 0)
    tubes = around(config, complex(*cylinder.center))
    assert tube in tubes
    modules = [i for i in range(len(robot.module_names)) if robot.topology.tube[i] in tubes]
    pairs = [one for one in found if len(one.members) == 2]
    assert [one.module for one in pairs] == [i for i in modules for _ in range(2)]
    widest = 2.0 * math.atan(friction)
    for wide, narrow in zip(pairs[::2], pairs[1::2], strict=True):
        for one, share in ((wide, 0.8), (narrow, 0.56)):
            assert set(one.members) == meeting_at(robot, robot.module_names[one.module])
            assert one.opening == pytest.approx(min(max(share * widest, 0.1), 2.8))
    # The wedges hold: the angle from the normals to the middle is less than that of friction.
    if friction > 0.1:
        assert all(math.tan(0.5 * one.opening) < friction for one in pairs)


def test_grips_open_by_shares_of_what_friction_holds():
    needs = GraspRequirements(module='north/Z', friction=0.5, squeeze=10.0)
    openings = [seed.opening for seed in find_seeds(NINE.home, INSIDE, needs, 0, 0)]
    assert np.tan(0.5 * np.array(openings) / (0.8, 0.56)) == pytest.approx(0.5)


@robots.examples(20)
@given(seed=SCENES)
def test_first_round_has_one_grip_by_three_sides_for_each_loop(seed):
    config, cylinder, _ = closings.scene(seed)
    robot = config.robot
    threes = [
        o for o in find_seeds(config, cylinder, GraspRequirements(), 0, 0) if len(o.members) > 2
    ]
    tubes = around(config, complex(*cylinder.center))
    assert [robot.topology.tube[one.module] for one in threes] == sorted(tubes)
    gaps = closings.gaps(config, cylinder)[0]
    for one in threes:
        two, (third,) = one.members[:2], one.members[2:]
        assert set(two) == meeting_at(robot, robot.module_names[one.module])
        tube = robot.topology.tube[one.module]
        assert all(robot.topology.tube[i] == tube for i in one.members)
        others = [
            gaps[i] for i in range(len(gaps)) if robot.topology.tube[i] == tube and i not in two
        ]
        assert gaps[third] == min(others)
        # Three sides hold whatever the angle between two of them is.
        assert one.opening == 2.8


@robots.examples(15)
@given(seed=SCENES, number=st.sampled_from(LATER), friction=st.floats(0.2, 2.0))
def test_later_rounds_draw_modules_openings_and_postures(seed, number, friction):
    config, cylinder, _ = closings.scene(seed)
    robot, needs = config.robot, GraspRequirements(friction=friction)
    found = find_seeds(config, cylinder, needs, seed, number)
    again = find_seeds(config, cylinder, needs, seed, number)
    assert len(found) == len(again) == 8
    tubes = around(config, complex(*cylinder.center))
    for one, other in zip(found, again, strict=True):
        assert robot.topology.tube[one.module] in tubes
        assert set(one.members) == meeting_at(robot, robot.module_names[one.module])
        assert len(one.members) == 2
        share = one.opening / (2.0 * math.atan(friction))
        assert 0.4 <= share <= 0.9 or one.opening in (0.1, 2.8)
        assert one.nominal_posture.shape == config.roller_positions.shape
        assert (one.module, one.opening) == (other.module, other.opening)
        assert (one.nominal_posture == other.nominal_posture).all()


def test_what_is_drawn_is_another_in_every_round_and_with_every_seed():
    config = NINE.home
    drawn = {
        (seed, number): find_seeds(config, INSIDE, GraspRequirements(), seed, number)
        for seed in range(6)
        for number in LATER
    }
    pulls = np.array([one.nominal_posture for found in drawn.values() for one in found])
    assert len(np.unique(pulls.round(12), axis=0)) == len(pulls)
    # Around where the robot is, 0.3 of a member away.
    spread = 0.3 * np.mean(config.robot.home.member_lengths)
    assert pulls.std() == pytest.approx(spread, rel=0.05)
    assert abs(pulls.mean()) < 0.1 * spread
    moved = NINE.configuration([0.05, -0.05, 0.02, 0.03, -0.04, 0.05])
    for one, other in zip(
        find_seeds(moved, INSIDE, GraspRequirements(), 2, 1), drawn[2, 1], strict=True
    ):
        assert one.nominal_posture - moved.roller_positions == pytest.approx(other.nominal_posture)
    modules = {NINE.module_names[one.module] for found in drawn.values() for one in found}
    assert modules == {'north/R', 'north/P', 'north/Z'}
    openings = [one.opening for found in drawn.values() for one in found]
    assert np.ptp(openings) > 0.4 * 2.0 * math.atan(0.5)


def test_postures_are_drawn_in_lengths_of_the_members():
    config, cylinder, _ = closings.scene(7)
    length = config.member_lengths.mean()
    assert length > 2.0
    drawn = np.array(
        [
            one.nominal_posture - config.roller_positions
            for number in range(1, 17)
            for one in find_seeds(config, cylinder, GraspRequirements(), 0, number)
        ]
    )
    assert drawn.std() == pytest.approx(0.3 * length, rel=0.2)


def test_a_small_slip_margin_asks_for_two_members_too():
    for margin, fewest in ((0.0, 3), (0.05, 2)):
        found = find_seeds(NINE.home, INSIDE, GraspRequirements(min_slip_margin=margin), 0, 0)
        assert max(len(one.members) for one in found) == fewest


@pytest.mark.parametrize('number', [0, 1])
def test_a_module_that_is_asked_for_is_the_only_one(number):
    for module in ('north/R', 'north/P', 'north/Z'):
        found = find_seeds(NINE.home, INSIDE, GraspRequirements(module=module), 0, number)
        assert found
        assert {NINE.module_names[one.module] for one in found} == {module}
    elsewhere = GraspRequirements(module='east/R')
    assert find_seeds(NINE.home, INSIDE, elsewhere, 0, number) == []
    with pytest.raises(GraspError, match='north/Q'):
        find_seeds(NINE.home, INSIDE, GraspRequirements(module='north/Q'), 0, number)


def test_an_object_outside_or_in_the_middle_of_all_has_no_loop_around_it():
    # The middle triangle of the three is no loop of a tube.
    for center in ((0.5, 2.0), (-1.0, 0.0), (0.5, -0.3)):
        for number in (0, 1):
            assert (
                find_seeds(NINE.home, Cylinder(center, 0.1), GraspRequirements(), 0, number) == []
            )


@pytest.mark.parametrize(
    ('values', 'lengths'),
    [({}, (0.25, 2.0)), ({'min_length': 0.5}, (0.5, 2.0)), ({'max_length': 1.5}, (0.25, 1.5))],
)
def test_bounds_are_those_required_or_of_the_robot_file(values, lengths):
    needs = GraspRequirements(min_rigidity=0.31, **values)
    config = NINE.home
    for number in (0, 1):
        for one in find_seeds(config, INSIDE, needs, 0, number):
            assert (one.body, one.min_rigidity) == (INSIDE, 0.31)
            (limit,) = one.limits
            rows = limit.rows(config)
            # Half of what is left in one step, so that it is never crossed.
            half = 0.5 * (np.array(lengths)[:, None] - config.member_lengths)
            assert rows.lower == pytest.approx(half[0])
            assert rows.upper == pytest.approx(half[1])
