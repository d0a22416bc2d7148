# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Roller positions that bring a held object to a pose."""

from dataclasses import replace

from grips import disc_grip
from held_grips import box_between
from hypothesis import given, settings
from hypothesis import strategies as st
from isotruss_ros.core import reach_pose, Robot, RollingGrip, Status
import numpy as np
import pytest
from robots import preset

ROBOT = preset('nine_member')
GRIP = disc_grip(ROBOT.home, 'north/Z', shift=0.01)
SIDES = box_between(angle=0.2)


@settings(max_examples=6, deadline=None)
@given(
    grip=st.sampled_from([GRIP, SIDES]),
    move=st.tuples(*[st.floats(-0.04, 0.04)] * 2, st.floats(-0.2, 0.2)),
)
def test_the_pose_is_reached_and_the_contacts_are_kept(grip, move):
    goal = np.add(grip.body.pose, move)
    result = reach_pose(ROBOT.home, grip, goal)
    assert (result.status, result.why, result.share) == (Status.OK, '', pytest.approx(1.0))
    assert result.pose == pytest.approx(goal, abs=1e-7)
    rolled = RollingGrip.attach(ROBOT.home, grip)
    for positions in result.path[1:]:
        rolled = rolled.moved_to(rolled.config.moved_to(positions))
        assert rolled.misfit < 1e-4
    assert rolled.pose == pytest.approx(result.pose, abs=1e-9)


def test_there_and_back_the_rollers_are_where_they_were():
    there = reach_pose(ROBOT.home, GRIP, np.add(GRIP.body.pose, (0.03, -0.03, 0.15)))
    back = reach_pose(there.config, GRIP.moved_to(there.pose), GRIP.body.pose)
    assert back.roller_positions == pytest.approx(ROBOT.home.roller_positions, abs=1e-6)


def test_a_length_that_ends_the_way_is_named_with_the_place():
    file = replace(ROBOT.description, max_length=1.05)
    robot = Robot(file)
    result = reach_pose(robot.home, GRIP, np.add(GRIP.body.pose, (0.0, -0.5, 0.0)))
    assert result.status is Status.SLOWED_MEMBER_LENGTH
    assert result.why.startswith('limits of ')
    assert 0.0 < result.share < 1.0
    assert result.config.member_lengths.max() <= 1.05 + 1e-6
    assert result.pose.y == pytest.approx(GRIP.body.pose.y - 0.5 * result.share, abs=1e-3)


def test_a_barrier_ends_the_way():
    config = ROBOT.configuration([0.065, 0.509, 0.0, 0.0, 0.197, 0.099])
    grip = disc_grip(config, 'east/Q')
    result = reach_pose(config, grip, np.add(grip.body.pose, (0.4, 0.0, 0.0)))
    assert result.status is Status.SLOWED_SELF_COLLISION
    assert result.why == 'limits of module south/P and member south/Q-X'
    assert 0.0 < result.share < 1.0


def test_motions_that_the_rollers_do_not_produce_are_told():
    grip = disc_grip(ROBOT.home, 'south/X')
    result = reach_pose(ROBOT.home, grip, np.add(grip.body.pose, (0.1, 0.0, 0.0)))
    assert result.status is Status.UNREACHABLE
    assert result.why == 'the rollers produce 1 of 3 motions there'
    assert (result.share, len(result.path)) == (0.0, 1)
