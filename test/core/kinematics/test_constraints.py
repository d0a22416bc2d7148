# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The rows of (12): what they measure, and their derivative."""

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
        wanted = differences(lambda p: robot.constraints.residual(p, robot.home_targets), points)
        assert robot.constraints.matrix(points) == pytest.approx(wanted, abs=1e-6)


@robots.examples(10)
@given(robots.robots(), robots.generators())
def test_second_derivative_is_that_of_weighted_rows_along_motions(robot, rng):
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
