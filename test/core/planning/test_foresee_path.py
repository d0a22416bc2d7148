# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Prediction of slip along paths, and roller positions that bring an object to a pose."""

from dataclasses import replace
import math

from carries import FRICTION, make_robot, place
from grips import disc_grip
from held_grips import APART, AROUND, box_between, inclined_grip, NINE, numbers
from hypothesis import given, settings
from hypothesis import strategies as st
from isotruss_ros import core
from isotruss_ros.core import reach_pose, Robot, RollingGrip, Status
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.grip_record import GripRecord
from isotruss_ros.core.holding.held_grip import MIN_RELATIVE_MARGIN
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.manipulation.grip_placing import place_between
from isotruss_ros.core.model.shapes import Disc
from isotruss_ros.core.paths import path_tracking
from isotruss_ros.core.paths.object_path import ObjectPath
from isotruss_ros.core.planning.foresee_path import foresee_grip, foresee_path
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from nightly import some_now
import numpy as np
import pytest
from robots import random_robot
from squeeze_loop import SqueezeLoop

ROBOT = make_robot()


def held(grasp):
    body, members = place(ROBOT, grasp, 0.5)
    return attach_grip(ROBOT.home, body, np.array([ROBOT.member_names.index(n) for n in members]))


def foresee(grip, displacement):
    """Foresee a straight path by so much."""
    start = np.array(grip.pose)
    return foresee_path(grip, FRICTION, np.array([start, start + displacement]))


def test_a_disc_is_carried_to_the_end():
    grip = held('disc 0.2 m')
    foresight = foresee(grip, (0.1, -0.05, 0.25))
    assert (foresight.share, foresight.why) == (1.0, '')
    assert foresight.pose == pytest.approx(np.add(grip.pose, (0.1, -0.05, 0.25)), abs=1e-3)
    assert 3.0 < foresight.slip_margin <= grip.slip_margin(FRICTION)


def test_a_path_ends_where_the_margin_is_the_least_one():
    grip = held('box')
    foresight = foresee(grip, (0.3, 0.2, 0.0))
    assert 0.0 < foresight.share < 0.5
    assert MIN_RELATIVE_MARGIN <= foresight.slip_margin / grip.squeeze < MIN_RELATIVE_MARGIN + 0.01
    assert 'the slip margin is' in foresight.why


def test_a_path_ends_where_friction_is_insufficient():
    grip = held('brick')
    start = np.array(grip.pose)
    foresight = foresee_path(grip, 0.9 * grip.required_friction, np.array([start, start + 0.1]))
    assert foresight.share == 0.0
    words = 'the equilibrium needs a larger coefficient of friction than the given one'
    assert foresight.why == words


def test_a_path_is_foreseen_from_the_grip_that_the_loop_has():
    grip = attach_grip(NINE.home, inclined_grip(0.0, FRICTION).body, numbers(APART))
    assert len(grip.contacts.members) == 3
    # A face that has rubbed along a member uses more friction than one of unknown history.
    rubbed = grip.anchors + np.array([0.004, -0.004])[grip.contacts.owners]
    grip = roll_grip(replace(grip, anchors=rubbed), grip.config)
    poses = np.array([grip.pose, np.add(grip.pose, (0.005, 0.0, 0.0))])
    expected = foresee_path(grip, 1.2, poses)
    foresight, anew = (
        foresee_grip(grip.config, grip.body, 1.2, poses, record)
        for record in (GripRecord.of(grip), None)
    )
    assert foresight.slip_margin == pytest.approx(expected.slip_margin, rel=0.15)
    assert anew.slip_margin > 1.3 * expected.slip_margin


def follow_in_loop(robot, body, members, displacement, obstacles=(), cycles=500, period=0.08):
    """Return the fraction of a straight path that the loop executes on the elastic plant."""
    grip = core.Grip(members, body, FRICTION)
    servo = {'bounds': ShapeBounds(), 'obstacles': obstacles}
    loop = SqueezeLoop(robot.home, grip, period=period, pose_gain=3.0, load=0.0, servo=servo)
    start, scale = np.array(loop.plant.object_pose), 1.0
    path = ObjectPath([start, start + displacement], SPEED, TURN_RATE)
    tracker = path_tracking.PathTracker(path, path_tracking.TrackingSettings(), period)
    for number in range(cycles):
        elapsed = period if number else 0.0
        tracking = tracker.update(loop.plant.object_pose, 0.0, elapsed, scale)
        if tracking.phase in path_tracking.FINISHED:
            reached = tracking.phase is path_tracking.PathPhase.REACHED
            return 1.0 if reached else tracking.progress
        command = loop.cycle(tracking.twist).command
        scale = path_tracking.speed_share(command.status, command.scale)
    return 0.0


#: Speed [m/s] and turn rate [rad/s] of the paths that the loop follows.
SPEED, TURN_RATE = 0.03, 0.3


@pytest.mark.nightly
@pytest.mark.parametrize(
    ('displacement', 'is_reached'),
    [((0.03, -0.03, 0.0), False), ((0.0, 0.0, 0.3), True), ((0.0, 0.06, 0.0), True)],
)
def test_foresight_and_control_loop_agree_near_a_singularity(displacement, is_reached):
    """In three members, a disc of 0.86 m moves 1/18 to 1/30 as fast as a roller at first."""
    body = place_between(NINE.home, AROUND, Disc(0.86), indentation=0.02).body
    body = replace(body, friction=FRICTION)
    grip = attach_grip(NINE.home, body, numbers(AROUND))
    poses = np.array([grip.pose, np.add(grip.pose, displacement)])
    foresight = foresee_path(grip, FRICTION, poses, SPEED, TURN_RATE)
    share = follow_in_loop(NINE, body, AROUND, displacement)
    assert (share == 1.0) is (foresight.share == 1.0) is is_reached
    assert share == pytest.approx(foresight.share, abs=0.02)
    assert bool(foresight.why) is not is_reached


def test_object_that_slides_along_an_obstacle_reaches_its_goal_without_delay():
    """The member beside the post slides, so a part of the feedback is blocked."""
    center = core.tangent_center(NINE.home, 'north/Z', 0.3, 0.02)
    body = core.ConvexObject.disc(center, 0.3, FRICTION)
    post = (core.Obstacle('post', core.ConvexObject.disc((1.0158, 0.32694), 0.089)),)
    members, displacement = members_at(NINE, 'north/Z'), np.array([-0.137, 0.009, -0.009])
    grip = attach_grip(NINE.home, body, numbers(members))
    poses = np.array([grip.pose, grip.pose + displacement])
    assert foresee_path(grip, FRICTION, poses, SPEED, TURN_RATE, obstacles=post).share == 1.0
    # The path takes 5 s at its full speed.
    share = follow_in_loop(NINE, body, members, displacement, post, cycles=100)
    assert share == 1.0


#: Random robots with a module that holds a random disc at home.
HOLDING_SEEDS = [27, 23, 6, 12, 16, 19, 24]


@pytest.mark.parametrize('seed', some_now(HOLDING_SEEDS))
def test_random_robots_execute_paths_as_far_as_foreseen(seed):
    """The plant has elastic tubes without bound on their use, no masses, and exact sensors."""
    rng, robot = np.random.default_rng(seed), random_robot(seed)
    module = robot.module_names[rng.integers(len(robot.module_names))]
    diameter = rng.uniform(0.15, 0.4)
    center = core.tangent_center(robot.home, module, diameter, 0.015)
    members = members_at(robot, module)
    body = replace(core.ConvexObject.disc(center, diameter), mass=0.5, friction=FRICTION)
    indices = np.array([robot.member_names.index(name) for name in members])
    grip = attach_grip(robot.home, body, indices)
    heading, length = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(0.03, 0.2)
    turn = rng.uniform(-0.4, 0.4)
    displacement = np.array([length * math.cos(heading), length * math.sin(heading), turn])
    poses = np.array([grip.pose, np.add(grip.pose, displacement)])
    foresight = foresee_path(grip, FRICTION, poses, SPEED, TURN_RATE)
    share = follow_in_loop(robot, body, members, displacement)
    assert share == pytest.approx(foresight.share, abs=0.01)


GRIP = disc_grip(NINE.home, 'north/Z', shift=0.01)
SIDES = box_between(angle=0.2)


@settings(max_examples=6, deadline=None)
@given(
    grip=st.sampled_from([GRIP, SIDES]),
    move=st.tuples(*[st.floats(-0.04, 0.04)] * 2, st.floats(-0.2, 0.2)),
)
def test_the_pose_is_reached_and_the_contacts_are_kept(grip, move):
    goal = np.add(grip.body.pose, move)
    result = reach_pose(NINE.home, grip, goal)
    assert (result.status, result.why, result.share) == (Status.OK, '', pytest.approx(1.0))
    assert result.pose == pytest.approx(goal, abs=1e-7)
    rolled = RollingGrip.attach(NINE.home, grip)
    for positions in result.path[1:]:
        rolled = rolled.moved_to(rolled.config.moved_to(positions))
        assert rolled.misfit < 1e-4
    assert rolled.pose == pytest.approx(result.pose, abs=1e-9)


def test_there_and_back_the_rollers_are_where_they_were():
    there = reach_pose(NINE.home, GRIP, np.add(GRIP.body.pose, (0.03, -0.03, 0.15)))
    back = reach_pose(there.config, GRIP.moved_to(there.pose), GRIP.body.pose)
    assert back.roller_positions == pytest.approx(NINE.home.roller_positions, abs=1e-6)


def test_a_length_that_ends_the_way_is_named_with_the_place():
    file = replace(NINE.description, max_length=1.05)
    robot = Robot(file)
    result = reach_pose(robot.home, GRIP, np.add(GRIP.body.pose, (0.0, -0.5, 0.0)))
    assert result.status is Status.SLOWED_MEMBER_LENGTH
    assert result.why.startswith('limits of ')
    assert 0.0 < result.share < 1.0
    assert result.config.member_lengths.max() <= 1.05 + 1e-6
    assert result.pose.y == pytest.approx(GRIP.body.pose.y - 0.5 * result.share, abs=1e-3)


def test_a_barrier_ends_the_way():
    config = NINE.configuration([0.065, 0.509, 0.0, 0.0, 0.197, 0.099])
    grip = disc_grip(config, 'east/Q')
    result = reach_pose(config, grip, np.add(grip.body.pose, (0.4, 0.0, 0.0)))
    assert result.status is Status.SLOWED_SELF_COLLISION
    assert result.why == 'limits of module south/P and member south/Q-X'
    assert 0.0 < result.share < 1.0


def test_motions_that_the_rollers_do_not_produce_are_told():
    grip = disc_grip(NINE.home, 'south/X')
    result = reach_pose(NINE.home, grip, np.add(grip.body.pose, (0.1, 0.0, 0.0)))
    assert result.status is Status.UNREACHABLE
    assert result.why == 'the rollers produce 1 of 3 motions there'
    assert (result.share, len(result.path)) == (0.0, 1)
