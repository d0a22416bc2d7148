# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Closing on a free object and letting go: it stays at its pose on the elastic plant."""

import functools
import itertools
import math
import re

from held_grips import AROUND, HOME
from isotruss_ros import core
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.grip_record import GripRecord
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.planning.release import plan_release
from isotruss_ros.core.safety.margins import object_distances
from nightly import some_now
import numpy as np
import pytest
from robots import preset
from shapes import BRICK

CLEARANCE, CENTER = 0.05, (0.6, 0.3)
MEMBERS = members_at(HOME.robot, 'north/Z')
SMALL_BOX = core.Polygon([(-0.12, -0.1), (0.12, -0.1), (0.12, 0.1), (-0.12, 0.1)], 0.02)
#: Angles count at an arm [m].
ARMS = np.array([1.0, 1.0, 0.2])
SMALL = core.ConvexObject.disc(CENTER, 0.2)


@functools.lru_cache(maxsize=8)
def grasped(body, members=MEMBERS):
    needs = core.GraspRequirements(members=members, squeeze=8.0, count=1)
    return core.plan_grasps(HOME, body, needs, max_rounds=1, thorough=False)[0]


def drive(robot, path, parts=30):
    """Let a simulated robot follow a path."""
    for begin, end in itertools.pairwise(path):
        robot.command((end - begin) / parts)
        for _ in range(parts):
            robot.advance(1.0)


def disc(diameter, angle):
    return core.ConvexObject(core.Disc(diameter), (*CENTER, angle))


@pytest.mark.parametrize(
    ('body', 'members', 'moved', 'parts'),
    some_now(
        [
            (core.ConvexObject(BRICK, (0.716, 0.5, 0.2)), None, 3e-3, 5),
            (core.ConvexObject(BRICK, (0.716, 0.5, 0.2)), None, 3e-3, 30),
            (disc(0.2, 0.0), MEMBERS, 3e-4, 30),
            (disc(0.3, 0.7), members_at(HOME.robot, 'north/R'), 3e-4, 30),
            (disc(0.3, 2.5), MEMBERS, 3e-4, 30),
            (disc(0.2, -3.1), members_at(HOME.robot, 'north/P'), 3e-4, 30),
            (core.ConvexObject(core.Disc(0.6), (0.716, -0.4134, 0.2)), AROUND, 3e-3, 30),
        ]
    ),
)
def test_a_released_object_stays_at_its_pose(body, members, moved, parts):
    """A simulated robot follows the path in so many parts of each of its steps."""
    grasp, thing = grasped(body, members), core.ElasticObject(body, 0.5)
    follow = functools.partial(drive, parts=parts)
    robot = core.SimulatedRobot(HOME, thing, core.RollerFaults())
    follow(robot, grasp.path)
    assert set(thing.grasp.member_names) == set(grasp.grip.members)
    assert thing.grasp.squeeze == pytest.approx(8.0, rel=0.25)
    held = np.array(robot.object_pose)
    assert held[:2] == pytest.approx(body.pose[:2], abs=3e-3)
    release = plan_release(robot.config, body.moved_to(held), grasp.grip.members, CLEARANCE)
    assert release.violation is None
    squeezes, apart = [thing.grasp.squeeze], release.apart
    for piece in itertools.pairwise(release.path[:apart]):
        follow(robot, piece)
        squeezes.append(0.0 if thing.grasp is None else thing.grasp.squeeze)
        assert ARMS * robot.object_pose == pytest.approx(ARMS * held, abs=moved)
    assert (np.diff(squeezes) <= 0.0).all()
    shares = np.array(squeezes) / squeezes[0]
    assert shares == pytest.approx(np.linspace(1.0, 0.0, apart), abs=0.08)
    assert squeezes[-1] < 0.01 * squeezes[0]
    follow(robot, release.path[[apart - 1, apart]])
    assert thing.grasp is None
    follow(robot, release.path[apart:])
    lies = np.array(robot.object_pose)
    assert ARMS * lies == pytest.approx(ARMS * held, abs=2.0 * moved)
    gaps = object_distances(robot.config, body.moved_to(lies))
    ours = [HOME.robot.member_names.index(name) for name in grasp.grip.members]
    assert gaps[ours] == pytest.approx(CLEARANCE, abs=1e-3)
    assert gaps.min() > 0.01


def test_contacts_that_share_a_face_do_not_slip_in_the_release():
    body = core.ConvexObject(SMALL_BOX, (0.629, 0.276, -1.671), friction=0.8)
    needs = core.GraspRequirements(members=MEMBERS, squeeze=15.0, count=1)
    plan = core.plan_grasps(HOME, body, needs, max_rounds=1, thorough=False)
    grasp, thing = plan[0], core.ElasticObject(body, 0.8)
    robot = core.SimulatedRobot(HOME, thing, core.RollerFaults())
    drive(robot, grasp.path, 3)
    held, friction = robot.object_pose, thing.grasp.required_friction
    record = GripRecord.of(thing.grasp)
    release = plan_release(robot.config, body.moved_to(held), MEMBERS, CLEARANCE, record)
    for piece in itertools.pairwise(release.path[: release.apart - 1]):
        drive(robot, piece, 4)
        assert thing.grasp.required_friction < friction + 0.2
        assert ARMS * robot.object_pose == pytest.approx(ARMS * held, abs=2e-3)
    first = release.apart - 2
    drive(robot, release.path[first:], 4)
    assert ARMS * robot.object_pose == pytest.approx(ARMS * held, abs=2e-3)


def test_a_release_that_turns_the_object_by_more_than_allowed_is_no_path():
    body = core.ConvexObject(BRICK, (0.716, 0.5, 0.2))
    grasp = grasped(body, None)
    config = HOME.robot.configuration(grasp.path[-1])
    names = grasp.grip.members
    violation = plan_release(config, body, names, CLEARANCE, max_turn=0.0).violation
    assert (violation.requirement, violation.bound) == ('turned', 0.0)
    most = 2.0 * violation.value
    assert plan_release(config, body, names, CLEARANCE, max_turn=most).violation is None


def test_an_object_that_is_barely_touched_is_left_at_once_and_again():
    held = grasped(SMALL)
    config = HOME.robot.configuration(held.path[held.touch])
    for clearance in (CLEARANCE, 1.5 * CLEARANCE):
        release = plan_release(config, SMALL, MEMBERS, clearance)
        assert (release.violation, release.apart) == (None, 1)
        config = HOME.robot.configuration(release.path[-1])


def test_other_members_do_not_hold_it():
    other = members_at(HOME.robot, 'south/P')
    release = plan_release(grasped(SMALL).config, SMALL, other, CLEARANCE)
    violation = release.violation
    assert (violation.requirement, violation.value, violation.bound) == ('held', 0.0, 1.0)
    assert release.path.shape == (0, len(HOME.roller_positions))


@pytest.mark.parametrize('clearance', [0.0, -1.0, np.inf, np.nan, 1e160])
def test_a_clearance_is_positive_and_within_the_robot(clearance):
    with pytest.raises(GraspError, match=re.escape(f'clearance {clearance:.6g} m')):
        plan_release(HOME, SMALL, MEMBERS, clearance)


MODULE, FRICTION = 'north/Z', 0.5
BODY = core.ConvexObject.disc((0.6, 0.3), 0.3)


@functools.lru_cache(maxsize=8)
def planned(**values):
    needs = core.GraspRequirements(friction=FRICTION, module=MODULE, count=1, **values)
    return core.plan_grasps(HOME, BODY, needs, thorough=False)[0]


@pytest.mark.parametrize(
    ('squeeze', 'parts'), some_now([(15.0, 5), (8.0, 20), (None, 20), (15.0, 40)])
)
def test_a_free_object_stays_at_its_pose_while_the_planned_grip_closes(squeeze, parts):
    grasp = planned(squeeze=squeeze)
    if squeeze is not None:
        assert grasp.squeeze == pytest.approx(squeeze, rel=2e-3)
    simulated, held = core.ElasticObject(BODY, FRICTION), []
    robot = core.SimulatedRobot(HOME, simulated, core.RollerFaults())
    for piece in itertools.pairwise(grasp.path):
        drive(robot, piece, parts)
        held.append(simulated.grasp is not None)
    # Nothing presses before the touch, and all of it is held from there on.
    assert held == [False] * grasp.touch + [True] * (len(grasp.path) - 1 - grasp.touch)
    assert simulated.grasp.squeeze == pytest.approx(grasp.squeeze, rel=0.01)
    assert simulated.slip_margin == pytest.approx(grasp.slip_margin, rel=0.02)
    assert robot.object_pose[:2] == pytest.approx(BODY.pose[:2], abs=4e-4)
    assert abs(robot.object_pose.angle) < math.radians(0.2)


def test_a_robot_with_two_rollers_displaces_the_object_by_little():
    home, body = preset('triangle').home, core.ConvexObject.disc((0.716, 0.5), 0.4)
    needs = core.GraspRequirements(module='main/T', count=1)
    (grasp,) = core.plan_grasps(home, body, needs, thorough=False)
    away = abs(grasp.grip.center - body.center)
    assert 1e-4 < away < 0.25 * home.robot.description.tube_diameter
    config = preset('triangle').configuration(grasp.path[-1])
    settled = core.settle_grasp(config, grasp.grip.body, FRICTION)
    assert settled.held
    assert settled.slip_margin == pytest.approx(grasp.slip_margin, rel=1e-3)
