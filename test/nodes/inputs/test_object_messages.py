# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Objects in messages: round trips, and refused messages."""

import math

from geometry_msgs.msg import Point, Pose
from hypothesis import given
from hypothesis import strategies as st
from isotruss_msgs.msg import ConvexObject as ObjectMessage
from isotruss_ros.core import ConvexObject
from isotruss_ros.nodes.conversions.messages import MessageError, to_pose_message
from isotruss_ros.nodes.conversions.object_messages import read_described, to_object_message
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from shapes import random_shape

CORNERS = [(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)]


def points(corners):
    return [Point(x=float(x), y=float(y), z=7.0) for x, y in corners]


def box(**fields):
    usual = {'shape': ObjectMessage.POLYGON, 'vertices': points(CORNERS)}
    return ObjectMessage(**(usual | fields))


def read(message, pose=None):
    return read_described(message, Pose() if pose is None else pose, 'diameter', 0.0)


@given(
    st.integers(0, 2**32 - 1),
    st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(-3.0, 3.0)),
    st.none() | st.floats(1e-3, 100.0),
    st.booleans(),
    st.none() | st.floats(0.0, 10.0),
)
def test_objects_survive_a_round_trip(seed, place, mass, weighted, friction):
    shape = random_shape(np.random.default_rng(seed))
    inside = (shape.centroid.real, shape.centroid.imag) if weighted else None
    body = ConvexObject(shape, place, mass, inside, friction)
    sent = deserialize_message(serialize_message(to_object_message(body)), ObjectMessage)
    result = read(sent, to_pose_message(body.pose))
    assert result.moved_to(place) == body  # to the last digit
    assert result.pose == pytest.approx(body.pose, abs=1e-12)


DISC = {'shape': ObjectMessage.DISC, 'diameter': 0.3}
REFUSED = {
    'no shape': (ObjectMessage(diameter=0.3), r'object: shape 0: must be one of 1 \(a disc\), 2'),
    'a disc with vertices': (
        ObjectMessage(**DISC, vertices=points(CORNERS)),
        "object: unknown key 'vertices'; those of shape disc are shape, diameter, mass",
    ),
    'a polygon with a diameter': (
        box(diameter=math.nan),
        "unknown key 'diameter'; .*those of shape polygon",
    ),
    'friction in percent': (
        ObjectMessage(**DISC, friction=[80.0]),
        "object: the object's friction 80.0: must be from 0 to 10; if it is in percent, it is 0.8",
    ),
    'mass elsewhere': (
        box(center_of_mass=points([(1.0, 0.0)])),
        r'center_of_mass \(1, 0\) m: must be within the object',
    ),
}


@pytest.mark.parametrize('case', REFUSED)
def test_invalid_objects_are_refused_with_the_faulty_field(case):
    message, words = REFUSED[case]
    with pytest.raises(MessageError, match=words) as error:
        read(message)
    assert len(str(error.value)) < 300
