# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Prediction of slip along paths of held objects."""

from dataclasses import replace
import math

from carries import FRICTION, make_robot, place
from held_grips import APART, AROUND, inclined_grip, NINE, numbers
from isotruss_ros import core
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.grip_record import GripRecord
from isotruss_ros.core.holding.held_grip import MIN_RELATIVE_MARGIN
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.manipulation.grip_placing import place_between
from isotruss_ros.core.model.shapes import Disc
from isotruss_ros.core.paths.object_path import ObjectPath
from isotruss_ros.core.paths.path_tracking import (
    FINISHED,
    PathPhase,
    PathTracker,
    TrackingSettings,
)
from isotruss_ros.core.planning.foresee_path import foresee_grip, foresee_path
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
from nightly import some_now
import numpy as np
import pytest
from robots import random_robot

ROBOT = make_robot()


def held(grasp):
    """Return how the object of a grasp is held at home."""
    body, members = place(ROBOT, grasp, 0.5)
    return attach_grip(ROBOT.home, body, np.array([ROBOT.member_names.index(n) for n in members]))


def foresee(grip, displacement):
    """Foresee a straight path by so much."""
    start = np.array(grip.pose)
    return foresee_path(grip, FRICTION, np.array([start, start + displacement]))


def test_a_disc_is_carried_to_the_end():
    grip = held('disc 0.2 m')
    foresight = foresee(grip, (0.2, -0.1, 0.5))
    assert (foresight.share, foresight.why) == (1.0, '')
    assert foresight.pose == pytest.approx(np.add(grip.pose, (0.2, -0.1, 0.5)), abs=1e-3)
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
    assert (
        foresight.why
        == 'the equilibrium needs a larger coefficient of friction than the given one'
    )


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


def follow_in_loop(robot, body, members, displacement, period=0.04):
    """Return the fraction of a straight path that the loop executes on the elastic plant."""
    held = core.ElasticObject(body, FRICTION)
    plant = core.SimulatedRobot(robot.home, held, core.RollerFaults())
    plant.advance(0.0)
    start = np.array(plant.object_pose)
    path = ObjectPath([start, start + displacement], SPEED, TURN_RATE)
    tracker, scale = PathTracker(path, TrackingSettings(), period), 1.0
    squeeze = SqueezeSettings(held.grasp.squeeze, pose_gain=3.0, max_utilisation=math.inf)
    settings = ServoSettings(core.Grip(members, body, FRICTION), period, 0.2, squeeze=squeeze)
    servo = core.TwistServo(robot, settings)
    for now in period * np.arange(1000):
        pose = plant.object_pose
        tracking = tracker.update(pose, 0.0, period if now else 0.0, scale)
        if tracking.phase in FINISHED:
            return 1.0 if tracking.phase is PathPhase.REACHED else tracking.progress
        state = RollerState(plant.roller_positions, plant.roller_velocities)
        servo.receive(
            twist=StampedInput(tracking.twist, now),
            rollers=StampedInput(state, now),
            pose=StampedInput(pose, now),
        )
        command = servo.decide(now).command
        scale = command.scale
        plant.command(command.roller_velocities)
        plant.advance(period)
    return 0.0


#: Speed [m/s] and turn rate [rad/s] of the paths that the loop follows.
SPEED, TURN_RATE = 0.03, 0.3


@pytest.mark.parametrize(
    ('displacement', 'is_reached'),
    some_now([((0.03, -0.03, 0.0), False), ((0.0, 0.0, 0.3), True), ((0.0, 0.06, 0.0), True)]),
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


#: Random robots with a module that holds a random disc at home.
HOLDING_SEEDS = [16, 23, 6, 12, 19, 24, 27]


@pytest.mark.parametrize('seed', some_now(HOLDING_SEEDS))
def test_random_robots_execute_paths_as_far_as_foreseen(seed):
    """The plant has elastic tubes without bound on their use, no masses, and exact sensors."""
    rng, robot = np.random.default_rng(seed), random_robot(seed)
    module = robot.module_names[rng.integers(len(robot.module_names))]
    diameter = rng.uniform(0.15, 0.4)
    center, members = (
        core.tangent_center(robot.home, module, diameter, 0.015),
        members_at(robot, module),
    )
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
