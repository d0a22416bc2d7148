# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses and markers of a tracker in frames of its own, by transforms as tf2 has them."""

import math

from builtin_interfaces.msg import Time as TimeMessage
from geometry_msgs.msg import Point, PoseStamped, Quaternion, Transform, TransformStamped, Vector3
from geometry_msgs.msg import Pose as PoseMessage
from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.nodes.conversions.messages import MessageError
from isotruss_ros.nodes.conversions.sensor_messages import to_joint_markers
from isotruss_ros.nodes.framework import robot_frame
from isotruss_ros.nodes.framework.robot_frame import RobotFrame
import numpy as np
from probe import ROBOT
import pytest
from scipy.spatial.transform import Rotation
from std_msgs.msg import Header

STAMP = TimeMessage(sec=12, nanosec=500_000_000)
NAMES = ROBOT.topology.joint_names


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


lengths = st.floats(-5.0, 5.0)
rotations = st.tuples(lengths, lengths, lengths).map(Rotation.from_rotvec)


@given(rotations, st.tuples(lengths, lengths, lengths), lengths, lengths, st.floats(-3.0, 3.0))
def test_poses_in_any_frame_are_transformed_to_the_robot_frame(turn, shift, x, y, angle):
    true = np.array([x, y, 0.3])
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


def test_what_is_in_the_frame_of_the_robot_is_taken_as_it_is_whatever_its_height():
    frame, turned = RobotFrame(ROBOT), Rotation.from_euler('z', 0.4)
    placed = frame.read_pose(pose((1.0, 2.0, math.nan), turned, 'truss'))
    assert placed == pytest.approx((1.0, 2.0, 0.4))
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
