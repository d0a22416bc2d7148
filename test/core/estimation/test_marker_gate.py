# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Wrong markers and slipping rollers, and covariances after updates."""

from isotruss_ros.core.estimation.grip_belief import condition, SchmidtFilter
from isotruss_ros.core.estimation.offset_filter import FALSE_ALARM_PROBABILITY, judge_markers
import numpy as np
import pytest
import scipy

#: Derivatives of six markers by six rollers, and covariance of the markers [m^2].
RATES, NOISE, SLIP = np.random.default_rng(0).normal(size=(12, 6)), 1e-6 * np.eye(12), 0.02
REACH = np.full(6, 2.0 * SLIP)


def bound(count, share):
    """Return (count, 2) equal errors [m] with a share of the largest accepted chi square."""
    limit = scipy.stats.chi2.isf(FALSE_ALARM_PROBABILITY, 2 * count)
    return np.full((count, 2), 1e-3 * np.sqrt(share * limit / (2 * count)))


@pytest.mark.parametrize(('share', 'accepted'), [(0.99, True), (1.01, False)])
def test_markers_are_accepted_up_to_the_bound_of_chi_square(share, accepted):
    off = bound(6, share)
    assert judge_markers(off, NOISE, 0.0 * RATES, REACH)[0].all() == accepted
    # The same error beside a slip, which moves the markers in other directions.
    rates = RATES - np.outer(off.ravel(), off.ravel() @ RATES) / (off**2).sum()
    slip = SLIP * np.eye(6)[3]
    used, slipped = judge_markers(off + (rates @ slip).reshape(6, 2), NOISE, rates, REACH)
    assert used.all() == accepted
    assert slipped == pytest.approx(slip if accepted else 0.0 * slip, abs=1e-9)
    # The same beside a wrong marker.
    off = np.vstack([[[0.05, 0.0]], bound(5, share)])
    used, _ = judge_markers(off, NOISE, 0.0 * RATES, REACH)
    assert not used[0]
    assert used[1:].all() == accepted


def test_half_of_the_markers_may_be_wrong():
    off = np.outer([0.05, 0.0, -0.08, 0.0, 0.0, 0.06], [1.0, -1.0])
    used, _ = judge_markers(off, NOISE, 0.0 * RATES, REACH)
    assert used.tolist() == [False, True, False, True, True, False]


@pytest.mark.parametrize('roller', range(6))
def test_the_slip_of_a_roller_is_found_and_all_markers_are_used(roller):
    slip = SLIP * np.eye(6)[roller]
    used, slipped = judge_markers((RATES @ slip).reshape(6, 2), NOISE, RATES, REACH)
    assert used.all()
    assert slipped == pytest.approx(slip, abs=1e-9)


@pytest.mark.parametrize('marker', range(6))
def test_a_wrong_marker_is_rejected_without_slip(marker):
    off = 0.05 * np.eye(6)[marker][:, None] * [1.0, -1.0]
    used, slipped = judge_markers(off, NOISE, RATES, REACH)
    assert used.tolist() == [number != marker for number in range(6)]
    assert not slipped.any()


@pytest.mark.parametrize(('across', 'slips'), [(1e-4, True), (4e-3, False)])
def test_of_slip_and_a_wrong_marker_the_one_with_smaller_chi_square_is_found(across, slips):
    rates, off = np.zeros((12, 6)), np.full((6, 2), 4e-4)
    rates[0, 0], off[0] = 1.0, (SLIP, across)
    used, slipped = judge_markers(off, NOISE, rates, REACH)
    assert used.all() == slips
    assert slipped.any() == slips


def test_a_slip_that_explains_all_markers_is_more_probable_than_two_wrong_ones():
    rates, off = np.zeros((12, 6)), np.full((6, 2), 4e-4)
    rates[[0, 2], 0], off[:2] = 1.0, (SLIP, 3e-3)
    used, slipped = judge_markers(off, NOISE, rates, REACH)
    assert used.all()
    assert slipped == pytest.approx(SLIP * np.eye(6)[0], abs=1e-9)


def test_a_slip_is_at_most_the_travel():
    off = (RATES @ (3.0 * SLIP * np.eye(6)[2])).reshape(6, 2)
    assert not judge_markers(off, NOISE, RATES, REACH)[1].any()


RNG = np.random.default_rng(0)
#: Bounds and sizes of the factors of decay, and of the variances of state and parameters by noise.
PARTS = ((0.5, 1.0, 3), (0.0, 0.1, 3), (0.0, 1.0, 2))


def drawn(size, count):
    """Return a random prior covariance, rates and noise."""
    spread = RNG.normal(size=(size, size))
    noise = np.diag(RNG.uniform(0.1, 1.0, count))
    return spread @ spread.T + np.eye(size), RNG.normal(size=(count, size)), noise


def test_a_linear_update_is_least_squares():
    (prior, rates, noise), measured = drawn(5, 8), RNG.normal(size=8)
    gain, _, covariance = condition(prior, rates, noise)
    root = np.linalg.cholesky(np.linalg.inv(prior)).T
    rows = np.vstack([root, rates / np.sqrt(np.diag(noise))[:, None]])
    right = np.concatenate([np.zeros(5), measured / np.sqrt(np.diag(noise))])
    assert gain @ measured == pytest.approx(scipy.linalg.lstsq(rows, right)[0])
    assert covariance == pytest.approx(np.linalg.inv(rows.T @ rows))


def test_the_filter_is_a_kalman_filter_whose_gain_for_the_parameters_is_zero():
    prior, _, _ = drawn(3, 2)
    considered = SchmidtFilter(prior, np.zeros((3, 2)), np.eye(2))
    whole = scipy.linalg.block_diag(prior, np.eye(2))
    for _ in range(6):
        decay, more, _ = (RNG.uniform(*part) for part in PARTS)
        considered = considered.predicted(decay, more, np.zeros(2))
        both = np.append(decay, [1.0, 1.0])
        whole = whole * np.outer(both, both) + np.diag([*more, 0.0, 0.0])
        (_, rates, noise), by_parameters = drawn(3, 2), RNG.normal(size=(2, 2))
        considered, gain = considered.conditioned(rates, by_parameters, noise)
        gain = np.vstack([gain, np.zeros((2, 2))])
        remaining = np.eye(5) - gain @ np.hstack([rates, by_parameters])
        whole = remaining @ whole @ remaining.T + gain @ noise @ gain.T
    functions = RNG.normal(size=(4, 5))
    expected = functions @ whole @ functions.T
    assert considered.spread(functions[:, :3], functions[:, 3:]) == pytest.approx(expected)
