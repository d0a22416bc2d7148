# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Membrane elements of an inflated tube, with which flattening is compared."""

import numpy as np
import pytest
from studies.membrane import Membrane
from studies.paper.membrane import STIFFNESS
from studies.paper.parameters import CYLINDERS, PRESSURE, PRESSURES


@pytest.fixture
def tube():
    return Membrane(PRESSURE, 8, 12)


def moved(tube, size):
    return tube.nodes + size * np.random.default_rng(0).standard_normal(tube.nodes.shape)


@pytest.mark.parametrize('forces', ['wall_forces', 'gas_forces'])
def test_derivatives_of_element_forces_are_those_of_differences(tube, forces):
    nodes, direction = moved(tube, 1e-3), moved(tube, 1.0) - tube.nodes
    at = getattr(tube, forces)
    _, rates = at(nodes)
    step = 1e-7
    difference = (at(nodes + step * direction)[0] - at(nodes - step * direction)[0]) / (2 * step)
    expected = (rates @ direction[tube.triangles].reshape(-1, 9, 1))[:, :, 0]
    assert difference == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())


def test_derivatives_of_contact_forces_are_those_of_differences(tube):
    nodes, direction = moved(tube, 1e-3), moved(tube, 1.0) - tube.nodes
    cylinder = tube.nodes[tube.grid[6, 0]] + [0.0, 0.0, 0.04], 0.05
    _, rates = tube.contact_forces(nodes, *cylinder)
    step = 1e-8
    after, _ = tube.contact_forces(nodes + step * direction, *cylinder)
    before, _ = tube.contact_forces(nodes - step * direction, *cylinder)
    expected = (rates @ direction[:, :, None])[:, :, 0]
    difference = (after - before) / (2 * step)
    assert difference == pytest.approx(expected, abs=1e-5 * np.abs(expected).max())


def test_round_tube_is_in_equilibrium_under_its_pressure():
    tube = Membrane(PRESSURE, 20, 20)
    nodes, _, _ = tube.settle(tube.nodes, True, np.array([0.0, 0.0, 1.0]), 0.1)
    assert np.abs(nodes - tube.nodes).max() < 5e-4


@pytest.mark.nightly
@pytest.mark.parametrize(('pressure', 'cylinder'), [(0, 1), (1, 0), (1, 2), (2, 1)])
def test_stiffness_is_that_of_the_page(pressure, cylinder):
    response = Membrane(PRESSURES[pressure]).press(CYLINDERS[cylinder])
    assert response.stiffness == pytest.approx(STIFFNESS[pressure, cylinder], rel=0.01)
