# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Paths on which a held object would slip are refused before it moves."""

from dataclasses import replace
from types import SimpleNamespace

from carries import FRICTION, make_robot, place
from isotruss_ros.core import ObjectPath
from isotruss_ros.core.errors import PathError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.grip_record import GripRecord
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.paths.path_servo import PathServo
from isotruss_ros.core.planning.foresee_path import foresee_path
from isotruss_ros.nodes.path_follower import _check_path
import numpy as np
import pytest

ROBOT, NOW = make_robot(), 10.0
STILL = np.zeros(len(ROBOT.roller_names))
BODY, _ = place(ROBOT, 'brick', 0.5)
VALUES = SimpleNamespace(
    object=(
        '{shape: polygon, corner_radius: 0.02, friction: 0.8, '
        'vertices: [[-0.15, -0.1], [0.15, -0.1], [0.15, 0.1], [-0.15, 0.1]]}'
    ),
    object_diameter=0.3,
    friction=FRICTION,
    command_timeout=0.2,
)


def check(displacement, time=NOW, begin=BODY.pose, record=None):
    """Check a straight path, with rollers at home measured at a time."""
    path = ObjectPath([begin, np.add(begin, displacement)], 0.02, 0.1)
    servo = PathServo(0.02, 0.2)
    servo.rollers = StampedInput(RollerState(STILL, STILL), time)
    servo.held_grip = record and StampedInput(record, NOW)
    _check_path(ROBOT, VALUES, servo, path, NOW)


def test_a_path_on_which_the_margin_ends_is_refused_with_the_place():
    words = (
        r'the path would end \d+ % of the way, at \(0\.\d+, 0\.\d+\) m, .* rad: the slip margin'
    )
    with pytest.raises(PathError, match=words):
        check((0.3, 0.2, 0.0))


def test_a_path_is_followed_where_only_the_history_of_the_contacts_uses_the_margin():
    body, members = place(ROBOT, 'brick', 0.5)
    numbers = np.array([ROBOT.member_names.index(name) for name in members])
    held = attach_grip(ROBOT.home, body, numbers)
    # It has slipped on both members, which turned it and left little of its margin.
    slipped = roll_grip(replace(held, anchors=held.anchors - 0.014), ROBOT.home)
    path = np.array([slipped.pose, np.add(slipped.pose, (0.0, -0.05, 0.0))])
    assert foresee_path(slipped, FRICTION, path).why
    check((0.0, -0.05, 0.0), record=GripRecord.of(slipped))


@pytest.mark.parametrize(
    'asked',
    [
        {'displacement': (0.0, -0.05, 0.0)},
        {'displacement': (0.3, 0.2, 0.0), 'time': NOW - 1.0},
        {'displacement': (0.3, 0.2, 0.0), 'begin': (0.7, 0.0, 0.0)},
    ],
    ids=['margin left', 'old rollers', 'not held'],
)
def test_other_paths_are_followed(asked):
    check(**asked)
