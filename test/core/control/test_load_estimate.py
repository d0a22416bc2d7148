# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The load on a held object, against least squares and in closed form."""

from isotruss_ros.core.control.load_estimate import LoadEstimate
from isotruss_ros.core.control.loop_gains import LoopGains
import numpy as np
import pytest

RADIUS, PERIOD = 0.2, 0.01
GAINS = LoopGains(pose=50.0, squeeze=5.0, bias=2.0, filter_time=0.02)


def test_the_wrench_is_the_most_probable_one():
    """Errors of the pose count against 0.3 mm, turns at the radius, and the wrench against 5 N."""
    rng = np.random.default_rng(0)
    load = LoadEstimate(5.0)
    even = np.array([1.0, 1.0, RADIUS])
    passed = 1.0 - np.exp(-0.5)  # in 10 ms of 20 ms
    for _ in range(4):
        compliance = 1e-3 * rng.normal(size=(3, 3))
        measured, wrench, bias, before = (
            1e-3 * rng.normal(size=3),
            load.wrench,
            load.bias,
            load.offset,
        )
        # What is measured has the wrench so far in the model.
        change, borne = load.update(
            measured - compliance @ wrench, compliance, RADIUS, PERIOD, GAINS, lambda more: True
        )
        assert borne
        offset = before + passed * (measured - before)
        rows = np.vstack([even[:, None] * compliance / 3e-4, np.eye(3) / 5.0])
        right = np.append(even * offset / 3e-4, np.zeros(3))
        probable = np.linalg.lstsq(rows, right, rcond=None)[0]
        assert load.offset == pytest.approx(offset)
        assert change == pytest.approx(passed * (probable - wrench))
        assert load.wrench == pytest.approx(wrench + change)
        left = offset - compliance @ load.wrench
        assert load.bias == pytest.approx(bias + (1.0 - np.exp(-0.02)) * (left - bias))


def test_a_load_from_the_start_is_taken_over_whole():
    load, offset = LoadEstimate(50.0), np.array([4e-3, 2e-3, 0.0])
    load.begin(offset, 2e-3 * np.eye(3), RADIUS, lambda wrench: True)
    assert load.wrench[:2] == pytest.approx([2.0, 1.0], abs=0.01)
    assert 2e-3 * load.wrench + load.bias == pytest.approx(offset)


def test_a_load_under_which_the_object_would_slip_is_not_believed():
    load, real = LoadEstimate(50.0), 0.02 * np.array([1.0, 0.0, 0.0])
    for _ in range(200):
        held = load.update(
            real - 2e-3 * load.wrench,
            2e-3 * np.eye(3),
            RADIUS,
            PERIOD,
            GAINS._replace(filter_time=0.2),
            lambda more: np.linalg.norm(load.wrench + more) < 3.0,
        )[1]
    assert not held
    assert 2.5 < load.wrench[0] < 3.0


def test_where_no_load_is_expected_errors_of_the_model_do_not_become_one():
    load = LoadEstimate(0.0)
    load.begin(np.array([0.01, 0.0, 0.0]), 5e-3 * np.eye(3), RADIUS, lambda wrench: True)
    assert not load.wrench.any()
    assert load.bias == pytest.approx([0.01, 0.0, 0.0])
