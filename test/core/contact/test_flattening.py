# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Flattening: the closed forms of the kernel, its symmetry, and that of a robot file."""

from dataclasses import replace

from isotruss_ros.core import load_robot, Robot
from isotruss_ros.core.contact.flattening import Flattening, flattening_of
from isotruss_ros.core.statics.section import Fabric
import numpy as np
import pytest

RADIUS, PRESSURE = 0.051, 34.5e3
FABRIC = Fabric(6e4, 1e4)


def kernel(count, spacing, fabric=FABRIC, **options):
    """Return the compliance of points on a line."""
    return Flattening(RADIUS, PRESSURE, fabric, **options).compliance(np.arange(count), spacing)


@pytest.mark.parametrize('fabric', [FABRIC, None])
@pytest.mark.parametrize(
    ('modes', 'spacing'), [(2, 0.005), (100, 0.005), (8, 0.001), (8, 0.0025), (8, 0.1)]
)
def test_uniform_one_sided_load_has_the_stiffness_of_four_thirds_pi_p(fabric, modes, spacing):
    # Sum over n >= 2 of 1 / (pi p (n^2 - 1)) is 3 / (4 pi p).
    half = int(0.8 / spacing) + 1
    matrix = kernel(2 * half + 1, spacing, fabric=fabric, modes=modes)
    dent = matrix[half].sum() * spacing  # of one newton per metre
    assert 1.0 / dent == pytest.approx(4.0 / 3.0 * np.pi * PRESSURE, rel=1e-6)


@pytest.mark.parametrize('fabric', [FABRIC, Fabric(3e4, 1e6)])
@pytest.mark.parametrize('pressure', [5e3, 1e5])
def test_tension_and_decay_length_of_each_mode_agree(fabric, pressure):
    kernel, n = Flattening(RADIUS, pressure, fabric), np.arange(2, 9)
    assert kernel.stiffness == pytest.approx(np.pi * pressure * (n**2 - 1.0))
    wall, shear = fabric
    share = wall / (wall + shear * n**2 * kernel.decay_length**2 / RADIUS**2)
    expected = 0.5 * np.pi * pressure * RADIUS**2 * (1.0 + 1.0 / n**2)
    expected += np.pi * RADIUS * shear * share / n**2
    assert kernel.tension == pytest.approx(expected, rel=1e-12)


def test_modes_are_strings_on_a_foundation():
    alone = Flattening(RADIUS, PRESSURE, FABRIC)
    reach = alone.decay_length
    # Without averaging over the spacing it is exp(-s / lambda) / (2 sqrt(k G)).
    matrix, spacing = kernel(400, 2e-4), 2e-4
    far = np.array([50, 100, 300])
    plain = np.exp(-far[:, None] * spacing / reach) @ (
        0.5 / np.sqrt(alone.stiffness * alone.tension)
    )
    assert matrix[0, far] == pytest.approx(plain, rel=1e-3)


@pytest.mark.parametrize('fabric', [FABRIC, None])
def test_pressure_rates_of_the_compliance_agree_with_finite_differences(fabric):
    points, spacing, step = np.array([0, 3, 4, 9]), 0.004, 1.0

    def matrix(pressure):
        return Flattening(RADIUS, pressure, fabric).compliance(points, spacing)

    slope = (matrix(PRESSURE + step) - matrix(PRESSURE - step)) / (2.0 * step)
    rates = Flattening(RADIUS, PRESSURE, fabric).compliance_rates(points, spacing)
    assert rates == pytest.approx(slope, rel=1e-6)


def test_flattening_kernel_agrees_with_the_robot_file():
    robot = load_robot('nine_member')
    stiffer = Robot(replace(robot.description, local_stiffness=1.7))
    matrix = kernel(40, 0.005)
    for each, scale in ((robot, 1.0), (stiffer, 1.7)):
        compliance = flattening_of(each, PRESSURE).compliance(np.arange(40), 0.005)
        assert compliance == pytest.approx(matrix / scale)
