# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages that reach a picture: shown, or refused, and never the end of who shows it."""

import contextlib
import math

from geometry_msgs.msg import Point, PoseStamped
from hypothesis import given
from hypothesis import strategies as st
from isotruss_msgs.msg import GraspState, ManipulationStatus
from isotruss_ros.core import load_robot
from isotruss_ros.core.errors import ConfigurationError
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
TEXTS = st.text(max_size=8)


def some(strategy, longest=12):
    """Return lists of up to so many values."""
    return st.lists(strategy, max_size=longest)


@st.composite
def joint_states(draw):
    """Return joint states of rollers and other joints."""
    return JointState(
        name=draw(some(st.one_of(st.sampled_from(NAMES), TEXTS))), position=draw(some(NUMBERS))
    )


@st.composite
def poses(draw):
    """Return poses, of which few are planar."""
    message = PoseStamped()
    for part, fields in ((message.pose.position, 'xyz'), (message.pose.orientation, 'xyzw')):
        for name in fields:
            setattr(part, name, draw(NUMBERS))
    return message


@st.composite
def states(draw):
    """Return analyses of grasps."""
    members = some(NUMBERS) | st.lists(NUMBERS, min_size=9, max_size=9)
    return GraspState(
        code=draw(st.integers(0, 255)),
        held=draw(st.booleans()),
        slip_margin=draw(NUMBERS),
        slip_direction=draw(st.lists(NUMBERS, min_size=3, max_size=3)),
        utilisation=draw(members),
        squeeze=draw(some(NUMBERS, 3)),
        message=draw(TEXTS),
        hold_message=draw(TEXTS),
    )


@st.composite
def statuses(draw):
    """Return statuses of the manipulation."""
    return ManipulationStatus(
        code=draw(st.integers(0, 255)),
        message=draw(TEXTS),
        squeeze=draw(NUMBERS),
        squeeze_deviation=draw(NUMBERS),
    )


@st.composite
def marker_arrays(draw):
    """Return markers of the analysis and others."""
    names = st.sampled_from(['deformed', 'contact_regions', 'contact_forces', 'other'])
    points = st.builds(Point, x=NUMBERS, y=NUMBERS, z=NUMBERS)
    marker = st.builds(
        Marker,
        ns=names,
        id=st.integers(0, 9),
        action=st.sampled_from([0, 2, 3]),
        points=some(points, 8),
    )
    return MarkerArray(markers=draw(some(marker, 10)))


RECEIVED = {
    'joint_states': joint_states(),
    'object_pose': poses(),
    'state': states(),
    'status': statuses(),
    'markers': marker_arrays(),
}


@pytest.fixture(scope='module')
def view():
    """Return a view of a robot at home."""
    pytest.importorskip('viser')
    from isotruss_ros.viewer.view import View

    with contextlib.closing(View(Picture(ROBOT, 0.3), '127.0.0.1', 0)) as view:
        yield view


@pytest.mark.parametrize('name', sorted(RECEIVED))
def test_every_message_is_shown_or_refused(view, name):
    @examples(200)
    @given(st.lists(RECEIVED[name], min_size=1, max_size=3))
    def show(messages):
        view.picture.__init__(ROBOT, 0.3)
        for message in messages:
            with contextlib.suppress(PictureError, ConfigurationError):
                getattr(view.picture, f'receive_{name}')(message, 0.0)
            view.update(0.0)

    show()


def test_joint_states_of_parts_of_the_robot_are_merged():
    picture = Picture(ROBOT, 0.3)
    for names in (NAMES[:3], ['gripper'], NAMES[3:]):
        picture.receive_joint_states(JointState(name=names, position=[0.01] * len(names)), 0.0)
    assert picture.config.roller_positions == pytest.approx([0.01] * 6)


def test_joint_states_of_other_joints_do_not_make_a_picture_fresh():
    picture = Picture(ROBOT, 0.3)
    picture.receive_joint_states(JointState(name=['gripper'], position=[1.0]), 0.0)
    assert not picture.is_fresh('joint_states', 0.0)


def test_missing_joint_states_of_some_rollers_make_the_picture_stale():
    picture = Picture(ROBOT, 0.3)
    picture.receive_joint_states(JointState(name=NAMES[:3], position=[0.0] * 3), 0.0)
    picture.receive_joint_states(JointState(name=NAMES[3:], position=[0.0] * 3), 2.0)
    assert not picture.is_fresh('joint_states', 2.0)


def far_pose():
    """Return a pose that is none."""
    message = PoseStamped()
    message.pose.position.x = math.inf
    return message


@pytest.mark.parametrize(
    ('receive', 'message', 'words'),
    [
        ('joint_states', JointState(name=NAMES), '0 positions for 6 names'),
        ('joint_states', JointState(name=NAMES[:1], position=[math.nan]), 'nan m'),
        ('object_pose', far_pose(), 'object pose'),
        ('state', GraspState(code=0, utilisation=[0.1]), 'utilisation of 1 members: must be 9'),
        ('status', ManipulationStatus(code=255), 'code 255'),
        (
            'markers',
            MarkerArray(markers=[Marker(ns='contact_regions', points=[Point()] * 7)]),
            '7 points: must be a multiple of 6',
        ),
        (
            'markers',
            MarkerArray(markers=[Marker(ns='deformed', points=[Point()] * 4)]),
            'all points are equal; must be a line',
        ),
    ],
)
def test_a_message_that_cannot_be_shown_is_refused_with_the_reason(receive, message, words):
    with pytest.raises(PictureError, match=words):
        getattr(Picture(ROBOT, 0.3), f'receive_{receive}')(message, 0.0)
