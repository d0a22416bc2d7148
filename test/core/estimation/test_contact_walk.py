# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sums of pose corrections, from which slip is detected."""

from isotruss_ros.core.estimation.contact_walk import ContactWalk, SUM_INTERVALS
import numpy as np
import pytest

NOISE = 1e-6 * np.eye(3)
BY_OFFSETS, OFFSETS = np.zeros((3, 6)), np.zeros((6, 6))


def add(walk, time, moved):
    """Add a correction of a pose whose contacts are known."""
    walk.add(time, np.array(moved), np.zeros((3, 3)), NOISE, BY_OFFSETS, OFFSETS)


def test_the_length_of_a_walk_is_the_norm_of_its_largest_sum():
    walk = ContactWalk()
    add(walk, 0.0, (0.003, 0.0, 0.0))
    add(walk, 0.5, (0.0, 0.004, 0.0))
    assert walk.length == pytest.approx(0.005)


def test_the_deviation_of_a_sum_contains_the_random_walk_of_its_interval():
    walk = ContactWalk()
    add(walk, 0.0, np.zeros(3))
    walk.spread(3.0 * NOISE)
    add(walk, 0.1, (0.004, 0.0, 0.0))
    assert walk.deviations == pytest.approx(2.0)


def test_a_random_walk_before_all_intervals_does_not_hide_a_slip():
    walk, slip = ContactWalk(), (0.01, 0.0, 0.0)
    add(walk, 0.0, np.zeros(3))
    walk.spread(1e4 * NOISE)
    time = 2.0 * SUM_INTERVALS[-1]
    add(walk, time, np.zeros(3))
    add(walk, time, slip)
    assert walk.deviations == pytest.approx(10.0)
