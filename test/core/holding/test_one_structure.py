# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""`deform`, `analyze_grasp` and `settle_grasp` bend one structure."""

from dataclasses import replace

from isotruss_ros.core import deform, Disc, place_between, Polygon
from isotruss_ros.core.holding.attach_grip import attach_grip, least_friction_conditions
from isotruss_ros.core.holding.held_shape import held_joints
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.statics.bent_tubes import BentTubes
import numpy as np
import pytest
from robots import preset

ROBOT = preset('nine_member')
JOINTS = len(ROBOT.topology.joint_names)
BOX = Polygon([(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)])

on_grasps = pytest.mark.parametrize(
    ('shape', 'depth'), [(Disc(0.3), 0.02), (Disc(0.3), 0.035), (BOX, 0.02)]
)


def placed(shape, depth):
    """Return an object pressed into a corner."""
    members = members_at(ROBOT, 'north/Z')
    return place_between(ROBOT.home, members, shape, angle=0.3, indentation=depth).body


def deform_by(members, places, plane, couples):
    """Return the deformation under forces x + iy and couples at places of members."""
    loads = {}
    for member, *load in zip(members, places, plane.real, plane.imag, couples, strict=True):
        loads.setdefault(ROBOT.member_names[member], []).append(load)
    return deform(ROBOT.home, {}, tube_loads=loads)


@on_grasps
def test_structure_of_a_held_object_agrees_with_deform(shape, depth):
    grip = attach_grip(ROBOT.home, placed(shape, depth))
    loads = grip.state.loads
    plane = (loads[:, 0] + 1j * loads[:, 1]) * grip.statics.bent.lines.axis
    bent = deform_by(grip.contacts.members, grip.state.feet, plane, loads[:, 2])
    moved = held_joints(grip) - ROBOT.home.nodes[:JOINTS]
    expected = bent.state.displacements[:JOINTS, :2]
    assert moved == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())
    used = list(bent.utilisation.values())
    assert grip.sections.used == pytest.approx(used, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize(('shape', 'depth'), [(Disc(0.3), 0.018), (BOX, 0.022)])
def test_contact_forces_near_wrinkling_bend_a_finer_mesh_alike(shape, depth):
    grip = attach_grip(ROBOT.home, placed(shape, depth))
    assert 0.6 < grip.sections.used.max() < 1.0
    loads, count = grip.state.loads, len(grip.state.feet)
    shares = np.arange(1, 8) / 8
    member = np.append(grip.contacts.members, np.repeat(np.arange(9), len(shares)))
    place = np.append(grip.state.feet, np.outer(ROBOT.home.member_lengths, shares))
    push = np.zeros(len(place), dtype=complex)
    push[:count] = (loads[:, 0] + 1j * loads[:, 1]) * grip.statics.bent.lines.axis
    couple = np.pad(loads[:, 2], (0, len(place) - count))
    order = np.argsort(member, kind='stable')
    mesh = deform_by(member[order], place[order], push[order], couple[order])
    expected = mesh.state.displacements[:JOINTS, :2]
    moved = held_joints(grip) - ROBOT.home.nodes[:JOINTS]
    assert np.abs(moved - expected).max() < 1e-3 * np.abs(expected).max()


@pytest.mark.parametrize('depth', [0.003, 0.006])
@pytest.mark.parametrize('shape', [Disc(0.3), BOX])
def test_nonlinearity_is_the_increase_over_the_forces_of_linear_tubes(shape, depth):
    grip = attach_grip(ROBOT.home, placed(shape, depth))
    bent, force = grip.statics.bent, grip.state.normal_forces.sum()
    tubes = BentTubes.of(bent.structure, bent.members, bent.places)
    statics = replace(grip.statics, bent=tubes)
    _, linear = statics.settle(
        grip.state.unknowns, grip.wrench, least_friction_conditions(statics), reach=np.inf
    )
    increase = force / linear.normal_forces.sum() - 1.0
    assert increase > 1e-3
    assert grip.nonlinearity == pytest.approx(increase, rel=0.05)


@on_grasps
def test_tubes_that_are_kept_undeformed_change_no_response(shape, depth):
    grip = attach_grip(ROBOT.home, placed(shape, depth))
    bent, whole = grip.statics.bent, grip.statics.bent.activated()
    assert bent.frame.layout.kept
    assert not whole.frame.layout.kept
    for name in ('matrix', 'rates', 'constant'):
        expected = getattr(whole.responses, name)
        assert getattr(bent.responses, name) == pytest.approx(
            expected, abs=1e-9 * np.abs(expected).max()
        )
    loads, feet = grip.state.loads, grip.state.feet
    moved = bent.displacements(loads, feet)
    assert moved == pytest.approx(whole.displacements(loads, feet), abs=1e-11)


def test_a_tube_is_kept_undeformed_until_its_hinges_are_loaded():
    bent = attach_grip(ROBOT.home, placed(Disc(0.3), 0.02)).statics.bent
    loads, places = bent.state.loads, bent.places
    assert bent.update(loads, places).frame.layout.kept
    pushed = loads + np.array([[0.0, 0.1, 0.0], [0.0, 0.0, 0.0]])
    assert not bent.update(pushed, places).frame.layout.kept
