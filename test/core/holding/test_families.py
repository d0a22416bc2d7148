# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A grasp is held for all stiffnesses between two for which it is."""

from dataclasses import replace

from isotruss_ros.core import HoldStatus, place_between, Polygon, Robot, settle_grasp
import numpy as np
import pytest
from robots import preset

CHAIN = preset('open_chain')
TRAVEL = [0.0371, 0.0937, 0.0703, 0.0756, 0.0687, 0.0432]
MEMBERS = ('left/A-B', 'left/B-E')
BOX = Polygon([(-0.0845, -0.0675), (0.0845, -0.0675), (0.0845, 0.0675), (-0.0845, 0.0675)])


@pytest.mark.parametrize('scale', np.linspace(1.2, 1.45, 16))
def test_a_box_whose_corner_crosses_a_guide_ring_is_held(scale):
    # At a guide ring the centre line has a kink: with a discontinuous inclination there is no
    # equilibrium for scales from 1.25 to 1.36.
    body = place_between(CHAIN.configuration(TRAVEL), MEMBERS, BOX, -0.392086352, 0.013).body
    robot = Robot(replace(CHAIN.description, stiffness_scale=scale))
    settled = settle_grasp(robot.configuration(TRAVEL), body, 1.3, members=MEMBERS)
    assert settled.hold is HoldStatus.HELD
