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
from isotruss_ros.viewer.message_checks import PictureError
from isotruss_ros.viewer.picture import Picture
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
        JointState,
        name=some(st.one_of(st.sampled_from(NAMES), TEXTS)),
        position=some(NUMBERS),
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
        ManipulationStatus,
        code=CODES,
        message=TEXTS,
        squeeze=NUMBERS,
        squeeze_deviation=NUMBERS,
    ),
    'markers': st.builds(MarkerArray, markers=some(MARKERS, 10)),
}


@pytest.fixture(scope='module')
def view():
    pytest.importorskip('viser')
    from isotruss_ros.viewer.view import View

    with contextlib.closing(View(Picture(ROBOT, 0.3), '127.0.0.1', 0)) as view:
        yield view


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
        (
            'object_pose',
            PoseStamped(pose=Pose(position=Point(x=math.inf))),
            'object pose .* at most',
        ),
        ('state', GraspState(code=0, utilisation=[0.1]), 'utilisation of 1 members: must be 9'),
        ('status', ManipulationStatus(code=255), 'code 255'),
        ('markers', marker('contact_regions', *[Point()] * 7), '7 points: must be a multiple of'),
        ('markers', marker('deformed', *[Point()] * 4), 'all points are equal; must be a line'),
    ],
)
def test_a_message_that_cannot_be_shown_is_refused_with_the_reason(receive, message, words):
    with pytest.raises(PictureError, match=words):
        getattr(Picture(ROBOT, 0.3), f'receive_{receive}')(message, 0.0)


@pytest.mark.parametrize('angle', [2.5, -0.4])
def test_the_object_is_drawn_at_its_pose(view, angle):
    from fake_browser import FakeBrowser

    view.picture = Picture(ROBOT, 0.3)
    pose = to_pose_message(PlanarPose(0.5, -0.2, angle))
    view.picture.receive_object_pose(PoseStamped(pose=pose), 0.0)
    view.update(0.0)
    turn = [math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)]
    with contextlib.closing(FakeBrowser(view.address)) as browser:
        end = time.monotonic() + 60.0
        while browser.scene.get('/object', {}).get('wxyz') != pytest.approx(turn):
            assert time.monotonic() < end, browser.scene.get('/object')
            time.sleep(0.01)
        assert browser.scene['/object']['position'] == pytest.approx([0.5, -0.2, 0.0])
