# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Equilibrium of a free object: forces, slip margin, range of friction, and how it rolls."""

from dataclasses import replace
from itertools import product
import math

from grips import gripped
from held_grips import APART, AROUND, BOX, CORNER, held, HOME, LOOP, NINE, numbers
from isotruss_ros import core
from isotruss_ros.core import ConvexObject, place_between, Polygon, settle_grasp
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.held_shape import held_joints
from isotruss_ros.core.holding.roll_grip import roll_grip, with_tubes
from isotruss_ros.core.kinematics.depths import member_depths, push_out
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from nightly import some_now
import numpy as np
import pytest
from robots import with_round_tubes
from scipy.optimize import brentq
from skin_depths import bent_line, contact_loads

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
        other = roll_grip(grip.with_anchors(grip.anchors + slips), grip.config)
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


SHARP = core.Polygon([(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)])
CASES = [
    (BOX, 0.2, APART, 2),
    (BOX, 0.0, APART, 3),
    (SHARP, 0.5236, CORNER, 3),
    (core.Ellipse((0.25, 0.2)), 0.4, APART, 2),
    (core.Disc(0.4), 0.4, APART, 2),
    (core.Disc(0.65), 0.0, LOOP, 3),
]


def touched_points(grip):
    """Return where the forces act: the dented skins of the tubes, bent as by `deform`."""
    state, g, points = grip.state, grip.alone.g, []
    for number, foot in zip(grip.contacts.members.tolist(), state.feet.tolist(), strict=True):
        name = grip.config.robot.member_names[number]
        points.append(bent_line(grip, name, [foot])[0])
    skin = g.structure.tube_radius - g.dents(state.normal_forces[None], grip.angles[None])[0][0]
    return np.array(points) - skin * state.normals


def assert_balanced(grip, wrench):
    """Check that the tubes touch the object, and that forces there balance a wrench on it."""
    state, points = grip.state, touched_points(grip)
    push = (state.normal_forces + 1j * state.friction_forces) * state.normals
    gaps = grip.body.nearest(points).gaps
    assert gaps == pytest.approx(np.zeros(len(gaps)), abs=2e-5)
    arms = points - grip.body.center
    total = push.sum()
    assert (total.real, total.imag) == pytest.approx(wrench[:2], abs=1e-8)
    assert (arms.conj() * push).imag.sum() == pytest.approx(wrench[2], abs=1e-5)


@pytest.mark.parametrize(('shape', 'angle', 'members', 'count'), CASES)
def test_forces_on_the_object_balance_the_wrench(shape, angle, members, count):
    wrench = np.array([0.5, -0.3, 0.05])
    grip = held(shape, angle, members, external_wrench=wrench)
    assert len(grip.anchors) == count
    assert_balanced(grip, wrench)


def test_face_ends_close_and_open_as_the_object_rolls():
    grip, configs = held(SHARP, 0.65, CORNER), [HOME]
    ahead = [(3, 1), (3, 1, 2), (3, 2)]
    for turn, corners in ((-0.01, ahead), (0.01, ahead[::-1])):
        seen = [tuple(grip.contacts.corners.tolist())]
        for number in range(14):
            if turn < 0.0:
                command = core.solve_twist(configs[-1], core.Grip(CORNER, grip.body), [0, 0, turn])
                travel = configs[-1].roller_positions + command.roller_velocities
                configs.append(configs[-1].moved_to(travel))
            before = grip
            grip = roll_grip(grip, configs[number + 1 if turn < 0.0 else -number - 2])
            assert_balanced(grip, np.zeros(3))
            assert math.dist(grip.pose[:2], before.pose[:2]) < 2e-3
            assert 0.0 < (grip.pose.angle - before.pose.angle) / turn < 2.0
            touched = tuple(grip.contacts.corners.tolist())
            if len(touched) > len(before.anchors):
                # What has only come to touch does not rub yet.
                fresh = [corner not in before.contacts.corners for corner in touched]
                assert grip.state.friction_forces[fresh] == pytest.approx(0.0, abs=1e-9)
            seen += [touched] if touched != seen[-1] else []
        assert seen == corners


# The rollers do not open a loop of one tube, and three tubes at home hardly.
OBLIQUE = HOME.moved_to([0.1, -0.1, 0.0, 0.1, -0.1, 0.05])
OPENED = [(HOME, *case[:3], 0.05) for case in CASES[:-1]]
OPENED += [(OBLIQUE, core.Disc(0.83), 0.0, AROUND, 0.2)]


@pytest.mark.parametrize(('config', 'shape', 'angle', 'members', 'error'), OPENED)
def test_squeeze_stiffness_is_the_change_by_opening(config, shape, angle, members, error):
    body = core.place_between(config, members, shape, angle, 0.01).body
    grip = attach_grip(config, body, numbers(members))
    opening = 1e-5 * np.linalg.pinv(grip_jacobian(config, grip.touching(1.0)))[:, 3]
    ahead, behind = (
        roll_grip(grip, config.moved_to(config.roller_positions + sign * opening)).squeeze
        for sign in (1.0, -1.0)
    )
    assert (ahead - behind) / 2e-5 == pytest.approx(grip.squeeze_stiffness(), rel=error)


@pytest.mark.parametrize(
    ('shape', 'angle', 'friction', 'directions'),
    some_now(
        [
            (BOX, 1.0, 0.8, 4),
            (BOX, 0.0, 5.0, 4),
            (BOX, 1.0, 0.8, 24),
            (BOX, 0.0, 5.0, 24),
            (BOX, 0.0, 0.8, 24),
            (core.Disc(0.4), 0.4, 5.0, 24),
        ],
        2,
    ),
)
def test_member_slips_or_opens_at_the_slip_margin(shape, angle, friction, directions):
    grip = held(shape, angle)
    assert grip.hold(friction) is core.HoldStatus.HELD
    margin = grip.slip_margin(friction)
    assert margin > 0.0
    sticking = []
    for angle in np.linspace(0.0, 2.0 * np.pi, directions, endpoint=False):
        for across in (-0.7, 0.0, 0.7):
            along = np.sqrt(1.0 - across**2) * np.array([np.cos(angle), np.sin(angle)])
            unit = np.append(along, across * grip.body.arm)
            loaded = roll_grip(grip, HOME, 0.9 * margin * unit)
            assert loaded is not None
            assert loaded.hold(friction) is core.HoldStatus.HELD
            more = roll_grip(grip, HOME, 1.3 * margin * unit)
            sticking.append(more is not None and more.hold(friction) is core.HoldStatus.HELD)
    # Beyond it holds in some directions only.
    assert not all(sticking)
    assert any(sticking)


@pytest.mark.parametrize('share', [0.7, 1.3])
def test_with_pressures_agrees_with_attaching_at_these_pressures(share):
    filed = held(core.Ellipse((0.25, 0.2)), 0.0)
    pressures = tuple(share * each for each in NINE.description.pressures.values())
    changed = roll_grip(with_tubes(filed, pressures), HOME)
    anew = attach_grip(HOME, changed.body, filed.members, pressure=pressures)
    # With the dents that there were it would be off by 2 to 4 %.
    assert changed.squeeze == pytest.approx(anew.squeeze, rel=1e-3)
    assert abs(changed.squeeze / filed.squeeze - 1.0) > 0.03


def test_three_members_hold_a_disc_by_equal_friction():
    shape = core.Disc(0.65)
    grip = core.place_between(HOME, LOOP, shape, indentation=0.01)
    settled = core.settle_grasp(HOME, grip.body, 0.5, (0.0, 0.0, 1.0), members=LOOP)
    assert settled.hold is core.HoldStatus.HELD
    assert set(settled.normal_forces) == set(LOOP)
    rubs = np.array(list(settled.friction_forces.values()))
    assert rubs == pytest.approx([rubs.mean()] * 3, rel=1e-6)
    assert rubs.sum() * 0.325 == pytest.approx(-1.0, rel=1e-9)
    assert settled.slip_margin > 1.0
    # Found without their names too, where it presses into three.
    ellipse = core.place_between(HOME, LOOP, core.Ellipse((0.33, 0.32)), indentation=0.012)
    assert set(core.settle_grasp(HOME, ellipse.body, 0.5).normal_forces) == set(LOOP)


def gap_of_third(diameter):
    """Return a disc between two sides of a loop, and how far the third side is from it [m]."""
    body = core.place_between(HOME, LOOP[:2], core.Disc(diameter), indentation=0.012).body
    return body, -float(member_depths(HOME, body)[numbers(LOOP[2:])[0]])


@pytest.mark.parametrize(
    ('diameter', 'hold'), [(0.638, core.HoldStatus.HELD), (0.639, core.HoldStatus.OTHER_CONTACT)]
)
def test_a_third_member_touches_where_its_bent_line_does(diameter, hold):
    body, gap = gap_of_third(diameter)
    assert gap > 0.003  # of the straight member
    settled = core.settle_grasp(HOME, body, 0.9, members=LOOP[:2])
    assert settled.hold is hold
    assert (LOOP[2] in settled.reason) == (hold is core.HoldStatus.OTHER_CONTACT)
    grip, places = settled.equilibrium, np.linspace(0.3, 0.9, 61)
    gaps = grip.body.nearest(bent_line(grip, LOOP[2], places.tolist())).gaps
    assert (gaps.min() < 0.5 * HOME.robot.description.tube_diameter) == (
        hold is core.HoldStatus.OTHER_CONTACT
    )


def test_third_member_comes_into_contact_by_bending():
    near, far = (
        gap_of_third(brentq(lambda size, gap=gap: gap_of_third(size)[1] - gap, 0.4, 0.8))[0]
        for gap in (1e-3, 0.02)
    )
    alone = attach_grip(HOME, far, numbers(LOOP[:2]))
    assert len(roll_grip(alone, HOME).members) == 2
    grip = attach_grip(HOME, near, numbers(LOOP[:2]))
    assert len(grip.members) == 2
    # What presses bends the whole loop toward the object: the third side touches it already.
    toward = -grip.state.normals.sum()
    pull = np.array([toward.real, toward.imag, 0.0]) / abs(toward)
    states = []
    for size in (0.0, 2.0, 4.0, 2.0, 0.0):
        grip = roll_grip(grip, HOME, size * pull)
        assert set(grip.member_names) == set(LOOP)
        assert grip.normal_forces.min() > 0.0
        states.append(grip.state.unknowns)
    # Rolling linearises tubes within the motion of `FOLLOWED`, so forces err by about 1e-4 N.
    for there, back in zip(states[:2], states[:2:-1], strict=True):
        assert back == pytest.approx(there, rel=1e-6, abs=1e-7)
    for travel in (2e-3, 4e-3, 6e-3):
        grip = roll_grip(grip, HOME.moved_to([travel, *5 * [0.0]]))
        assert grip.normal_forces.min() > 0.0
    assert grip.member_names == LOOP[:2]  # the third one has opened


@pytest.mark.parametrize('shear_rigidity', [300.0, 1e3, 1e4, 1e6])
def test_stiffness_without_a_load_is_symmetric_although_tubes_shear(shear_rigidity):
    section = {
        'model': 'section',
        'axial_rigidity': 4e3,
        'flexural_rigidity': 25.0,
        'shear_rigidity': shear_rigidity,
    }
    config = core.Robot(replace(HOME.robot.description, stiffness=section)).home
    body = core.ConvexObject.disc(core.tangent_center(config, 'north/Z', 0.28, 0.002), 0.28)
    stiffness = core.settle_grasp(config, body, 0.8).stiffness
    assert stiffness == pytest.approx(stiffness.T, rel=1e-4)
