# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Messages from bytes are those that rclpy makes of them, and bytes what it reads as them."""

import math
import struct

from geometry_msgs.msg import PoseStamped, Twist, WrenchStamped
from hypothesis import given
from hypothesis import strategies as st
from isotruss_msgs.msg import GraspState, ManipulationStatus
from isotruss_ros.nodes.framework import kept_message
from isotruss_ros.nodes.framework.kept_message import KeptBytes, KeptMessage
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

KINDS = (JointState, PoseStamped, Twist, WrenchStamped, ManipulationStatus)
numbers = st.floats(allow_nan=False)
texts = st.text(st.characters(codec='utf-8', exclude_characters='\x00'), max_size=9)


def draw_fields(data, message, lengths):
    """Fill a message; texts and lengths of sequences are drawn once, by the name of the field."""
    for name, kind in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        if kind == 'double':
            setattr(message, name, data.draw(numbers))
        elif kind in kept_message.CODES:
            setattr(message, name, data.draw(st.integers(0, 127)))
        elif kind == 'string':
            setattr(message, name, lengths.setdefault(name, data.draw(texts)))
        elif kind == 'sequence<string>':
            drawn = data.draw(st.lists(texts, max_size=4))
            setattr(message, name, list(lengths.setdefault(name, drawn)))
        elif kind == 'sequence<double>':
            length = lengths.setdefault(name, data.draw(st.integers(0, 5)))
            setattr(message, name, data.draw(st.lists(numbers, min_size=length, max_size=length)))
        elif hasattr(value, 'get_fields_and_field_types'):
            draw_fields(data, value, lengths)
    return message


@pytest.mark.parametrize('kind', KINDS)
@given(data=st.data())
def test_numbers_change_without_the_middleware_and_texts_with_it(kind, data):
    kept, asked = KeptMessage(kind), []

    def deserialize(given_bytes, given_kind):
        asked.append(given_kind)
        return deserialize_message(given_bytes, given_kind)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kept_message, 'deserialize_message', deserialize)
        for _ in range(2):
            lengths = {}
            for _ in range(3):
                message = draw_fields(data, kind(), lengths)
                assert kept.read(bytes(serialize_message(message))) == message
        assert len(asked) <= 2


@pytest.mark.parametrize('kind', [*KINDS, Float64MultiArray])
@given(data=st.data())
def test_bytes_are_those_of_the_message_as_it_is(kind, data):
    message = kind()
    kept = KeptBytes(message)
    for _ in range(2):
        lengths = {}
        for _ in range(3):
            draw_fields(data, message, lengths)
            packed = kept.pack()
            assert type(packed) is bytes
            assert deserialize_message(packed, kind) == message


def test_what_the_middleware_packs_is_published_as_it_is():
    message = GraspState()
    assert KeptBytes(message).pack() is message


def test_a_kind_with_other_fields_is_made_by_the_middleware():
    kept = KeptMessage(GraspState)
    first = kept.read(bytes(serialize_message(GraspState(slip_margin=1.0))))
    second = kept.read(bytes(serialize_message(GraspState(displacement=[1.0, 2.0, 3.0]))))
    assert first.slip_margin == 1.0
    assert second.displacement.tolist() == [1.0, 2.0, 3.0]
    assert first is not second


def test_bytes_that_are_no_message_are_none():
    kept = KeptMessage(JointState)
    message = JointState(name=['a', 'bc'], position=[1.0, 2.0])
    good = bytes(serialize_message(message))
    for garbage in (b'', good[:3], good[:40], b'\xff' * len(good), good[:4] + b'\xff' * 40):
        assert kept.read(good) == message
        assert kept.read(garbage) is None


def test_other_encodings_are_left_to_the_middleware():
    values = (0.5, -1.0, math.inf, 2.0, 3.0, 4.0)
    kept = KeptMessage(Twist)
    for head, order in ((b'\x00\x01\x00\x00', '<'), (b'\x00\x00\x00\x00', '>')) * 2:
        twist = kept.read(head + struct.pack(f'{order}6d', *values))
        assert (twist.linear.x, twist.linear.y, twist.linear.z) == values[:3]
        assert (twist.angular.x, twist.angular.y, twist.angular.z) == values[3:]
