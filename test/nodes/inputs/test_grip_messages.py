# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Held grips in messages, and those that are refused."""

import array

from held_grips import BOX, held, HOME, NINE
from isotruss_msgs.msg import HeldGrip
from isotruss_ros.core.holding.grip_record import GripEstimate, GripRecord
from isotruss_ros.nodes.conversions.messages import MessageError
from isotruss_ros.nodes.conversions.state_messages import read_grip, to_grip_message
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

GRIP = held(BOX, 0.2)
DISPLACED = 1e-4 * np.arange(12.0), 1e-3 * np.arange(72.0).reshape(12, 6)
ESTIMATE = GripEstimate(np.array([0.5, 0.4, 0.1]), 1e-6 * np.eye(3), 20.0, 3.0, 0.02, *DISPLACED)


def message():
    record = GripRecord.of(GRIP, ESTIMATE, is_assumed=True)
    packed = serialize_message(to_grip_message(record, NINE, 2.5))
    return deserialize_message(packed, HeldGrip)


def test_grips_survive_a_round_trip():
    record = read_grip(message(), NINE)
    result = record.restore(HOME, GRIP.body)
    assert result.pose == pytest.approx(GRIP.pose, abs=1e-12)
    assert result.normal_forces == pytest.approx(GRIP.normal_forces, rel=1e-9)
    assert record.estimate.pose.tolist() == ESTIMATE.pose.tolist()
    assert record.estimate.pose_covariance.tolist() == ESTIMATE.pose_covariance.tolist()
    assert record.estimate[2:5] == ESTIMATE[2:5]
    assert [values.tolist() for values in record.estimate[5:]] == [v.tolist() for v in DISPLACED]
    assert record.is_assumed


@pytest.mark.parametrize(
    'changes',
    [
        {'travel': [0.0]},
        {'travel': [float('nan')] * 6},
        {'pressures': [1e4]},
        {'pressures': [1e4, 1e4, 34.5]},
        {'members': ['north/R-P', 'south/P-Q']},
        {'members': ['south/P-Q', 'south/P-Q']},
        {'members': ['south/P-Q', 'west/A-B']},
        {'corners': [0]},
        {'unknowns': [0.0] * 10},
        {'unknowns': [float('inf')] * 11},
        {'responses': [0.1]},
        {'bent': [float('nan')]},
        {'joint_displacements': [0.0]},
        {'joint_displacement_rates': [float('nan')] * 72},
        {'pose_covariance': [-1.0] * 9},
    ],
)
def test_grips_that_are_not_usable_are_refused(changes):
    changed = message()
    for name, value in changes.items():
        kind = 'I' if name == 'corners' else 'd'
        setattr(changed, name, value if name == 'members' else array.array(kind, value))
    with pytest.raises(MessageError):
        read_grip(changed, NINE)
