# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Moving obstacles: evasion, halt where none is possible, and silence of their publisher."""

from dataclasses import replace
import itertools

from driven import Driven
from grips import held_at
from isotruss_ros.core import (
    ConvexObject,
    Disc,
    Grip,
    load_robot,
    Obstacle,
    Robot,
    Status,
    tangent_center,
)
from isotruss_ros.core.inputs import StampedInput
from isotruss_ros.core.model.obstacle import MAX_OBSTACLES
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from isotruss_ros.core.servo.obstacle_evasion import ObstacleTracks, TRACKED_TIME
from nightly import some_now
import numpy as np
import pytest
from rooms import clearance
from squeeze_loop import SqueezeLoop

ROBOT = load_robot('nine_member')
QUICK = Robot(replace(ROBOT.description, max_acceleration=5.0))
BOUND, PERIOD = 0.02, 0.01
HELD = held_at(QUICK.home, 'north/Z', 0.3)


class Room:
    """A hand that moves at constant velocity, and a robot that is told of it."""

    def __init__(self, hand, held=HELD, **settings):
        self.hand, self.robot = hand, Driven(held, PERIOD, **settings)

    def step(self, twist, published=True):
        """Go on for one cycle; return the decision and the clearance at its end [m]."""
        robot = self.robot
        if published:
            seen = self.hand.at(robot.now + PERIOD)
            robot.servo.receive(obstacles=StampedInput((seen,), seen.stamp))
        command = robot.step(twist)
        return command, clearance(robot.held, [self.hand.at(robot.now + PERIOD)])


def approaching(way, speed, distance=0.5):
    """Return a hand that moves toward the held object from a direction."""
    x, y, _ = HELD.pose
    away = np.array([np.cos(way), np.sin(way)])
    place = np.array([x, y]) + distance * away
    return Obstacle('hand', ConvexObject(Disc(0.1), (*place, 0.0)), (*(-speed * away), 0.0), 0.0)


@pytest.mark.parametrize(
    ('twist', 'way', 'speed', 'distance'),
    some_now(
        [
            ((0.02, 0.0, 0.1), -0.5 * np.pi, 0.06, 0.24),
            ((0.0, 0.0, 0.0), 0.1, 0.19, 0.4),
            ((0.0, 0.0, 0.0), -0.5 * np.pi, 0.03, 0.23),
            *(((0.0, 0.0, 0.0), way, 0.16, 0.4) for way in (0.8, 2.8)),
        ]
    ),
)
def test_robot_evades_a_hand_that_is_slower_than_its_rollers(twist, way, speed, distance):
    room, evaded = Room(approaching(way, speed, distance)), False
    for _ in range(60):
        command, gap = room.step(twist)
        assert gap > BOUND - 1e-3
        evaded |= any(name.endswith('and obstacle hand') for name in command.limiting)
    assert evaded
    assert command.status < Status.HALT_NO_TWIST


def test_hand_faster_than_the_rollers_halts_the_robot_and_is_named():
    room = Room(approaching(-0.5 * np.pi, 1.0, 0.6))
    statuses = []
    for _ in range(45):
        command, gap = room.step((0.0, 0.0, 0.0))
        statuses.append(command.status)
        if gap < 0.0:
            break
    assert Status.HALT_OBSTACLE in statuses
    robot = room.robot
    decision = robot.servo.decide(robot.now + PERIOD)
    assert 'the object and obstacle hand: touch' in decision.message


def test_hand_that_comes_halts_a_robot_without_a_working_roller():
    room = Room(approaching(-0.5 * np.pi, 0.3, 0.3))
    room.robot.servo.receive(failed=ROBOT.roller_names)
    statuses = [room.step((0.0, 0.01, 0.0))[0].status for _ in range(30)]
    assert statuses[-1] is Status.HALT_OBSTACLE


def test_post_at_rest_far_away_does_not_hide_a_cart_that_comes():
    x, y, _ = HELD.pose
    post = Obstacle('post', ConvexObject.disc((x + 6.0, y), 0.1), stamp=0.0)
    cart = replace(approaching(0.5 * np.pi, 0.5, 1.5), name='cart')
    robot, gap = Driven(HELD, PERIOD), np.inf
    while gap > 0.05:
        seen = tuple(obstacle.at(robot.now + PERIOD) for obstacle in (post, cart))
        robot.servo.receive(obstacles=StampedInput(seen, seen[0].stamp))
        command = robot.step_late((0.0, 0.0, 0.0), PERIOD)
        gap = clearance(robot.held, [cart.at(robot.now + PERIOD)])
    assert command.status is Status.HALT_OBSTACLE


@pytest.mark.parametrize('way', [0.8, 2.8])
def test_no_roller_is_faster_than_its_limit_while_the_robot_evades(way):
    room, evaded = Room(approaching(way, 0.16, 0.4)), False
    for _ in range(60):
        command, _ = room.step((0.0, 0.0, 0.0))
        evaded |= command.status is Status.SLOWED_OBSTACLE
        fastest = np.abs(command.roller_velocities).max()
        assert fastest <= ROBOT.description.max_speed + 1e-9
    assert evaded


def test_receding_obstacle_allows_no_faster_approach_than_one_at_rest():
    x = HELD.pose.x
    speeds = []
    for velocity in ((0.0, 0.0, 0.0), (0.0, -0.3, 0.0)):
        held = held_at(QUICK.home, 'north/Z', 0.3)
        robot = Driven(held, PERIOD, max_object_acceleration=100.0, slide_along_limits=False)
        for _ in range(10):
            # At the end of each cycle, the obstacle is 30 mm from the object.
            below = robot.held.pose.y - 0.15 - 0.05 - 0.03
            place = (x, below - 2.0 * PERIOD * velocity[1], 0.0)
            hand = Obstacle('hand', ConvexObject(Disc(0.1), place), velocity, robot.now)
            robot.servo.receive(obstacles=StampedInput((hand,), hand.stamp))
            command = robot.step_late((0.0, -0.3, 0.0), PERIOD)
        assert 'the object and obstacle hand' in command.limiting
        speeds.append(-command.achieved_twist[1])
    assert speeds[1] <= 1.05 * speeds[0]


def test_silent_obstacle_is_where_it_was_and_then_halts_the_robot_with_its_name():
    hand = replace(approaching(-0.5 * np.pi, 0.0), velocity=(0.0, 0.0, 0.0))
    room = Room(hand, obstacle_timeout=0.3)
    room.step((0.01, 0.0, 0.0))
    for _ in range(29):
        command, _ = room.step((0.01, 0.0, 0.0), published=False)
        assert command.status < Status.HALT_NO_TWIST
    for _ in range(3):
        command, _ = room.step((0.01, 0.0, 0.0), published=False)
    assert command.status is Status.HALT_STALE_OBSTACLES
    decision = room.robot.servo.decide(room.robot.now)
    assert 'moving obstacle hand: 0.3' in decision.message
    command, _ = room.step((0.01, 0.0, 0.0))
    assert command.status < Status.HALT_NO_TWIST


def test_robot_goes_on_when_the_hand_is_gone():
    x, y, _ = HELD.pose
    hand = Obstacle('hand', ConvexObject.disc((x, y - 0.25), 0.1), stamp=0.0)
    room = Room(hand)
    for _ in range(25):
        room.step((0.0, -0.15, 0.0))
    before = room.robot.held.pose.y
    assert before > y - 0.05
    room.hand = replace(hand, body=hand.body.moved_to((x + 3.0, y, 0.0)))
    for _ in range(25):
        room.step((0.0, -0.15, 0.0))
    assert room.robot.held.pose.y < before - 0.03


@pytest.mark.parametrize('tells_velocity', [True, False])
def test_hand_is_evaded_whether_it_tells_its_velocity_or_only_its_poses(tells_velocity):
    hand = approaching(-0.5 * np.pi, 0.08, 0.3)
    least, room = np.inf, Room(hand)
    for _ in range(175):
        seen = hand.at(room.robot.now + PERIOD)
        if not tells_velocity:
            seen = replace(seen, velocity=(0.0, 0.0, 0.0))
        room.robot.servo.receive(obstacles=StampedInput((seen,), seen.stamp))
        _, gap = room.step((0.0, 0.0, 0.0), published=False)
        least = min(least, gap)
    assert least > 0.005


@pytest.mark.parametrize('period', [0.01, 0.03])
def test_velocity_of_poses_is_their_mean_over_the_tracked_time_whatever_their_rate(period):
    rng, tracks, velocities = np.random.default_rng(1), ObstacleTracks(), []
    for number in range(300):
        place = 1e-3 * rng.standard_normal(2)
        body = ConvexObject.disc(place, 0.1)
        time = number * period
        tracks = tracks.updated([Obstacle('hand', body, stamp=time)])
        (samples,) = tracks.samples
        stamps = [sample.stamp for sample in samples]
        assert stamps == sorted(set(stamps))
        if time > TRACKED_TIME + period:
            assert TRACKED_TIME - 1e-9 <= stamps[-1] - stamps[0] < TRACKED_TIME + period + 1e-9
            velocities.append(tracks.predict(time)[0].velocity[:2])
    # Two pose errors of 1 mm in 0.1 s.
    assert np.std(velocities) < 20e-3


def test_hand_that_touches_and_comes_on_halts_the_robot_in_words():
    hand, statuses = approaching(-0.5 * np.pi, 0.6, 0.4), []
    room = Room(hand)
    for _ in range(50):
        seen = replace(hand.at(room.robot.now + PERIOD), velocity=(0.0, 0.0, 0.0))
        room.robot.servo.receive(obstacles=StampedInput((seen,), seen.stamp))
        command, gap = room.step((0.0, 0.01, 0.0), published=False)
        if gap < -1e-3:
            statuses.append(command.status)
    assert statuses
    assert set(statuses) == {Status.HALT_OBSTACLE}
    assert 'touch' in room.robot.servo.decide(room.robot.now).message


def test_obstacle_that_is_placed_elsewhere_has_no_velocity():
    x, y, _ = HELD.pose
    room = Room(Obstacle('post', ConvexObject.disc((x + 2.0, y - 0.4), 0.1), stamp=0.0))
    for _ in range(5):
        room.step((0.01, 0.0, 0.0))
    room.hand = replace(room.hand, body=room.hand.body.moved_to((x, y - 0.4, 0.0)))
    for _ in range(5):
        command, _ = room.step((0.01, 0.0, 0.0))
        assert command.status < Status.HALT_OBSTACLE
        assert command.achieved_twist == pytest.approx((0.01, 0.0, 0.0), abs=1e-3)


def test_messages_as_old_as_the_timeout_do_not_alternate_motion_and_halt():
    hand = replace(approaching(-0.5 * np.pi, 0.0, 0.6), velocity=(0.0, 0.0, 0.0))
    room, statuses = Room(hand, obstacle_timeout=0.5), []
    for number in range(100):
        if number % 15 == 0:
            seen = replace(hand, stamp=room.robot.now - 0.4)
            room.robot.servo.receive(obstacles=StampedInput((seen,), seen.stamp))
        command, _ = room.step((0.01, 0.0, 0.0), published=False)
        statuses.append(command.status)
    assert Status.HALT_STALE_OBSTACLES in statuses
    changes = sum(before is not after for before, after in itertools.pairwise(statuses))
    assert changes <= 2


@pytest.mark.parametrize(('period', 'follows_late'), [(0.04, False), (0.2, False), (0.2, True)])
def test_slow_loop_keeps_its_distance_from_a_hand(period, follows_late):
    hand = approaching(-0.5 * np.pi, 0.1, 0.3)
    robot, least = Driven(HELD, 0.04), np.inf
    for _ in range(round(3.0 / period)):
        seen = hand.at(robot.now + period)
        robot.servo.receive(obstacles=StampedInput((seen,), seen.stamp))
        robot.step_late((0.0, 0.0, 0.0), period, follows_late)
        least = min(least, clearance(robot.held, [hand.at(robot.now + period)]))
    assert least > (0.015 if follows_late else 0.019)


def test_more_moving_obstacles_than_a_cycle_can_keep_are_refused_with_their_number():
    servo = Room(approaching(0.0, 0.1)).robot.servo
    disc = ConvexObject.disc((9.0, 9.0), 0.1)
    many = tuple(Obstacle(str(i), disc, stamp=0.0) for i in range(MAX_OBSTACLES + 1))
    servo.receive(obstacles=StampedInput(many, 0.0))
    assert servo.inputs.obstacles.reason == '201 moving obstacles; must be at most 200'


def test_invalid_moving_obstacles_halt_the_robot_with_the_reason():
    servo = Room(approaching(0.0, 0.1)).robot.servo
    hand = Obstacle('hand', ConvexObject.disc((1.0, 0.0), 0.1), stamp=0.0)
    for obstacles, words in (
        ((hand, hand), "'hand': is given twice"),
        ((replace(hand, stamp=None),), "'hand': has no stamp"),
        ((replace(hand, stamp=float('nan')),), "stamp of moving obstacle 'hand'"),
    ):
        servo.receive(obstacles=StampedInput(obstacles, 0.0))
        assert words in servo.inputs.obstacles.reason


@pytest.mark.parametrize('indentation', some_now([0.03, 0.008, 0.02], 1))
def test_bent_tube_keeps_its_clearance_from_a_post_opposite_the_object(indentation):
    config, radius = ROBOT.home, 0.5 * ROBOT.description.tube_diameter
    center = tangent_center(config, 'north/Z', 0.25, indentation)
    body = ConvexObject.disc(center, 0.25)
    member = ROBOT.member_names.index('north/P-Z')
    start, axis = config.points[ROBOT.topology.b[member]], config.member_axes[member]
    across = ((complex(*center) - start) * axis.conj()).imag
    foot = start + ((complex(*center) - start) * axis.conj()).real * axis
    # 60 mm beside the straight tube, on the side to which the object bends it.
    away = -1j * axis * np.sign(across)
    place = foot + away * (radius + 0.06 + 0.05)
    post = Obstacle('post', ConvexObject.disc((place.real, place.imag), 0.1))
    servo = {'bounds': ShapeBounds(), 'obstacles': (post,)}
    loop = SqueezeLoop(
        config, Grip.at_module(ROBOT, 'north/Z', body, 1.5), period=0.02, servo=servo
    )
    least, twist = np.inf, 0.03 * np.array([away.real, away.imag, 0.0])
    for _ in range(150):
        loop.cycle(twist)
        held = loop.object.grasp
        positions = np.linspace(0.0, held.config.member_lengths[member], 401)
        line, _ = held.bent_lines(np.full(401, member), positions)
        least = min(least, post.body.nearest(line).gaps.min() - radius)
    assert 0.019 < least < 0.025
