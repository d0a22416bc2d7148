# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""`deform` and `settle_grasp` bend one structure."""

from isotruss_ros.core import deform, Disc, place_between, Polygon, settle_grasp
from isotruss_ros.core.holding.held_shape import held_joints
from isotruss_ros.core.manipulation.grip import members_at
import numpy as np
import pytest
from robots import preset
from skin_depths import contact_loads

HOME = preset('nine_member').home
BOX = Polygon([(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)])


def settled_in_corner(shape, depth):
    """Return the settled grasp of an object pressed into a corner."""
    members = members_at(HOME.robot, 'north/Z')
    grip = place_between(HOME, members, shape, angle=0.3, indentation=depth)
    return settle_grasp(HOME, grip.body, 2.0)


def assert_joints_agree(grip, bent, tolerance):
    count = len(HOME.robot.topology.joint_names)
    moved, expected = held_joints(grip) - HOME.nodes[:count], bent.state.displacements[:count, :2]
    assert moved == pytest.approx(expected, abs=tolerance * np.abs(expected).max())


@pytest.mark.parametrize(('shape', 'depth'), [(Disc(0.3), 0.02), (Disc(0.3), 0.035), (BOX, 0.02)])
def test_structure_of_a_held_object_agrees_with_deform(shape, depth):
    settled = settled_in_corner(shape, depth)
    bent = deform(HOME, {}, tube_loads=contact_loads(settled.equilibrium))
    assert_joints_agree(settled.equilibrium, bent, 1e-6)
    assert settled.utilisation == pytest.approx(bent.utilisation, rel=1e-5, abs=1e-9)
