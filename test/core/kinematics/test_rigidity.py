# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rigidity index: the smallest singular value of the matrix of (12) over that at home."""

from isotruss_ros.core import load_robot
from isotruss_ros.core.kinematics.rigidity import Modes, rigidity_index
import numpy as np
import pytest
import robots


def scaled_matrix(config):
    """Return the matrix of (12), its rows of angles times the rod length."""
    m, matrix = config.robot.topology.n_modules, robots.dense_matrix(config)
    matrix[slice(4 * m, 5 * m)] *= config.robot.description.module.rod_length
    return matrix


def least_singular_value(config):
    """Return the smallest singular value of that matrix."""
    return np.linalg.svd(scaled_matrix(config), compute_uv=False)[-1]


@pytest.mark.parametrize('case', [*robots.PRESETS, 0, 1, 2])
def test_modes_agree_with_a_singular_value_decomposition(case):
    robot = load_robot(case) if isinstance(case, str) else robots.random_robot(case)
    measure = rigidity_index(robot)
    rng = np.random.default_rng(1)
    for _ in range(3):
        config = robots.random_state(robot, rng, 0.1)
        modes = measure.modes(config)
        expected = least_singular_value(config) / least_singular_value(robot.home)
        assert modes.values[0] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize('case', [*robots.PRESETS, 0, 1])
def test_gradient_of_the_index_is_that_of_the_singular_value(case):
    robot = load_robot(case) if isinstance(case, str) else robots.random_robot(case)
    measure, rng = rigidity_index(robot), np.random.default_rng(2)
    config = robots.random_state(robot, rng, 0.1)
    left, values, right = np.linalg.svd(scaled_matrix(config))
    modes = Modes(values[-1:], left[:, -1:], right[-1:].T)
    gradient = measure.gradients(config, modes)[0]
    step = 1e-6 * rng.standard_normal(len(gradient))

    def moved(sign):
        points = config.points + sign * step.view(np.complex128)
        return least_singular_value(type(config)(robot, config.roller_positions, points))

    expected = (moved(1.0) - moved(-1.0)) / (2.0 * least_singular_value(robot.home))
    assert gradient @ step == pytest.approx(expected, rel=1e-3, abs=1e-10)
