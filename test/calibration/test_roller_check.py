# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which roller turned, from the joints that it moved."""

import re

from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.calibration.roller_check import judge_roller
from isotruss_ros.core import load_robot
import numpy as np
import pytest

ROBOT, NOISE = load_robot('nine_member'), 1e-3
NAMES, ROLLERS = ROBOT.topology.joint_names, ROBOT.roller_names


def turn(roller, travel, joints=('P', 'R', 'Z'), seed=0):
    """Return how joints are measured to move with a roller."""
    positions = np.zeros(len(ROLLERS))
    positions[ROLLERS.index(roller)] = travel
    moved = ROBOT.configuration(positions).nodes - ROBOT.home.nodes
    moved = moved + NOISE * np.random.default_rng(seed).normal(size=moved.shape)
    return {name: tuple(moved[NAMES.index(name)]) for name in joints}


@pytest.mark.parametrize('roller', ROLLERS)
def test_three_joints_distinguish_every_roller(roller):
    assert judge_roller(ROBOT.home, roller, 0.02, turn(roller, 0.02), NOISE) == ''


@pytest.mark.parametrize('roller', ROLLERS)
@pytest.mark.parametrize(
    ('travel', 'words'),
    [
        (-0.02, 'turned the other way'),
        (0.03, r'turned by \+(2[7-9]|3[0-3])\..* in place of \+20'),
        (0.0, 'no meas'),
    ],
)
def test_a_wrong_sign_or_scale_is_named(roller, travel, words):
    assert re.search(words, judge_roller(ROBOT.home, roller, 0.02, turn(roller, travel), NOISE))


def test_rollers_that_are_swapped_are_named():
    result = judge_roller(ROBOT.home, 'south/P', 0.02, turn('east/Q', 0.02), NOISE)
    assert result.startswith('east/Q turned in its place')


def test_a_motion_that_no_single_roller_causes_is_reported():
    moved = {'P': (0.05, 0.0), 'R': (-0.05, 0.0), 'Z': (0.0, 0.05)}
    reported = [judge_roller(ROBOT.home, roller, 0.02, moved, NOISE) for roller in ROLLERS]
    assert any('no single roller explains' in sentence for sentence in reported)


def test_a_check_without_joints_is_refused():
    with pytest.raises(MeasurementError, match='no joint was measured: must be some of P, Q'):
        judge_roller(ROBOT.home, 'south/P', 0.02, {}, NOISE)
