# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The drawn lines of a held object agree with its equilibrium."""

from isotruss_ros.core import ConvexObject, deform, settle_grasp, tangent_center
from isotruss_ros.core.holding.held_shape import deformed_lines, force_lines, region_lines
from isotruss_ros.core.kinematics.depths import member_lines
import numpy as np
import pytest
from robots import preset
from skin_depths import contact_loads

ROBOT = preset('nine_member')
DIAMETER = 0.3


@pytest.fixture(params=[0.0, 0.1], ids=['home', 'elsewhere'])
def grip(request):
    """Return the equilibrium of a disc, at home and in another configuration."""
    travel = request.param * np.linspace(-1.0, 1.0, len(ROBOT.roller_names))
    config = ROBOT.configuration(travel)
    center = tangent_center(config, 'north/Z', DIAMETER, 0.01)
    return settle_grasp(config, ConvexObject.disc(center, DIAMETER), 2.0).equilibrium


def test_drawn_ends_of_members_agree_with_the_deformation_under_the_contact_forces(grip):
    deformed = deform(grip.config, {}, tube_loads=contact_loads(grip))
    lines, straight = deformed_lines(grip), member_lines(grip.config)
    for name, line, ends in zip(ROBOT.member_names, lines, straight, strict=True):
        tube, _, joints = name.partition('/')
        for joint, node, drawn, before in zip(
            joints.split('-'), 'BC', line[[0, -1]], ends, strict=True
        ):
            moved = deformed.displacement(f'{tube}/{joint}/{node}')[:2] @ (1.0, 1.0j)
            assert drawn - before == pytest.approx(moved, abs=1e-8)


def test_force_arrows_end_on_the_object_and_are_in_balance(grip):
    arrows = force_lines(grip, 0.02)
    center = complex(*grip.pose[:2])
    assert np.abs(arrows[:, 1] - center) == pytest.approx(0.5 * DIAMETER)
    forces = np.diff(arrows)[:, 0] / 0.02
    assert abs(forces.sum()) < 1e-8
    assert np.abs(forces) == pytest.approx(np.hypot(grip.normal_forces, grip.friction_forces))


def test_regions_are_on_the_object_and_as_long_as_the_contact(grip):
    regions = region_lines(grip)
    assert np.abs(regions - complex(*grip.pose[:2])) == pytest.approx(0.5 * DIAMETER)
    lengths = np.abs(np.diff(regions)).sum(axis=1)
    assert lengths == pytest.approx(grip.patches.lengths, rel=0.03)
