# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Paths in the model: slip, roller positions for a pose, and grasps that close and let go."""

from dataclasses import replace
import functools
import itertools
import math
import re

from carries import FRICTION, make_robot, place
from grips import disc_grip
from held_grips import APART, AROUND, box_between, HOME, inclined_grip, NINE, numbers
from hypothesis import given, settings
from hypothesis import strategies as st
from isotruss_ros import core
from isotruss_ros.core import reach_pose, Robot, RollingGrip, Status
from isotruss_ros.core.errors import GraspError
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
from isotruss_ros.core.planning.release import plan_release
from isotruss_ros.core.safety.margins import object_distances
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from nightly import some_now
import numpy as np
import pytest
from robots import preset, random_robot
from shapes import BRICK
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
    grip = roll_grip(grip.with_anchors(rubbed), grip.config)
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


@pytest.mark.nightly
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


def hold_amid(diameter):
    """Return a disc held by three members in the middle of the robot, and a loop at rest."""
    shape = Disc(diameter)
    body = place_between(HOME, AROUND, shape, indentation=0.01).body
    settled = core.settle_grasp(HOME, body, friction=FRICTION, members=AROUND)
    grip = core.Grip(AROUND, body, FRICTION)
    loop = SqueezeLoop(HOME, grip, servo={'bounds': ShapeBounds()})
    for _ in range(25):
        loop.cycle()
    loop.decisions.clear()
    return settled.equilibrium, loop


AMID = [
    (diameter, leg)
    for diameter in (0.85, 0.87, 0.89)
    for leg in ((0.0, 0.03, 0.0), (0.03, 0.0, 0.0), (0.0, 0.0, 0.1), (-0.03, 0.02, 0.1))
]


@pytest.mark.parametrize(('diameter', 'leg'), some_now(AMID, 2))
def test_a_path_near_a_singular_task_takes_the_time_that_is_foreseen(diameter, leg):
    grip, loop = hold_amid(diameter)
    foresight = foresee(grip, leg)
    assert (foresight.share, foresight.why) == (1.0, '')
    start = np.array(loop.plant.object_pose)
    path = ObjectPath([start, start + leg], 0.02, 0.2)
    tracker = path_tracking.PathTracker(path, path_tracking.TrackingSettings(), loop.period)
    scale, elapsed, left = 1.0, 0.0, []
    while True:
        pose = core.Pose(*loop.plant.object_pose)
        tracking = tracker.update(pose, 0.0, loop.period if loop.decisions else 0.0, scale)
        left.append(foresight.time_left(tracking.progress))
        if tracking.phase in path_tracking.FINISHED:
            break
        decision = loop.cycle(tracking.twist)
        tracker.allow_for_inertia(decision.frequency)
        scale = path_tracking.speed_share(decision.command.status, decision.command.scale)
        elapsed += loop.period
    assert tracking.phase is path_tracking.PathPhase.REACHED
    assert elapsed > 1.5 * path.duration
    assert elapsed / 1.3 < foresight.duration < 1.3 * elapsed
    # The time left is as true on the way as at the start.
    assert left[len(left) // 2] == pytest.approx(0.5 * elapsed, abs=0.2 * elapsed)
    assert left[-1] < 0.2 * elapsed
    assert max(loop.statuses) < Status.HALT_NO_TWIST
    assert Status.UNREACHABLE not in loop.statuses


@pytest.mark.parametrize(('diameter', 'leg'), some_now(AMID, 2))
def test_the_scale_of_a_twist_near_a_singular_task_is_the_part_that_is_executed(diameter, leg):
    grip, loop = hold_amid(diameter)
    weights, start = np.array([1.0, 1.0, grip.arm]), np.array(loop.plant.object_pose)
    for _ in range(100):
        decision = loop.cycle(0.5 * np.array(leg))
    wanted = weights * leg
    moved = weights * (np.array(loop.plant.object_pose) - start)
    said = np.mean([decision.command.scale for decision in loop.decisions])
    assert said < 0.95
    assert moved @ wanted / (wanted @ wanted) == pytest.approx(said, abs=0.03)
    assert Status.UNREACHABLE not in loop.statuses
    assert 'the rank of the task' in decision.command.limiting
    assert re.search(r'sliding with \d+(\.\d)? %, along \(.*\) m/s, .* rad/s', decision.message)


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


@pytest.mark.nightly
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


MODULE, LOW_FRICTION = 'north/Z', 0.5
BODY = core.ConvexObject.disc((0.6, 0.3), 0.3)


@functools.lru_cache(maxsize=8)
def planned(**values):
    needs = core.GraspRequirements(friction=LOW_FRICTION, module=MODULE, count=1, **values)
    return core.plan_grasps(HOME, BODY, needs, thorough=False)[0]


@pytest.mark.parametrize(
    ('squeeze', 'parts'), some_now([(15.0, 5), (8.0, 20), (None, 20), (15.0, 40)])
)
def test_a_free_object_stays_at_its_pose_while_the_planned_grip_closes(squeeze, parts):
    grasp = planned(squeeze=squeeze)
    if squeeze is not None:
        assert grasp.squeeze == pytest.approx(squeeze, rel=2e-3)
    simulated, held = core.ElasticObject(BODY, LOW_FRICTION), []
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
    settled = core.settle_grasp(config, grasp.grip.body, LOW_FRICTION)
    assert settled.held
    assert settled.slip_margin == pytest.approx(grasp.slip_margin, rel=1e-3)


@pytest.mark.parametrize('module', ['upper/D', 'upper/C'])
def test_a_path_that_four_rollers_cannot_follow_ends_with_the_reason(module):
    home = preset('bow_tie').home
    body = place_between(home, members_at(home.robot, module), Disc(0.3), indentation=0.006).body
    held = attach_grip(home, body)
    x, y, angle = held.pose
    foresight = foresee_path(held, 0.8, [held.pose, (x + 0.1, y, angle)])
    assert foresight.why == 'out of reach: the rollers move the object in 2 of 3 directions'
