# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The equilibrium of a free object: held or not, by which forces, and how far from slipping."""

from itertools import product

from grips import gripped
from held_grips import APART, BOX, CORNER, HOME
from isotruss_ros.core import (
    analyze_grasp,
    ConvexObject,
    deform,
    Disc,
    HoldStatus,
    place_between,
    Polygon,
    settle_grasp,
)
from isotruss_ros.core.holding.held_shape import held_joints
from isotruss_ros.core.kinematics.depths import member_depths
from nightly import some_now
import numpy as np
import pytest
from robots import with_round_tubes
from skin_depths import contact_loads

CONFIG, CYLINDER = gripped(35.0, squeeze=0.08)
FRICTION = 0.5


def test_a_narrow_wedge_holds_and_statics_gives_the_friction():
    settled = settle_grasp(CONFIG, CYLINDER, FRICTION)
    assert settled.held
    assert settled.reason == ''
    assert set(settled.normal_forces) == {'north/P-Z', 'north/Z-R'}
    assert min(settled.normal_forces.values()) > 10.0
    # Without a load both members press alike, and rub against each other.
    one, other = settled.normal_forces.values()
    assert one == pytest.approx(other, rel=1e-8)
    assert sum(settled.friction_forces.values()) == pytest.approx(0.0, abs=1e-8)
    # A little more than the tangent of half of the wedge: pressed apart, it is wider.
    assert 1.0 < settled.required_friction / np.tan(np.radians(17.5)) < 1.25
    assert settled.slip_margin > 1.0
    assert np.linalg.eigvalsh(0.5 * (settled.stiffness + settled.stiffness.T)).min() > 0.0
    assert settled.displacement[:2] == pytest.approx(
        np.subtract(settled.pose[:2], CYLINDER.pose[:2])
    )


@pytest.mark.parametrize(
    ('degrees', 'squeeze'),
    some_now(
        dict.fromkeys([(31.0, 2e-3), (60.0, 5e-4), *product([31.0, 40.0, 60.0], [5e-4, 2e-3])]), 2
    ),
)
def test_settled_grasp_without_friction_agrees_with_analyze_grasp(degrees, squeeze):
    config, cylinder = gripped(degrees, squeeze=squeeze)
    config = with_round_tubes(config)
    analysis = analyze_grasp(config, cylinder, FRICTION)
    settled = settle_grasp(config, cylinder, FRICTION, -analysis.normal_wrench)
    pressing = sum(analysis.contact_forces.values())
    assert settled.normal_forces == pytest.approx(analysis.contact_forces, abs=3e-3 * pressing)
    assert max(map(abs, settled.friction_forces.values())) < 3e-3 * pressing
    assert np.hypot(*settled.displacement[:2]) < 5e-4


def test_nonlinearity_is_the_increase_over_the_forces_of_linear_tubes():
    config, cylinder = gripped(60.0, squeeze=0.01)
    config = with_round_tubes(config)
    analysis = analyze_grasp(config, cylinder, FRICTION)
    settled = settle_grasp(config, cylinder, FRICTION, -analysis.normal_wrench)
    bent, linear = (
        sum(each.values()) for each in (settled.normal_forces, analysis.contact_forces)
    )
    assert settled.nonlinearity == pytest.approx(bent / linear - 1.0, rel=0.1)


@pytest.mark.parametrize('center', [(9.0, 9.0), (0.5, 0.2)])
def test_object_with_one_contact_is_not_held(center):
    settled = settle_grasp(HOME, ConvexObject.disc(center, 0.1), FRICTION, (0.0, -5.0, 0.0))
    assert settled.hold is HoldStatus.NO_CONTACT
    assert settled.pose == (*center, 0.0)
    assert settled.normal_forces == {}
    assert settled.required_friction == np.inf
    assert settled.slip_margin < -5.0


def test_refusal_of_a_deep_object_has_its_deepest_member_and_depth():
    body = ConvexObject.disc((0.75, -0.2), 0.6)
    depths = member_depths(HOME, body)
    deepest = f'{1e3 * depths.max():.3g} mm deep in {HOME.robot.member_names[depths.argmax()]}'
    assert deepest in settle_grasp(HOME, body).reason


def test_contacts_that_bend_beyond_the_ends_of_their_members_are_named():
    grip = place_between(HOME, APART, Disc(0.27), indentation=0.015)
    assert settle_grasp(HOME, grip.body, members=APART).hold is HoldStatus.OFF_MEMBER


def test_used_friction_is_the_share_of_the_cone():
    settled = settle_grasp(CONFIG, CYLINDER, FRICTION, external_wrench=(0.3, 0.0, 0.05))
    for name, used in settled.friction_used.items():
        cone = FRICTION * settled.normal_forces[name]
        assert used == pytest.approx(abs(settled.friction_forces[name]) / cone)
    assert max(settled.friction_used.values()) == pytest.approx(
        settled.required_friction / FRICTION
    )


def test_displacement_of_the_angle_is_below_half_a_turn():
    grip = place_between(HOME, APART, BOX, angle=0.0, indentation=0.01)
    (x, y, _), settled = grip.body.pose, settle_grasp(HOME, grip.body, 5.0, members=APART)
    turned = settled.displacement[2]
    assert 1e-6 < abs(turned) < 0.1
    # The box looks the same after half a turn: the angles are just at that.
    shape = Polygon([(-x, -y) for x, y in BOX.vertices], corner_radius=0.02)
    for angle in (np.pi - 0.5 * abs(turned), -np.pi + 0.5 * abs(turned)):
        again = settle_grasp(HOME, ConvexObject(shape, (x, y, angle)), 5.0, members=APART)
        expected = settled.pose.angle - (angle - np.copysign(np.pi, angle))
        assert again.displacement[2] == pytest.approx(expected, abs=1e-3)


#: One face of the second is in contact.
PLACED = [
    (CORNER, Disc(0.3), 0.0),
    (CORNER, Polygon([(-0.12, -0.1), (0.12, -0.1), (0.12, 0.1), (-0.12, 0.1)], 0.02), 2.094),
]


@pytest.mark.parametrize(('members', 'shape', 'angle'), PLACED)
def test_an_object_keeps_its_position_along_the_bisector_of_the_forces(members, shape, angle):
    body = place_between(HOME, members, shape, angle, 0.012).body
    body = body.moved_to(np.add(body.pose, (0.004, -0.003, 0.0)))
    settled = settle_grasp(HOME, body, 0.9, members=members)
    normals, owners = settled.equilibrium.state.normals, settled.equilibrium.contacts.owners
    moved = settled.equilibrium.body.middle - body.middle
    bisector = 1j * (normals[owners == 0].mean() - normals[owners == 1].mean())
    assert abs(moved) > 1e-3
    assert (moved * bisector.conjugate()).real == pytest.approx(0.0, abs=1e-9)


FLAT = Polygon([(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)])


@pytest.mark.parametrize(('shape', 'depth'), [(Disc(0.3), 0.02), (Disc(0.3), 0.035), (FLAT, 0.02)])
def test_structure_of_a_held_object_agrees_with_deform(shape, depth):
    grip = place_between(HOME, CORNER, shape, angle=0.3, indentation=depth)
    settled = settle_grasp(HOME, grip.body, 2.0)
    bent = deform(HOME, {}, tube_loads=contact_loads(settled.equilibrium))
    count = len(HOME.robot.topology.joint_names)
    moved = held_joints(settled.equilibrium) - HOME.nodes[:count]
    expected = bent.state.displacements[:count, :2]
    assert moved == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())
    assert settled.utilisation == pytest.approx(bent.utilisation, rel=1e-5, abs=1e-9)
