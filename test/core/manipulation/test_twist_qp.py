# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The quadratic programs of the twist: solutions known by hand, and their conditions."""

from hypothesis import given, strategies
from isotruss_ros.core.manipulation.limit_handling import least_deviation, maximize_progress
from isotruss_ros.core.manipulation.limits import Rows
from isotruss_ros.core.manipulation.task import least_cost
import numpy as np
import pytest
import robots
from scipy.optimize import linprog


def random_qp(rng):
    r, k = int(rng.integers(4, 9)), int(rng.integers(1, 4))
    root = rng.standard_normal((r, r)) + 2.0 * np.eye(r)
    return root.T @ root, rng.standard_normal((k, r)), rng.standard_normal(k)


@robots.examples(100)
@given(robots.generators(), strategies.integers(1, 12), strategies.integers(0, 12))
def test_least_cost_agrees_with_minimum_norm_least_squares(rng, k, more):
    r = k + more
    even = rng.standard_normal((r, r)) + 2.0 * np.eye(r)
    left, right = (np.linalg.qr(rng.standard_normal((n, n)))[0] for n in (k, r))
    reduced = left * rng.uniform(0.5, 2.0, k) @ right[:k]
    equality, direction = np.linalg.solve(even.T, reduced.T).T, rng.standard_normal(k)
    wanted = even @ np.linalg.lstsq(equality @ even, direction, rcond=None)[0]
    size = np.abs(even).max() * np.abs(direction).max()
    assert least_cost(even, equality, direction) == pytest.approx(wanted, abs=1e-9 * size)


@robots.examples(30)
@given(robots.generators())
def test_progress_is_the_largest_within_the_bounds_at_the_least_cost(rng):
    cost, equality, direction = random_qp(rng)
    r = len(cost)
    inequality = np.vstack([np.eye(r), rng.standard_normal((r, r))])
    upper = rng.uniform(0.1, 1.0, 2 * r)
    lower = -rng.uniform(0.1, 1.0, 2 * r)
    gram = equality @ np.linalg.solve(cost, equality.T)
    least = direction @ np.linalg.solve(gram, direction)
    for reach in (1e-3, 1.0, 1e6):
        rows = Rows(inequality, lower, upper)
        u, s = maximize_progress(cost, equality, direction, reach, rows, least)
        assert equality @ u == pytest.approx(s * direction, abs=1e-8)
        assert (inequality @ u <= upper + 1e-8).all()
        assert (inequality @ u >= lower - 1e-8).all()
        assert 0.0 <= s <= reach
        best = linprog(
            np.append(np.zeros(r), -1.0),
            np.pad(np.vstack([inequality, -inequality]), ((0, 0), (0, 1))),
            np.concatenate([upper, -lower]),
            np.column_stack([equality, -direction]),
            np.zeros(len(direction)),
            [(None, None)] * r + [(0.0, reach)],
            method='highs',
        )
        assert best.status == 0
        assert s == pytest.approx(best.x[-1], rel=1e-4)


def test_rows_blocked_by_bounds_are_zero():
    bound = np.full(2, 0.5)
    for wanted, followed in ((0.4, 0.4), (1.0, 0.0)):
        speeds = np.array([0.3, wanted])
        limited = Rows(np.eye(2), -bound - speeds, bound - speeds)
        change = least_deviation(np.eye(2), np.eye(2), 1, speeds[1:], limited, 1e-9)
        assert speeds + change == pytest.approx([0.3, followed], abs=1e-6)
