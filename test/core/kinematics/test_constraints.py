# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rows of (12): what they measure, their derivatives, and steps that fulfil them."""

from types import SimpleNamespace

from hypothesis import given
from isotruss_ros.core.kinematics.constraints import follow_branch
import numpy as np
import pytest
import robots
from scipy.sparse import issparse

EPSILON = 1e-6


def shaken(config, rng, size=0.01):
    """Return points near a configuration that fulfil no constraint."""
    points = config.points.view(float)
    return (points + rng.uniform(-size, size, len(points))).view(complex)


def differences(rows, points):
    """Return central differences of rows by the node coordinates."""
    flat = points.view(float)
    columns = []
    for i in range(len(flat)):
        step = np.zeros(len(flat))
        step[i] = EPSILON
        change = rows((flat + step).view(complex)) - rows((flat - step).view(complex))
        columns.append(change / (2.0 * EPSILON))
    return np.array(columns).T


@robots.examples(25)
@given(robots.robots(), robots.generators())
def test_matrix_is_the_derivative_of_the_residual(robot, rng):
    config = robots.random_state(robot, rng)
    for points in (robot.home.points, config.points, shaken(config, rng)):
        wanted = differences(lambda p: robot.constraints.residual(p, robot.home_lengths), points)
        assert robot.constraints.matrix(points) == pytest.approx(wanted, abs=1e-6)


@robots.examples(10)
@given(robots.robots(), robots.generators())
def test_second_derivative_agrees_with_finite_differences(robot, rng):
    points = shaken(robot.home, rng)
    rows, columns = robot.constraints.matrix(points).shape
    weights, motions = rng.standard_normal((rows, 3)), rng.standard_normal((columns, 3))

    def numbers(moved):
        matrix = robot.constraints.matrix(moved)
        full = matrix.toarray() if issparse(matrix) else matrix
        return np.einsum('rp,rc,cp->p', weights, full, motions)

    found = robot.constraints.second_derivative(points, weights, motions)
    wanted = differences(numbers, points).T
    assert found == pytest.approx(wanted, abs=1e-5 * np.abs(wanted).max())


class Bar:
    """One point that stays on the x axis, at a distance from the origin: one branch each way."""

    def residual(self, points, targets):
        (z,) = points
        return np.array([0.5 * (abs(z) ** 2 - targets.length**2), z.imag])

    def matrix(self, points):
        (z,) = points
        return np.array([[z.real, z.imag], [0.0, 1.0]])


@pytest.mark.parametrize('sign', [1.0, -1.0])
@pytest.mark.parametrize(
    ('length', 'stays'), [(1.5, True), (0.9, True), (0.34, True), (0.32, False), (0.05, False)]
)
def test_corrections_of_more_than_half_the_predictor_are_refused(sign, length, stays):
    """From 1 to l the predictor is (1 - l^2) / 2, and (1 - l)^2 / 2 too short: half at 1/3."""
    found = follow_branch(Bar(), np.array([sign + 0j]), SimpleNamespace(length=length))
    if stays:
        assert found == pytest.approx(np.array([sign * length]), abs=1e-12)
    else:
        assert found is None


def test_a_step_to_a_singular_matrix_fails():
    assert follow_branch(Bar(), np.array([0j]), SimpleNamespace(length=1.0)) is None


def test_an_overflowing_step_fails():
    """Next to the origin the bar hardly gets longer as its end moves."""
    with np.errstate(over='ignore'):
        found = follow_branch(Bar(), np.array([1e-200 + 0j]), SimpleNamespace(length=1.0))
    assert found is None


@pytest.mark.parametrize('change', [*np.logspace(-8.0, -0.5, 31), *-np.logspace(-8.0, -0.5, 31)])
def test_constraints_hold_to_the_tolerance(change):
    found = follow_branch(Bar(), np.array([1.0 + 0j]), SimpleNamespace(length=1.0 + change))
    assert np.abs(Bar().residual(found, SimpleNamespace(length=1.0 + change))).max() <= 1e-12
