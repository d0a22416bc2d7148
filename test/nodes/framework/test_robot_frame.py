# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames of poses and markers of a tracker, and of object and modules for tf2."""

from functools import partial
import math
from operator import setitem
from types import SimpleNamespace

from builtin_interfaces.msg import Time as TimeMessage
from geometry_msgs.msg import Point, PoseStamped, Quaternion, Transform, TransformStamped, Vector3
from geometry_msgs.msg import Pose as PoseMessage
from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core import ConvexObject, Pose, settle_grasp, tangent_center
from isotruss_ros.nodes.conversions.grasp_messages import to_contact_wrench
from isotruss_ros.nodes.conversions.messages import MessageError, read_stamp
from isotruss_ros.nodes.conversions.sensor_messages import to_joint_markers
from isotruss_ros.nodes.framework import robot_frame, transforms
from isotruss_ros.nodes.framework.robot_frame import RobotFrame
from isotruss_ros.nodes.framework.transforms import find_contact_frames, TransformBroadcaster
import numpy as np
from probe import ROBOT
import pytest
from scipy.spatial.transform import Rotation
from std_msgs.msg import Header

STAMP = TimeMessage(sec=12, nanosec=500_000_000)
NAMES = ROBOT.topology.joint_names
lengths = st.floats(-5.0, 5.0)
rotations = st.tuples(lengths, lengths, lengths).map(Rotation.from_rotvec)


def vector(kind, values):
    return kind(**dict(zip('xyz', map(float, values), strict=True)))


def quaternion(turn):
    return Quaternion(**dict(zip('xyzw', turn.as_quat().tolist(), strict=True)))


class Buffer:
    """Transforms at one stamp, as `tf2_ros.Buffer` has them; a fake, as tf2 has no wheels."""

    def __init__(self, turn, shift=(0.0, 0.0, 0.0)):
        self.transform = Transform(translation=vector(Vector3, shift), rotation=quaternion(turn))

    def lookup_transform(self, _target, source_frame, _time):
        if source_frame == 'elsewhere':
            raise robot_frame.NO_TRANSFORM[0]('two unconnected trees')
        return TransformStamped(transform=self.transform)


def pose(position, turn, frame='camera'):
    placed = PoseMessage(position=vector(Point, position), orientation=quaternion(turn))
    return PoseStamped(header=Header(frame_id=frame, stamp=STAMP), pose=placed)


def markers(places, frame='camera'):
    message = to_joint_markers({name: place[:2] for name, place in places.items()})
    for transform, place in zip(message.transforms, places.values(), strict=True):
        transform.translation.z = float(place[2])
    message.header.frame_id, message.header.stamp = frame, STAMP
    return message


@given(rotations, st.tuples(lengths, lengths, lengths), lengths, lengths, st.floats(-3.0, 3.0))
def test_poses_in_any_frame_are_transformed_to_the_robot_frame(turn, shift, x, y, angle):
    true = np.array([x, y, 0.2])
    measured = turn.inv().apply(true - shift)
    rotation = turn.inv() * Rotation.from_euler('z', angle)
    frame = RobotFrame(ROBOT, Buffer(turn, shift))
    result = frame.read_pose(pose(measured, rotation))
    assert result == pytest.approx((x, y, angle), abs=1e-9)


@given(rotations, st.tuples(lengths, lengths, lengths))
def test_markers_in_any_frame_are_transformed_to_the_robot_frame(turn, shift):
    true = {name: np.append(ROBOT.home.nodes[NAMES.index(name)], 0.1) for name in 'PQZ'}
    measured = {name: turn.inv().apply(place - shift) for name, place in true.items()}
    frame = RobotFrame(ROBOT, Buffer(turn, shift))
    result = frame.read_markers(markers(measured))
    for name, place in true.items():
        assert result[name] == pytest.approx(place[:2], abs=1e-9)


@pytest.mark.parametrize(
    ('height', 'degrees', 'words'),
    [
        (0.2, 4.0, ''),
        (0.0, 23.0, 'object pose.*: tilted by 23 degrees out of the plane.*; must be at most 5'),
        (0.5, 0.0, 'object pose.*: z = 0.5 m out of the plane .*; must be within 0.3 m'),
        (-0.5, 0.0, 'z = -0.5 m'),
        (math.nan, 0.0, 'z = nan m'),
    ],
)
@pytest.mark.parametrize('name', ['truss', 'camera'])
def test_pose_out_of_the_plane_of_the_robot_is_refused_with_its_tilt_or_height(
    name, height, degrees, words
):
    frame = RobotFrame(ROBOT, Buffer(Rotation.identity(), (0.0, 0.0, 0.0)))
    turned = Rotation.from_euler('zx', [0.4, np.radians(degrees)])
    placed = pose((1.0, 2.0, height), turned, name)
    if not words:
        assert frame.read_pose(placed) == pytest.approx((1.0, 2.0, 0.4), abs=0.01)
        return
    with pytest.raises(MessageError, match=words):
        frame.read_pose(placed)


def test_markers_in_the_frame_of_the_robot_are_taken_as_they_are_whatever_their_height():
    frame = RobotFrame(ROBOT)
    marked = markers({'P': (1.0, 2.0, math.nan)}, 'truss')
    assert frame.read_markers(marked) == {'P': (1.0, 2.0)}


@pytest.mark.parametrize('degrees', [4.0, 6.0, 90.0, 180.0])
def test_a_planar_pose_in_a_tilted_frame_is_refused_by_name(degrees):
    frame = RobotFrame(ROBOT, Buffer(Rotation.from_euler('x', degrees, degrees=True)))
    planar = pose((1.0, 2.0, 0.0), Rotation.from_euler('z', 0.4))
    if degrees < 5.0:
        assert frame.read_pose(planar)[0] == pytest.approx(1.0)
        return
    words = f"object pose in frame 'camera': tilted by {degrees:.0f} degrees out of the plane"
    with pytest.raises(MessageError, match=words):
        frame.read_pose(planar)


def test_a_frame_that_tf2_does_not_connect_is_named_with_the_reason():
    frame = RobotFrame(ROBOT, Buffer(Rotation.identity()))
    with pytest.raises(MessageError, match=r"'elsewhere': tf2 must connect this frame .*two"):
        frame.read_pose(pose((0.0, 0.0, 0.0), Rotation.identity(), 'elsewhere'))


@pytest.mark.skipif(robot_frame.Buffer is not None, reason='tf2 is at hand')
def test_without_tf2_frames_must_match():
    frame = RobotFrame.heard_by(None, ROBOT)
    for read, message in (
        (frame.read_pose, pose((0.0, 0.0, 0.0), Rotation.identity())),
        (frame.read_markers, markers({'P': (0.0, 0.0, 0.0)})),
    ):
        with pytest.raises(MessageError, match=r"'camera': must be 'truss'; tf2_ros.*not install"):
            read(message)


@pytest.fixture
def broadcast(monkeypatch):
    """Return a function that broadcasts once, and returns the transforms by name of the frame."""
    # There are no wheels of tf2_msgs.
    monkeypatch.setattr(transforms, 'TFMessage', SimpleNamespace)

    def run(config=ROBOT.home, contacts=None):
        published = {}
        node = SimpleNamespace(
            get_logger=lambda: None,
            advertise=lambda _, topic, __: SimpleNamespace(
                publish=partial(setitem, published, topic)
            ),
        )
        pose = Pose(0.7, 0.4, 0.3)
        TransformBroadcaster(node, ROBOT).broadcast(config, pose, contacts or {}, 1.5)
        assert [*published] == ['/tf']
        return {stamped.child_frame_id: stamped for stamped in published['/tf'].transforms}

    return run


def angle_of(stamped):
    """Return by how much a frame is turned [rad]."""
    turned = stamped.transform.rotation
    assert (turned.x, turned.y) == (0.0, 0.0)
    return 2.0 * math.atan2(turned.z, turned.w)


def test_the_frames_of_the_object_are_at_its_centre_one_turned_and_one_aligned(broadcast):
    frames = broadcast()
    for name, angle in (('truss_object', 0.3), ('truss_object_aligned', 0.0)):
        stamped = frames[name]
        assert stamped.header.frame_id == 'truss'
        assert read_stamp(stamped.header) == 1.5
        moved = stamped.transform.translation
        assert (moved.x, moved.y, moved.z) == (0.7, 0.4, 0.0)
        assert angle_of(stamped) == pytest.approx(angle)


def test_the_frame_of_a_contact_points_into_the_object(broadcast):
    body = ConvexObject.disc(tangent_center(ROBOT.home, 'north/Z', 0.29), 0.3)
    contacts = find_contact_frames(settle_grasp(ROBOT.home, body).equilibrium)
    first, _ = contacts
    stamped = broadcast(contacts=contacts)[f'truss_{first.replace("/", "_")}_contact']
    moved, angle = stamped.transform.translation, angle_of(stamped)
    way = body.center - complex(moved.x, moved.y)
    assert abs(way) == pytest.approx(0.15, abs=2e-3)
    assert np.angle(way * np.exp(-1j * angle)) == pytest.approx(0.0, abs=1e-2)


def test_frames_of_modules_are_at_their_joints_with_the_rod_ahead(broadcast):
    config = ROBOT.configuration([0.03, -0.02, 0.05, 0.01, -0.04, 0.02])
    frames = broadcast(config)
    nodes = dict(zip(ROBOT.node_names, config.nodes, strict=True))
    assert len(frames) == 2 + len(ROBOT.module_names)
    for name in ROBOT.module_names:
        stamped = frames[f'truss_{name.replace("/", "_")}']
        joint = nodes[name.split('/')[1]]
        rod = complex(*(0.5 * (nodes[f'{name}/B'] + nodes[f'{name}/C']) - joint))
        moved = stamped.transform.translation
        assert (moved.x, moved.y) == pytest.approx(joint)
        assert np.exp(1j * angle_of(stamped)) == pytest.approx(rod / abs(rod))


def test_contact_forces_in_the_contact_frames_balance_the_external_wrench():
    body = ConvexObject.disc(tangent_center(ROBOT.home, 'north/Z', 0.29), 0.3)
    load = 0.5 - 1.0j
    settled = settle_grasp(ROBOT.home, body, 0.9, (load.real, load.imag, 0.0))
    total = load
    for member, (_, axis) in find_contact_frames(settled.equilibrium).items():
        normal, friction = settled.normal_forces[member], settled.friction_forces[member]
        force = to_contact_wrench('truss', member, 0.0, normal, friction).wrench.force
        total += complex(force.x, force.y) * axis
    assert abs(total) < 1e-6
