# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Motion in time: the held object's pose, commands for the middle of their interval, no drift."""

from grips import apart, disc_grip, drive
from isotruss_ros.core import load_robot, RollingGrip
import numpy as np
import pytest
import robots

HOME = load_robot('nine_member').home
MODULE = 'east/Q'
START = RollingGrip.attach(HOME, disc_grip(HOME, MODULE))
TWIST = np.array([0.02, 0.04, 0.15])


def opening(config):
    """Return the angle between the members at the grip's module."""
    b, b_end, c, c_end = robots.side_ends(config, MODULE)
    return abs(np.angle((c_end - c) / (b_end - b)))


def drift(rate, lead, seconds=2.0):
    """Return how far object and grip are from where a constant twist should have led them."""
    end = drive(START, TWIST, seconds, rate, lead)
    distance, angle = apart(end.pose, np.array(START.pose) + seconds * TWIST)
    return distance, angle, abs(opening(end.config) - opening(HOME))


def test_midpoint_rule_is_of_second_order_and_euler_of_first():
    first = np.array([drift(rate, 0.0) for rate in (10.0, 20.0)])
    second = np.array([drift(rate, 0.5 / rate) for rate in (10.0, 20.0)])
    assert first[0] / first[1] == pytest.approx([2.0, 2.0, 2.0], rel=0.1)
    # The robot is symmetric: what is left of one coordinate is rounding.
    assert (second[0] > 3.6 * second[1] - 1e-9).all()
    # At the same rate the midpoint is far ahead.
    assert (second[1] < 0.05 * first[1]).all()
