# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Membrane elements of an inflated tube, with which flattening is compared."""

import numpy as np
import pytest
from studies.membrane import Membrane
from studies.paper.membrane import STIFFNESS
from studies.paper.parameters import CYLINDERS, PRESSURE, PRESSURES


def test_round_tube_is_in_equilibrium_under_its_pressure():
    tube = Membrane(PRESSURE, 20, 20)
    nodes, _, _ = tube.settle(tube.nodes, True, np.array([0.0, 0.0, 1.0]), 0.1)
    assert np.abs(nodes - tube.nodes).max() < 5e-4


@pytest.mark.nightly
@pytest.mark.parametrize(('pressure', 'cylinder'), [(0, 1), (1, 0), (1, 2), (2, 1)])
def test_stiffness_is_that_of_the_page(pressure, cylinder):
    response = Membrane(PRESSURES[pressure]).press(CYLINDERS[cylinder])
    assert response.stiffness == pytest.approx(STIFFNESS[pressure, cylinder], rel=0.01)
