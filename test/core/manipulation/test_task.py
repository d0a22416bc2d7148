# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What rollers can reach while rows of a grip are kept, against null spaces of these rows."""

from hypothesis import given, strategies
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.manipulation.task import find_task, Reach, WorkingRollers
import numpy as np
import pytest
import robots
from scipy.linalg import null_space

#: Rows whose rates are smaller do not count [m/s].
LOST = 1e-5


def working(count):
    """Return rollers that all work, whose speeds cost alike."""
    return WorkingRollers(count, np.arange(count), np.eye(count))


def reach_of(rows, radius):
    """Return what all rollers can do with an object, by the rows of its grip."""
    return Reach.of(rows, working(rows.shape[1]), np.array([1.0, 1.0, radius]))


def kernel(rows):
    """Return what keeps rows at zero, as orthonormal columns."""
    return null_space(rows, rcond=1e-9) if rows.any() else np.eye(rows.shape[1])


@pytest.mark.parametrize('opens', [False, True])
@pytest.mark.parametrize('dependent', [False, True])
@robots.examples(25)
@given(robots.generators(), strategies.integers(1, 3), strategies.integers(0, 3))
def test_tasks_accept_twists_of_any_magnitude(opens, dependent, rng, held, more):
    """Direction and size are those of the nearest reachable twist, weighted."""
    radius, rows = rng.uniform(0.1, 1.0), rng.standard_normal((3 + held, 3 + held + more))
    if dependent:
        rows[1] = rows[0] * rng.uniform(0.5, 2.0)
    reach = reach_of(rows, radius)
    twist = 10.0 ** rng.uniform(-200.0, 200.0) * rng.standard_normal(3)
    opening = opens * np.abs(twist).max() * rng.uniform(0.5, 2.0)
    task = find_task(reach, twist, opening)
    weighted = np.array([1.0, 1.0, radius]) * twist
    nearest = reach.directions.T @ (reach.directions @ weighted)
    size = np.abs(weighted).max()
    reachable = np.abs(nearest - weighted).max() < 1e-6 * size
    assert task.status is (Status.OK if reachable else Status.UNREACHABLE)
    speeds = task.free * task.speed / size
    assert reach.weights * (rows[:3] @ speeds) == pytest.approx(nearest / size, abs=1e-9)
    assert rows[3:] @ speeds == pytest.approx(opening / size * np.eye(held)[0], abs=1e-8)
    # No other speeds of less cost do.
    assert kernel(rows).T @ speeds == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize('rollers', range(8))
@pytest.mark.parametrize('held', [1, 2, 3, 6])
def test_rank_is_bounded_by_the_rollers(held, rollers, capfd):
    """By singular values alone, for rows of very different sizes and nearly parallel ones."""
    rng = np.random.default_rng([held, rollers])
    for _ in range(300):
        rows = rng.standard_normal((3 + held, rollers))
        rows *= 10.0 ** rng.uniform(-3.5, 0.5, (3 + held, 1))
        one, other = rng.permutation(3 + held)[:2]
        rows[one] += 10.0 ** rng.uniform(-1.0, 2.0) * rows[other]
        _, gains, kept = np.linalg.svd(rows[3:], full_matrices=False)
        kept = kept[gains > LOST]
        left = np.linalg.svd(rows[:3] - rows[:3] @ kept.T @ kept, compute_uv=False)
        reach = reach_of(rows, 1.0)
        assert len(reach.directions) == (left > LOST).sum()
        assert len(reach.rows) == (left > LOST).sum() + len(kept)
    assert capfd.readouterr() == ('', '')


def test_a_grip_without_opening_rollers_has_no_task():
    task = find_task(reach_of(np.zeros((4, 0)), 1.0), np.zeros(3), 1.0)
    assert task.speed == 0.0


def test_only_the_first_row_of_a_grip_is_its_opening():
    rows = np.random.default_rng(0).standard_normal((6, 8))
    assert reach_of(rows, 0.1).opening.tolist() == [1.0, 0.0, 0.0]


@pytest.mark.parametrize('opening', [0.0, 0.3])
@pytest.mark.parametrize('soft_rank', [0.1, 0.4])
def test_nearly_singular_directions_are_reduced_by_the_square_of_the_singular_value(
    soft_rank, opening
):
    basis = np.linalg.qr(np.random.default_rng(3).standard_normal((6, 6)))[0]
    sizes = np.array([1.0, 0.5, 0.2])
    modes = np.linalg.qr(np.random.default_rng(4).standard_normal((3, 3)))[0]
    # The contact row also moves the object, which the opening rate has to compensate.
    coupling = np.array([0.3, -0.2, 0.1])
    jacobian = np.vstack([(modes * sizes) @ basis[:3] + np.outer(coupling, basis[3]), basis[3]])
    reach = reach_of(jacobian.copy(), 1.0)
    twist = np.array([0.4, -0.7, 0.5])
    task = find_task(reach, twist, opening, soft_rank)
    asked = modes.T @ (twist - opening * coupling)
    kept = np.minimum(1.0, (sizes / soft_rank) ** 2)
    expected = modes @ (kept * asked) + opening * coupling
    assert jacobian[:3] @ task.velocities == pytest.approx(expected)
    assert jacobian[3] @ task.velocities == pytest.approx(opening)
    assert task.status is (Status.UNREACHABLE if soft_rank > 0.2 else Status.OK)


def test_a_twist_without_nearly_singular_directions_is_reachable():
    basis = np.linalg.qr(np.random.default_rng(3).standard_normal((6, 6)))[0]
    modes = np.linalg.qr(np.random.default_rng(4).standard_normal((3, 3)))[0]
    jacobian = np.vstack([(modes * (1.0, 0.5, 0.2)) @ basis[:3], basis[3]])
    twist = modes[:, :2] @ (0.4, -0.7)
    task = find_task(reach_of(jacobian.copy(), 1.0), twist, soft_rank=0.4)
    assert jacobian[:3] @ task.velocities == pytest.approx(twist)
    assert task.status is Status.OK
