# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Held grips in messages, and those that are refused."""

import array

from held_grips import BOX, held, HOME, NINE
from isotruss_msgs.msg import HeldGrip
from isotruss_ros.core.holding.grip_record import GripRecord
from isotruss_ros.nodes.conversions.messages import MessageError
from isotruss_ros.nodes.conversions.state_messages import read_grip, to_grip_message
import pytest
from rclpy.serialization import deserialize_message, serialize_message

GRIP = held(BOX, 0.2)


def message():
    """Return the message of a grip, as it comes over the network."""
    packed = serialize_message(to_grip_message(GripRecord.of(GRIP), NINE, 2.5))
    return deserialize_message(packed, HeldGrip)


def test_grips_survive_a_round_trip():
    found = read_grip(message(), NINE).restore(HOME, GRIP.body)
    assert found.pose == pytest.approx(GRIP.pose, abs=1e-6)
    assert found.normal_forces == pytest.approx(GRIP.normal_forces, rel=1e-3)


@pytest.mark.parametrize(
    'changes',
    [
        {'travel': [0.0]},
        {'travel': [float('nan')] * 6},
        {'pressures': [1e4]},
        {'members': ['north/R-P', 'south/P-Q']},
        {'members': ['south/P-Q', 'south/P-Q']},
        {'members': ['south/P-Q', 'west/A-B']},
        {'corners': [0]},
        {'before': [float('nan'), 0.0]},
        {'behind': [-1.0, 0.0]},
        {'unknowns': [0.0] * 10},
        {'unknowns': [float('inf')] * 11},
    ],
)
def test_grips_that_are_not_usable_are_refused(changes):
    made = message()
    for name, value in changes.items():
        kind = 'I' if name == 'corners' else 'd'
        setattr(made, name, value if name == 'members' else array.array(kind, value))
    with pytest.raises(MessageError):
        read_grip(made, NINE)
