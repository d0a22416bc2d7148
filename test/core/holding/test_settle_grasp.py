# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The equilibrium of a free object, its forces, and the range of friction that holds it."""

from dataclasses import replace
from itertools import product
import math

from grips import gripped
from held_grips import APART, BOX, CORNER, HOME, LOOP
from isotruss_ros import core
from isotruss_ros.core import ConvexObject, place_between, Polygon, settle_grasp
from isotruss_ros.core.holding.held_shape import held_joints
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.kinematics.depths import member_depths, push_out
from nightly import some_now
import numpy as np
import pytest
from robots import with_round_tubes
from skin_depths import contact_loads

CONFIG, CYLINDER = gripped(35.0, squeeze=0.08)
FRICTION = 0.5


@pytest.mark.parametrize(
    ('degrees', 'squeeze'),
    some_now(
        dict.fromkeys([(31.0, 2e-3), (60.0, 5e-4), *product([31.0, 40.0, 60.0], [5e-4, 2e-3])]), 2
    ),
)
def test_settled_grasp_without_friction_agrees_with_analyze_grasp(degrees, squeeze):
    config, cylinder = gripped(degrees, squeeze=squeeze)
    config = with_round_tubes(config)
    analysis = core.analyze_grasp(config, cylinder, FRICTION)
    settled = core.settle_grasp(config, cylinder, FRICTION, -analysis.normal_wrench)
    pressing = sum(analysis.contact_forces.values())
    assert settled.normal_forces == pytest.approx(analysis.contact_forces, abs=3e-3 * pressing)
    assert max(map(abs, settled.friction_forces.values())) < 3e-3 * pressing
    assert np.hypot(*settled.displacement[:2]) < 5e-4


def test_nonlinearity_is_the_increase_over_the_forces_of_linear_tubes():
    config, cylinder = gripped(60.0, squeeze=0.01)
    config = with_round_tubes(config)
    analysis = core.analyze_grasp(config, cylinder, FRICTION)
    settled = core.settle_grasp(config, cylinder, FRICTION, -analysis.normal_wrench)
    bent, linear = (sum(f.values()) for f in (settled.normal_forces, analysis.contact_forces))
    assert settled.nonlinearity == pytest.approx(bent / linear - 1.0, rel=0.1)


@pytest.mark.parametrize('center', [(9.0, 9.0), (0.5, 0.2)])
def test_object_with_one_contact_is_not_held(center):
    body = core.ConvexObject.disc(center, 0.1)
    settled = core.settle_grasp(HOME, body, FRICTION, (0.0, -5.0, 0.0))
    assert settled.hold is core.HoldStatus.NO_CONTACT
    assert settled.pose == (*center, 0.0)
    assert settled.normal_forces == {}
    assert settled.required_friction == np.inf
    assert settled.slip_margin < -5.0


def test_refusal_of_a_deep_object_has_its_deepest_member_and_depth():
    body = core.ConvexObject.disc((0.75, -0.2), 0.6)
    depths = member_depths(HOME, body)
    deepest = f'{1e3 * depths.max():.3g} mm deep in {HOME.robot.member_names[depths.argmax()]}'
    assert deepest in core.settle_grasp(HOME, body).reason


def test_refusal_of_an_object_that_touches_by_rounding_has_no_depth():
    apart = push_out(HOME, core.ConvexObject.disc((0.72, 0.2), 0.3))
    touching = apart.moved_to((apart.pose.x, apart.pose.y - 1e-13, 0.0))
    assert 0.0 < member_depths(HOME, touching).max() < 1e-12
    assert 'deep' not in core.settle_grasp(HOME, touching).reason


def test_contacts_that_bend_beyond_the_ends_of_their_members_are_named():
    grip = core.place_between(HOME, APART, core.Disc(0.27), indentation=0.015)
    assert core.settle_grasp(HOME, grip.body, members=APART).hold is core.HoldStatus.OFF_MEMBER


def test_used_friction_is_the_share_of_the_cone():
    settled = core.settle_grasp(CONFIG, CYLINDER, FRICTION, external_wrench=(0.3, 0.0, 0.05))
    for name, used in settled.friction_used.items():
        cone = FRICTION * settled.normal_forces[name]
        assert used == pytest.approx(abs(settled.friction_forces[name]) / cone)
    expected = settled.required_friction / FRICTION
    assert max(settled.friction_used.values()) == pytest.approx(expected)


def test_displacement_of_the_angle_is_below_half_a_turn():
    grip = core.place_between(HOME, APART, BOX, angle=0.0, indentation=0.01)
    (x, y, _), settled = grip.body.pose, core.settle_grasp(HOME, grip.body, 5.0, members=APART)
    turned = settled.displacement[2]
    assert 1e-6 < abs(turned) < 0.1
    # The box looks the same after half a turn: the angles are just at that.
    shape = core.Polygon([(-x, -y) for x, y in BOX.vertices], corner_radius=0.02)
    for angle in (np.pi - 0.5 * abs(turned), -np.pi + 0.5 * abs(turned)):
        body = core.ConvexObject(shape, (x, y, angle))
        again = core.settle_grasp(HOME, body, 5.0, members=APART)
        expected = settled.pose.angle - (angle - np.copysign(np.pi, angle))
        assert again.displacement[2] == pytest.approx(expected, abs=1e-3)


#: One face of the second is in contact.
PLACED = [
    (CORNER, core.Disc(0.3), 0.0),
    (CORNER, core.Polygon([(-0.12, -0.1), (0.12, -0.1), (0.12, 0.1), (-0.12, 0.1)], 0.02), 2.094),
]


@pytest.mark.parametrize(('members', 'shape', 'angle'), PLACED)
def test_an_object_keeps_its_position_along_the_bisector_of_the_forces(members, shape, angle):
    body = core.place_between(HOME, members, shape, angle, 0.012).body
    body = body.moved_to(np.add(body.pose, (0.004, -0.003, 0.0)))
    settled = core.settle_grasp(HOME, body, 0.9, members=members)
    normals, owners = settled.equilibrium.state.normals, settled.equilibrium.contacts.owners
    moved = settled.equilibrium.body.middle - body.middle
    bisector = 1j * (normals[owners == 0].mean() - normals[owners == 1].mean())
    assert abs(moved) > 1e-3
    assert (moved * bisector.conjugate()).real == pytest.approx(0.0, abs=1e-9)


FLAT = core.Polygon([(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)])


@pytest.mark.parametrize(
    ('shape', 'depth'), [(core.Disc(0.3), 0.02), (core.Disc(0.3), 0.035), (FLAT, 0.02)]
)
def test_structure_of_a_held_object_agrees_with_deform(shape, depth):
    grip = core.place_between(HOME, CORNER, shape, angle=0.3, indentation=depth)
    settled = core.settle_grasp(HOME, grip.body, 2.0)
    bent = core.deform(HOME, {}, tube_loads=contact_loads(settled.equilibrium))
    count = len(HOME.robot.topology.joint_names)
    moved = held_joints(settled.equilibrium) - HOME.nodes[:count]
    expected = bent.state.displacements[:count, :2]
    assert moved == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())
    assert settled.utilisation == pytest.approx(bent.utilisation, rel=1e-5, abs=1e-9)


HIGH_FRICTION = 0.9
HEXAGON, SMALL_HEXAGON = (
    Polygon([(r * math.cos(a), r * math.sin(a)) for a in math.pi / 3.0 * np.arange(6)])
    for r in (0.34, 0.175)
)


def settled_between(members, shape, degrees, friction=HIGH_FRICTION, home=HOME, **options):
    """Return an object that members press by 10 mm."""
    grip = place_between(home, members, shape, math.radians(degrees), 0.01)
    return settle_grasp(home, grip.body, friction, members=members, **options)


def test_range_of_an_object_on_two_points_is_the_required_friction():
    disc, corners = gripped(40.0, squeeze=0.04), settled_between(CORNER, SMALL_HEXAGON, 30.0)
    assert len(corners.equilibrium.state.normals) == 2
    for settled in (settle_grasp(*disc, HIGH_FRICTION), corners):
        required = settled.required_friction
        assert settled.friction_range == pytest.approx((required, required), abs=2e-5)


@pytest.mark.parametrize(('share', 'verdict'), [(0.99, 'lost'), (1.01, 'unknown'), (1.3, 'held')])
def test_verdict_depends_on_the_place_of_friction_in_the_range(share, verdict):
    settled = settled_between(APART, BOX, 0.0)
    assert settled.friction_range.verdict(share * settled.required_friction) == verdict


@pytest.mark.parametrize(('members', 'degrees'), [(APART, 0.0), (CORNER, 60.0)])
def test_force_of_a_box_on_a_face_turns_by_twice_its_way_to_rest_after_a_fall(members, degrees):
    settled = settled_between(members, BOX, degrees)
    # The force between the members is at the edge of one cone. It turns toward the other cone,
    # to rest at the edge of the smaller cone, and then as far again.
    opening = 2.0 * math.atan(settled.required_friction)
    expected = math.tan((opening + math.atan(HIGH_FRICTION)) / 3.0)
    assert settled.friction_range.necessary == pytest.approx(settled.required_friction, abs=2e-5)
    assert settled.friction_range.sufficient == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(
    ('members', 'shape', 'degrees'), [(CORNER, BOX, 60.0), (LOOP, HEXAGON, 10.0)]
)
def test_equilibria_of_other_histories_use_the_necessary_friction_or_more(members, shape, degrees):
    settled = settled_between(members, shape, degrees)
    grip, rng = settled.equilibrium, np.random.default_rng(0)
    used = []
    for slips in rng.uniform(-1e-4, 1e-4, (20, len(grip.anchors))):
        other = roll_grip(replace(grip, anchors=grip.anchors + slips), grip.config)
        used.append(np.abs(other.state.friction_forces / other.state.normal_forces).max())
    assert min(used) > 0.995 * settled.friction_range.necessary
    assert max(used) > 1.005 * settled.friction_range.necessary


def test_range_of_three_members_grows_with_the_friction_of_the_histories():
    histories = [settled_between(LOOP, HEXAGON, 10.0, friction) for friction in (0.5, 0.9)]
    small, large = (settled.friction_range for settled in histories)
    assert small.necessary == pytest.approx(large.necessary, abs=2e-5)
    assert small.necessary < small.sufficient < large.sufficient


def test_range_without_an_equilibrium_is_infinite():
    settled = settle_grasp(HOME, ConvexObject.disc((9.0, 9.0), 0.3), HIGH_FRICTION)
    assert settled.friction_range == (math.inf, math.inf)
    assert settled.friction_range.verdict(HIGH_FRICTION) == 'lost'


def test_history_of_contacts_that_have_rolled_is_known():
    settled = settled_between(LOOP, HEXAGON, 10.0)
    rolled = roll_grip(settled.equilibrium, HOME)
    known = replace(settled, equilibrium=rolled)
    assert known.friction_range.sufficient < settled.friction_range.sufficient
