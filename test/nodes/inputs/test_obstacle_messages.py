# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Moving obstacles in messages: round trips, other frames, and refused messages."""

import math
from types import SimpleNamespace

from geometry_msgs.msg import Transform, TransformStamped, Vector3
from hypothesis import given
from hypothesis import strategies as st
from isotruss_msgs.msg import Obstacles
from isotruss_ros.core import ConvexObject, Disc, Obstacle
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.model.obstacle import HalfPlane
from isotruss_ros.nodes.conversions.messages import MessageError
from isotruss_ros.nodes.conversions.obstacle_messages import read_obstacles, to_obstacles_message
from isotruss_ros.nodes.framework.robot_frame import RobotFrame
import numpy as np
from probe import ROBOT
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from shapes import random_shape

HAND = Obstacle('hand', ConvexObject(Disc(0.1), (1.0, 0.5, 0.2)), (0.1, -0.2, 0.3), 5.0)
places, rates, angles = st.floats(-9.0, 9.0), st.floats(-1.0, 1.0), st.floats(-3.0, 3.0)


@given(
    st.integers(0, 2**32 - 1),
    st.tuples(places, places, angles),
    st.tuples(rates, rates, rates),
)
def test_obstacles_survive_a_round_trip(seed, pose, velocity):
    shape = random_shape(np.random.default_rng(seed))
    obstacle = Obstacle('a', ConvexObject(shape, pose), velocity, 5.25)
    sent = to_obstacles_message([obstacle, HAND], 5.25, 'truss')
    first, second = read_obstacles(deserialize_message(serialize_message(sent), Obstacles))
    assert (first.name, first.body.shape, first.stamp) == ('a', shape, 5.25)
    assert first.body.pose == pytest.approx(pose, abs=1e-12)
    assert first.velocity == velocity
    assert second.name == 'hand'


def test_pose_and_velocity_are_transformed_to_the_robot_frame():
    angle, shift = 0.5 * math.pi, Vector3(x=2.0, y=3.0)
    transform = Transform(translation=shift)
    transform.rotation.z, transform.rotation.w = math.sin(0.5 * angle), math.cos(0.5 * angle)
    stamped = TransformStamped(transform=transform)
    frame = RobotFrame(ROBOT, SimpleNamespace(lookup_transform=lambda *_: stamped))
    (hand,) = frame.read_obstacles(to_obstacles_message([HAND], 5.0, 'camera'))
    assert hand.body.pose == pytest.approx((1.5, 4.0, 0.2 + angle))
    assert hand.velocity == pytest.approx((0.2, 0.1, 0.3))
    (same,) = frame.read_obstacles(to_obstacles_message([HAND], 5.0, 'truss'))
    assert same.body.pose == pytest.approx(HAND.body.pose)


def changed(**fields):
    """Return a message with a hand whose fields are changed."""
    message = to_obstacles_message([HAND], 5.0, 'truss')
    for path, value in fields.items():
        *parents, last = path.split('__')
        target = message.obstacles[0]
        for name in parents:
            target = getattr(target, name)
        setattr(target, last, value)
    return message


@pytest.mark.parametrize(
    ('message', 'words'),
    [
        (changed(name=''), "name of an obstacle ''"),
        (changed(shape__shape=7), "obstacle 'hand': shape 7: must be one of"),
        (changed(shape__diameter=1000.0), "obstacle 'hand': .* if it is in mm, it is 1 m"),
        (changed(shape__mass=[2.0]), "obstacle 'hand': mass, center_of_mass and friction must"),
        (changed(pose__position__x=math.nan), "obstacle 'hand' at .*finite"),
        (changed(pose__orientation__w=3.0), "obstacle 'hand': the quaternion has norm"),
        (changed(velocity__linear__x=90.0), "obstacle 'hand': velocity .* at most 5 m/s"),
        (changed(velocity__linear__z=1.0), "obstacle 'hand': twist with linear.z 1.0"),
        (to_obstacles_message([HAND, HAND], 5.0, ''), "'hand': named twice"),
    ],
)
def test_invalid_obstacles_in_messages_are_refused_with_their_names(message, words):
    with pytest.raises(MessageError, match=words):
        read_obstacles(message)


def test_wall_is_no_moving_obstacle():
    with pytest.raises(GraspError, match="'floor': a wall does not move"):
        to_obstacles_message(
            [Obstacle('floor', ConvexObject(HalfPlane(), (0.0, 0.0, 0.0)))], 0.0, ''
        )
