# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Obstacles in the view: placed and dragged by a browser, drawn from messages and recordings."""

import contextlib
import math
from types import SimpleNamespace

from geometry_msgs.msg import Point, Pose, PoseStamped
from held_grips import HOME
from isotruss_ros.core import ConvexObject, Disc, Grip, Obstacle, read_obstacles
from isotruss_ros.core import Pose as PlanarPose
from isotruss_ros.core.inputs import LatestInputs, StampedInput
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.model.obstacle import MAX_OBSTACLES
from isotruss_ros.core.recording.recorded_servo import RecordedServo
from isotruss_ros.core.servo.servo_settings import OBSTACLE_TIMEOUT, ServoSettings
from isotruss_ros.viewer.message_checks import PictureError
from isotruss_ros.viewer.picture import Picture
from isotruss_ros.viewer.placed_obstacles import MAX_PLACED, MAX_SPEED, PlacedObstacles
from isotruss_ros.viewer.requests import RequestError
from isotruss_ros.viewer.room import Room
from nav_msgs.msg import Path
import numpy as np
import pytest
from shapes import SHAPES

for package in ('mcap', 'rosbags', 'viser'):
    pytest.importorskip(package)
from fake_browser import FakeBrowser, Session  # noqa: E402,I100
from isotruss_ros.viewer.recording import show_message  # noqa: E402

WALL = '{south wall: {shape: half_plane, pose: [0, -1, 1.5708]}}'
PERIOD = 0.05


@pytest.fixture
def session():
    """Return a session whose browser may be as slow as the machine makes it."""
    with contextlib.closing(Session()) as opened:
        yield opened


def placed(session):
    """Return the placed obstacles by name."""
    return {obstacle.name: obstacle for obstacle in session.controls.placed.advance(0.0)}


def place(session, x, y):
    """Place an obstacle by the button and a click."""
    count = len(placed(session))
    session.set('add obstacle', True)
    session.until(lambda: session.browser.is_clickable)
    session.browser.click(x, y)
    session.until(lambda: len(placed(session)) > count)


def drag(session, name, phase, x, y, grabbed=(0.0, 0.0)):
    session.browser.drag(f'obstacle_handles/{name}', phase, x, y, grabbed)


def test_a_click_after_the_button_places_one_obstacle_in_the_plane_of_the_robot(session):
    place(session, 1.2, -0.4)
    session.until(lambda: not session.browser.is_clickable)
    session.browser.click(0.5, 0.5)
    session.press_stop()
    (obstacle,) = placed(session).values()
    assert obstacle.body.pose == pytest.approx((1.2, -0.4, 0.0))


def test_a_dragged_obstacle_moves_toward_the_pointer_until_control_ends(session):
    place(session, 1.0, 0.0)
    (name,) = placed(session)
    drag(session, name, 'start', 1.42, 0.33, (1.02, 0.03))
    find = session.controls.placed.find_target
    session.until(lambda: find(name) == pytest.approx((1.4, 0.3)))
    assert placed(session)[name].velocity == pytest.approx((0.8 * MAX_SPEED, 0.6 * MAX_SPEED, 0))
    session.press_stop()
    assert placed(session)[name].velocity == (0.0, 0.0, 0.0)
    assert find(name) == pytest.approx((1.0, 0.0))


def test_an_obstacle_remains_when_its_browser_leaves(session):
    place(session, 1.0, 0.0)
    session.browser.close()
    session.until(lambda: session.control.browser is None)
    assert len(placed(session)) == 1


def test_a_click_at_the_sky_places_nothing(session):
    session.set('add obstacle', True)
    session.until(lambda: session.browser.is_clickable)
    session.browser.click(0.0, 0.0, down=0.1)
    session.until(lambda: session.refused)
    assert not placed(session)


def test_published_velocities_of_a_dragged_obstacle_lead_to_its_next_poses():
    obstacles = PlacedObstacles()
    name = obstacles.add((0.0, 0.0))
    obstacles.advance(10.0)
    obstacles.drag_to(name, (0.15, -0.2), 10.0)
    (before,) = obstacles.advance(10.0)
    for now in 10.0 + PERIOD * np.arange(1, 200):
        (after,) = obstacles.advance(float(now))
        assert after.stamp == now
        assert after.body.pose == pytest.approx(before.at(now).body.pose, abs=1e-9)
        assert math.hypot(*after.velocity[:2]) <= MAX_SPEED + 1e-12
        before = after
    assert after.body.pose[:2] == pytest.approx((0.15, -0.2), abs=2e-3)
    assert after.velocity == (0.0, 0.0, 0.0)


@pytest.mark.parametrize('target', [(100.1, 0.0), (0.0, -300.0), (0.0, math.nan)])
def test_more_obstacles_than_fit_in_a_cycle_and_drags_beyond_all_poses_are_refused(target):
    obstacles = PlacedObstacles()
    names = [obstacles.add((float(number), 0.0)) for number in range(MAX_PLACED)]
    with pytest.raises(RequestError, match=f'must be at most {MAX_PLACED}'):
        obstacles.add((0.0, 1.0))
    with pytest.raises(RequestError, match='must be at most 100 m away'):
        obstacles.drag_to(names[0], target, 0.0)


@pytest.mark.parametrize('jump', [-100.0, 100.0])
def test_a_jump_of_the_clock_moves_a_dragged_obstacle_no_further_than_its_target(jump):
    obstacles = PlacedObstacles()
    name = obstacles.add((0.0, 0.0))
    obstacles.drag_to(name, (0.1, 0.0), 200.0)
    obstacles.advance(200.0)
    (after,) = obstacles.advance(200.0 + jump)
    assert 0.0 <= after.body.pose.x <= 0.1


def moving(name, x, stamp=0.0):
    return Obstacle(name, ConvexObject(Disc(0.1), (x, 0.0, 0.0)), stamp=stamp)


def test_an_obstacle_in_no_recent_message_is_shown_as_silent_until_it_is_cleared():
    room = Room()
    room.resting = read_obstacles(WALL)
    room.take_obstacles([moving('hand', 1.0)], 0.0)
    room.take_obstacles([moving('cart', 2.0)], OBSTACLE_TIMEOUT)
    shown = {o.name: fresh for o, fresh in room.list_obstacles(OBSTACLE_TIMEOUT)}
    assert shown == {'south wall': True, 'hand': False, 'cart': True}
    room.clear_moving()
    assert [o.name for o, _ in room.list_obstacles(1.0)] == ['south wall']


def record(obstacles):
    """Return the record of a cycle with moving obstacles, and with a wall."""
    grip = Grip(members_at(HOME.robot, 'north/Z'), ConvexObject(Disc(0.3)))
    settings = ServoSettings(grip, 0.01, 0.05, obstacles=read_obstacles(WALL))
    servo = RecordedServo(HOME.robot, settings, LatestInputs())
    if obstacles:
        servo.receive(obstacles=StampedInput(tuple(obstacles), 7.0))
    servo.decide(8.0)
    return SimpleNamespace(data=servo.describe())


def test_a_recorded_cycle_replaces_the_obstacles_and_states_their_age():
    picture, topic = Picture(HOME.robot, 0.3), '/arm/manipulation/cycle'
    message, room = record([moving('hand', 1.0, 7.9), moving('cart', 2.0, 7.0)]), picture.room
    assert show_message(picture, topic, message, 100.0) == ()
    shown = {o.name: fresh for o, fresh in room.list_obstacles(100.0)}
    assert shown == {'south wall': True, 'hand': True, 'cart': False}
    show_message(picture, topic, record([]), 101.0)
    assert [o.name for o, _ in room.list_obstacles(101.0)] == ['south wall']


def path(*places):
    return Path(poses=[PoseStamped(pose=Pose(position=Point(x=x, y=y))) for x, y in places])


def test_a_planned_path_is_shown_until_the_object_is_at_its_end():
    room = Room()
    room.receive_path(path((0.0, 0.0), (0.2, 0.1), (0.4, 0.0)), 0.0)
    room.leave_path(PlanarPose(0.2, 0.1, 0.0))
    assert room.path == pytest.approx(np.array([(0.0, 0.0), (0.2, 0.1), (0.4, 0.0)]))
    room.leave_path(PlanarPose(0.396, 0.0, 0.0))
    assert room.path is None


def receive_changed(room, *change):
    """Receive the record of a cycle in which a text is replaced."""
    message = record([])
    message.data = message.data.replace(*change)
    room.receive_cycle(message, 0.0)


MANY = [moving(str(number), 0.0) for number in range(MAX_OBSTACLES + 1)]
RECORD, POINTS = 'record of a cycle', 'planned path: points must be finite'


@pytest.mark.parametrize(
    ('words', 'receive'),
    [
        (f'at most {MAX_OBSTACLES}', lambda room: room.take_obstacles(MANY, 0.0)),
        (RECORD, lambda room: receive_changed(room, '"now": 8.0', '"now": NaN')),
        (RECORD, lambda room: receive_changed(room, 'HalfPlane', 'Disc')),
        (RECORD, lambda room: receive_changed(room, '"obstacles": [{', '"obstacles": [1, {')),
        (POINTS, lambda room: room.receive_path(path((0.0, 0.0), (math.nan, 0.0)), 0.0)),
        (POINTS, lambda room: room.receive_path(path((0.0, 0.0), (1e9, 0.0)), 0.0)),
    ],
)
def test_a_room_refuses_too_many_obstacles_and_invalid_records_and_paths(words, receive):
    with pytest.raises(PictureError, match=words):
        receive(Room())


def test_obstacles_and_path_are_drawn_where_the_messages_have_them(session):
    room = session.view.picture.room
    room.resting = read_obstacles(WALL)
    bodies = [ConvexObject(shape, (1.0, float(n), 0.5)) for n, shape in enumerate(SHAPES)]
    room.take_obstacles([Obstacle(str(n), b, stamp=0.0) for n, b in enumerate(bodies)], 0.0)
    room.receive_path(path((0.0, 0.0), (0.2, 0.1)), 0.0)
    session.view.update(0.0)
    with contextlib.closing(FakeBrowser(session.view.address)) as browser:
        browser.until_drawn('ReplayDoneMessage', 'type', 'ReplayDoneMessage')
        for number in range(len(bodies)):
            frame = browser.scene[f'/obstacles/{number + 2}']
            assert frame['position'] == pytest.approx([1.0, number, 0.0])
            vertices = np.frombuffer(
                browser.scene[f'/obstacles/{number + 2}/body']['vertices'], np.float32
            ).reshape(-1, 3)
            extent = bodies[number].shape.support(np.array([1.0 + 0.0j]))[0]
            assert vertices[:, 0].max() == pytest.approx(extent, abs=2e-3)
        # The wall is left of its frame, along the x axis of the robot.
        wall = np.frombuffer(browser.scene['/obstacles/1/body']['vertices'], np.float32)
        assert wall.reshape(-1, 3)[:, 0].max() == 0.0
        line = np.frombuffer(browser.scene['/planned_path']['points'], np.float32)
        assert line.reshape(2, 3)[:, :2] == pytest.approx(np.array([(0.0, 0.0), (0.2, 0.1)]))
        fresh = browser.scene['/obstacles/2/body']['color']
        session.view.update(OBSTACLE_TIMEOUT)
        browser.until_drawn('/obstacles/2/body', 'color', [160, 200, 200])
        assert fresh != [160, 200, 200]
