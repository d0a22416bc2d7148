# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages that reach a picture: shown, or refused, and never the end of who shows it."""

import contextlib
import math
import time

from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from hypothesis import given
from hypothesis import strategies as st
from isotruss_msgs.msg import GraspState, ManipulationStatus
from isotruss_ros.core import load_robot
from isotruss_ros.core import Pose as PlanarPose
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.nodes.conversions.messages import to_pose_message
from isotruss_ros.viewer.camera import place_camera
from isotruss_ros.viewer.message_checks import PictureError
from isotruss_ros.viewer.picture import Picture
import numpy as np
import pytest
from robots import examples
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker, MarkerArray

ROBOT = load_robot('nine_member')
NAMES = list(ROBOT.roller_names)
NUMBERS = st.one_of(
    st.floats(), st.floats(-0.1, 0.1), st.sampled_from([math.nan, math.inf, -math.inf, 1e308])
)
TEXTS, CODES = st.text(max_size=8), st.integers(0, 255)
POINTS = st.builds(Point, x=NUMBERS, y=NUMBERS, z=NUMBERS)
TURNS = st.builds(Quaternion, x=NUMBERS, y=NUMBERS, z=NUMBERS, w=NUMBERS)


def some(strategy, longest=12):
    return st.lists(strategy, max_size=longest)


MARKERS = st.builds(
    Marker,
    ns=st.sampled_from(['deformed', 'contact_regions', 'contact_forces', 'other']),
    id=st.integers(0, 9),
    action=st.sampled_from([0, 2, 3]),
    points=some(POINTS, 8),
)
RECEIVED = {
    'joint_states': st.builds(
        JointState, name=some(st.one_of(st.sampled_from(NAMES), TEXTS)), position=some(NUMBERS)
    ),
    'object_pose': st.builds(
        PoseStamped, pose=st.builds(Pose, position=POINTS, orientation=TURNS)
    ),
    'state': st.builds(
        GraspState,
        code=CODES,
        held=st.integers(0, 2),
        slip_margin=NUMBERS,
        slip_direction=st.lists(NUMBERS, min_size=3, max_size=3),
        utilisation=some(NUMBERS) | st.lists(NUMBERS, min_size=9, max_size=9),
        squeeze=some(NUMBERS, 3),
        message=TEXTS,
        hold_message=TEXTS,
    ),
    'status': st.builds(
        ManipulationStatus, code=CODES, message=TEXTS, squeeze=NUMBERS, squeeze_deviation=NUMBERS
    ),
    'markers': st.builds(MarkerArray, markers=some(MARKERS, 10)),
}


@pytest.fixture(scope='module')
def view():
    pytest.importorskip('viser')
    from isotruss_ros.viewer.view import View

    with contextlib.closing(View(Picture(ROBOT, 0.3), '127.0.0.1', 0)) as view:
        yield view


@contextlib.contextmanager
def browsing(view):
    from fake_browser import FakeBrowser

    with contextlib.closing(FakeBrowser(view.address)) as browser:
        yield browser


@pytest.mark.parametrize('name', sorted(RECEIVED))
def test_every_message_is_shown_or_refused(view, name):
    @examples(200)
    @given(st.lists(RECEIVED[name], min_size=1, max_size=3))
    def show(messages):
        view.picture = Picture(ROBOT, 0.3)
        for message in messages:
            with contextlib.suppress(PictureError, ConfigurationError):
                getattr(view.picture, f'receive_{name}')(message, 0.0)
            view.update(0.0)

    show()


@pytest.mark.parametrize(('pause', 'is_fresh'), [(0.0, True), (2.0, False)])
def test_joint_states_of_parts_of_the_robot_are_merged_while_they_are_fresh(pause, is_fresh):
    picture = Picture(ROBOT, 0.3)
    for names, now in ((NAMES[:3], 0.0), (['gripper'], pause), (NAMES[3:], pause)):
        assert not picture.is_fresh('joint_states', now)
        message = JointState(name=names, position=[0.01] * len(names))
        picture.receive_joint_states(message, now)
    assert picture.is_fresh('joint_states', pause) == is_fresh
    assert not is_fresh or picture.config.roller_positions == pytest.approx([0.01] * 6)


def marker(name, *points):
    return MarkerArray(markers=[Marker(ns=name, points=points)])


@pytest.mark.parametrize(
    ('receive', 'message', 'words'),
    [
        ('joint_states', JointState(name=NAMES), '0 positions for 6 names'),
        ('joint_states', JointState(name=NAMES[:1], position=[math.nan]), 'nan m'),
        ('object_pose', PoseStamped(pose=Pose(position=Point(x=math.inf))), 'pose .* at most'),
        ('state', GraspState(code=0, utilisation=[0.1]), 'utilisation of 1 members: must be 9'),
        ('status', ManipulationStatus(code=255), 'code 255'),
        ('markers', marker('contact_regions', *[Point()] * 7), '7 points: must be a multiple of'),
        ('markers', marker('deformed', *[Point()] * 4), 'all points are equal; must be a line'),
    ],
)
def test_a_message_that_cannot_be_shown_is_refused_with_the_reason(receive, message, words):
    with pytest.raises(PictureError, match=words):
        getattr(Picture(ROBOT, 0.3), f'receive_{receive}')(message, 0.0)


@pytest.mark.parametrize(('angle', 'held'), [(2.5, 0), (-0.4, 1)])
def test_the_object_is_drawn_at_its_pose_red_or_green_by_its_hold(view, angle, held):
    view.picture = Picture(ROBOT, 0.3)
    pose = to_pose_message(PlanarPose(0.5, -0.2, angle))
    view.picture.receive_object_pose(PoseStamped(pose=pose), 0.0)
    view.picture.receive_state(GraspState(held=held), 0.0)
    view.update(0.0)
    turn = [math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)]
    with browsing(view) as browser:
        browser.until_drawn('/object', 'wxyz', pytest.approx(turn))
        browser.until_drawn('ReplayDoneMessage', 'type', 'ReplayDoneMessage')
        assert browser.scene['/object']['position'] == pytest.approx([0.5, -0.2, 0.0])
        red, green, _ = browser.scene['/object/body']['color']
        assert (green > red) == held
        mark = np.frombuffer(browser.scene['/object/mark']['points'], np.float32)
        assert 0.0 < mark[3] < 0.15


def test_rods_forces_and_utilisation_are_drawn_as_the_messages_state(view):
    picture = view.picture = Picture(ROBOT, 0.3)
    travel, line = [0.05, -0.02, 0.0, 0.03, 0.01, 0.04], [Point(x=0.1, y=0.2), Point(x=0.4)]
    wall = [Point(x=0.1, y=0.2), Point(x=0.1, y=0.2, z=0.1), Point(x=0.4, z=0.1)]
    picture.receive_joint_states(JointState(name=NAMES, position=travel), 0.0)
    picture.receive_state(GraspState(utilisation=[0.0, 1.0, 0.4] + 6 * [0.0]), 0.0)
    for shown in (
        marker('deformed', *line),
        marker('contact_forces', *line),
        marker('contact_regions', *wall, wall[0], wall[2], Point(x=0.4)),
    ):
        picture.receive_markers(shown, 0.0)
    view.update(0.0)
    config, topology = ROBOT.configuration(travel), ROBOT.topology
    with browsing(view) as browser:
        browser.until_drawn('ReplayDoneMessage', 'type', 'ReplayDoneMessage')

        def points(name):
            drawn = np.frombuffer(browser.scene[name]['points'], np.float32).reshape(-1, 2, 3)
            return drawn[..., 0] + 1j * drawn[..., 1]

        rods, bars = np.split(points('/modules'), 2)
        assert rods[:, 0] == pytest.approx(bars.mean(axis=1), abs=1e-6)
        assert rods[:, 1] == pytest.approx(config.points[topology.joint], abs=1e-6)
        assert bars[:, 0] == pytest.approx(config.points[topology.b], abs=1e-6)
        for name in ('/contact_forces', '/contact_regions'):
            assert points(name) == pytest.approx(np.array([[0.1 + 0.2j, 0.4]]))
        colors = [browser.scene[f'/tubes/{name}']['color'] for name in ROBOT.member_names]
        # Blue, grey from a utilisation of 0.4, and red at wrinkling.
        assert [red > blue for red, _, blue in colors] == [False, True] + 7 * [False]
        assert len(set(colors[2])) == 1
        for joint in ROBOT.description.supports:
            place = config.nodes[topology.joint_names.index(joint)]
            assert browser.scene[f'/supports/{joint}']['position'][:2] == pytest.approx(place)


@pytest.mark.parametrize('width', [46, 160])
def test_the_camera_of_an_upright_screen_shows_the_whole_robot(view, width):
    from fake_browser import CAMERA

    view.picture, place = Picture(ROBOT, 0.3), view.server.initial_camera.position.tolist()
    with browsing(view) as browser:
        browser.send(CAMERA | {'position': place, 'image_width': width, 'image_height': 100})
        while not any(c.camera.image_width == width for c in view.server.get_clients().values()):
            time.sleep(0.01)
        view.update(0.0)
        wanted = place_camera(ROBOT.home.points, 0.46)[0] if width < 100 else place
        browser.until_drawn('SetCameraPositionMessage', 'position', pytest.approx(wanted))
