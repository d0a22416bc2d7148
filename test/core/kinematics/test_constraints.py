# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""First and second derivatives of the constraints (12) against finite differences."""

from hypothesis import given
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

    derivative = robot.constraints.second_derivative(points, weights, motions)
    wanted = differences(numbers, points).T
    assert derivative == pytest.approx(wanted, abs=1e-5 * np.abs(wanted).max())
