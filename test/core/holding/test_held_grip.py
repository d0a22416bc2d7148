# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Convex objects at two members or three: equilibrium, slip margin, and how they roll."""

from dataclasses import replace
import math

from grips import gripped
from held_grips import APART, BOX, held, HOME, LOOP, NINE, numbers
from isotruss_ros.core import (
    analyze_grasp,
    ConvexObject,
    Disc,
    Ellipse,
    Grip,
    HoldStatus,
    place_between,
    Polygon,
    settle_grasp,
    solve_twist,
    tangent_center,
)
from isotruss_ros.core.contact.dents import dent_table
from isotruss_ros.core.contact.flattening import flattening_of
from isotruss_ros.core.holding.attach_grip import attach_grip, least_friction_conditions
from isotruss_ros.core.holding.contact_search import depths_in_others
from isotruss_ros.core.holding.contact_statics import build_statics
from isotruss_ros.core.holding.held_grip import NotHeldError
from isotruss_ros.core.holding.roll_grip import roll_grip, rolling_conditions, with_pressures
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.statics.bent_tubes import BentTubes
from nightly import some_now
import numpy as np
import pytest
from robots import with_round_tubes
from scipy.optimize import brentq
from shapes import regular_polygon

CONFIG, CYLINDER = gripped(35.0, squeeze=0.08)
SHARP = Polygon([(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)])
CORNER = ('north/P-Z', 'north/Z-R')
NOTHING = np.zeros(0, dtype=np.intp)
TRIANGLE = Polygon(regular_polygon(3, 0.645, 0.5 * np.pi).vertices, corner_radius=0.12)


CASES = [
    (BOX, 0.2, APART, 2),
    (BOX, 0.0, APART, 3),
    (SHARP, 0.5236, CORNER, 3),
    (Ellipse((0.25, 0.2)), 0.4, APART, 2),
    (Disc(0.4), 0.4, APART, 2),
]


def turned_disc(angle):
    """Return the disc, turned."""
    return CYLINDER.moved_to((*CYLINDER.pose[:2], angle))


@pytest.mark.parametrize(('shape', 'angle', 'members', 'count'), CASES)
def test_jacobian_agrees_with_finite_differences(shape, angle, members, count):
    grip = held(shape, angle, members, external_wrench=np.array([0.3, -0.2, 0.1]))
    assert len(grip.anchors) == count
    statics, rng = grip.statics, np.random.default_rng(0)
    state = grip.state.unknowns + 1e-3 * rng.normal(size=len(grip.state.unknowns))
    x, y, turn = grip.pose
    for closure in (
        least_friction_conditions(
            replace(statics, body=grip.body.moved_to((x + 0.001, y, turn + 0.01)))
        ),
        rolling_conditions(statics, grip.anchors, grip.angles, NOTHING),
        rolling_conditions(statics, grip.anchors, grip.angles, np.array([1])),
    ):
        jacobian = statics.equations(state, grip.wrench, closure)[1].jacobian
        for i, step in enumerate(1e-6 * np.eye(len(state))):
            ahead, behind = (
                statics.equations(state + sign * step, grip.wrench, closure)[0] for sign in (1, -1)
            )
            assert jacobian[:, i] == pytest.approx((ahead - behind) / 2e-6, rel=1e-6, abs=1e-7)


def touched_points(grip):
    """Return where the forces act: the tubes' skins, dented, off the bent centre lines."""
    state, statics = grip.state, grip.statics
    push = (state.normal_forces + 1j * state.friction_forces) * state.normals
    bent = statics.bent
    local = push * bent.lines.axis.conj()
    skin = statics.tube_radius - statics.dents(state.normal_forces, grip.angles)[0]
    loads = np.column_stack([local.real, local.imag, -skin * state.friction_forces])
    assert state.loads == pytest.approx(loads, abs=1e-9)
    give = bent.respond(loads, state.feet)
    line = bent.lines.start + bent.lines.axis * (state.feet + give[:, 0] + 1j * give[:, 1])
    inclined = bent.lines.axis * np.exp(1j * give[:, 2])
    assert (inclined.conj() * state.normals).real == pytest.approx(0.0, abs=1e-9)
    return line - skin * state.normals


def assert_balanced(grip, wrench):
    """Check that the tubes touch the object, and that forces there balance a wrench on it."""
    state, points = grip.state, touched_points(grip)
    push = (state.normal_forces + 1j * state.friction_forces) * state.normals
    gaps = grip.body.nearest(points).gaps
    assert gaps == pytest.approx(np.zeros(len(gaps)), abs=2e-5)
    arms = points - grip.body.center
    total = push.sum()
    assert (total.real, total.imag) == pytest.approx(wrench[:2], abs=1e-8)
    assert (arms.conj() * push).imag.sum() == pytest.approx(wrench[2], abs=1e-7)


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
                command = solve_twist(configs[-1], Grip(CORNER, grip.body), [0, 0, turn])
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


@pytest.mark.parametrize(('farthest', 'steps', 'turned'), [(0.4, 10, 0.35), (0.16, 1, 0.15)])
def test_a_polygon_of_many_sides_rolls_as_a_disc(farthest, steps, turned):
    polygon = ConvexObject(regular_polygon(24, 0.15), (*CYLINDER.pose[:2], 0.1))
    disc, grip = attach_grip(CONFIG, turned_disc(0.1)), attach_grip(CONFIG, polygon)
    assert grip.squeeze == pytest.approx(disc.squeeze, rel=2e-3)
    held_there = Grip(CORNER, CYLINDER)
    turning = solve_twist(CONFIG, held_there, (0.0, 0.0, 1.0), limits=()).roller_velocities
    for share in np.linspace(0.0, farthest, steps + 1)[1:]:
        config = CONFIG.moved_to(CONFIG.roller_positions + share * turning)
        disc, grip = roll_grip(disc, config), roll_grip(grip, config)
    assert disc.pose.angle - 0.1 > turned
    assert np.array(grip.pose) == pytest.approx(np.array(disc.pose), abs=2e-5)
    assert grip.squeeze == pytest.approx(disc.squeeze, rel=2e-3)
    assert_balanced(grip, np.zeros(3))


def test_both_ends_of_a_face_use_equal_shares_of_friction():
    grip = held(BOX, 0.0)
    owners, state = grip.contacts.owners, grip.state
    assert np.bincount(owners).tolist() == [1, 2]
    face = owners == 1
    ratios = state.friction_forces[face] / state.normal_forces[face]
    assert ratios[0] == pytest.approx(ratios[1], rel=1e-6)
    # As little friction as the balance needs: both members rub alike.
    assert np.abs(grip.friction_forces / grip.normal_forces) == pytest.approx(
        [grip.required_friction] * 2, rel=1e-6
    )


@pytest.mark.parametrize(('shape', 'angle', 'members', 'count'), CASES)
def test_rolling_is_reversible(shape, angle, members, count):
    begun = held(shape, angle, members)
    grip = begun
    way = np.array([0.01, -0.02, 0.01, 0.015, -0.01, 0.02])
    shares = [0.25, 0.5, 0.75, 1.0, 0.75, 0.5, 0.25, 0.0]
    farthest = 0.0
    for share in shares:
        config = HOME.moved_to(HOME.roller_positions + 0.2 * share * way)
        grip = roll_grip(grip, config)
        assert grip is not None
        farthest = max(farthest, float(np.abs(np.subtract(grip.pose, begun.pose)).max()))
        if len(grip.anchors) != count:
            return  # a face has lifted, or come to lie on a member: friction remembers that
    assert farthest > 1e-3
    # Motions of less than 0.1 mm are followed without bending the tubes anew.
    assert grip.pose == pytest.approx(begun.pose, abs=1e-7)


@pytest.mark.parametrize(('shape', 'angle', 'members', 'count'), CASES)
def test_response_agrees_with_small_wrenches(shape, angle, members, count):
    grip = held(shape, angle, members)
    response = grip.response
    assert response.stable
    for i, step in enumerate(1e-3 * np.eye(3)):
        wrench = step * (1.0, 1.0, grip.body.arm)
        ahead, behind = (roll_grip(grip, HOME, sign * wrench) for sign in (1.0, -1.0))
        moved = ahead.state.unknowns - behind.state.unknowns
        places = grip.statics.places
        assert moved[:3] / 2e-3 == pytest.approx(response.pose[:, i], rel=2e-4, abs=1e-8)
        assert moved[places.normal] / 2e-3 == pytest.approx(
            response.change[places.normal, i], rel=2e-4, abs=1e-5
        )


def changed_forces(grip, moving):
    """Return how normal forces change as members move along directions (k,), contacts sticking."""
    found = []
    for step in (1e-6, -1e-6):
        bent = grip.statics.bent.update(grip.state.loads, grip.state.feet)
        # The tubes give as before, from where they start now.
        lines = bent.lines._replace(start=bent.lines.start + step * moving)
        bent = replace(bent, lines=lines)
        statics = replace(grip.statics, bent=bent)
        closure = rolling_conditions(statics, grip.anchors, grip.angles, NOTHING)
        _, state = statics.settle(grip.state.unknowns, grip.wrench, closure)
        found.append(state.normal_forces)
    return (found[0] - found[1]) / 2e-6


@pytest.mark.parametrize(
    ('shape', 'angle', 'members'), [*(case[:3] for case in CASES), (Disc(0.5), 0.0, LOOP)]
)
def test_squeeze_stiffness_agrees_with_opening_members(shape, angle, members):
    grip = held(shape, angle, members)
    owners, normals = grip.contacts.owners, grip.state.normals
    if len(members) > 2:
        moving = 0.5 * normals
    else:
        points = touched_points(grip)
        apart = points[owners == 1].mean() - points[owners == 0].mean()
        apart /= abs(apart)
        moving = np.where(owners == 1, 0.5, -0.5) * apart
    gained = changed_forces(grip, moving).sum() / len(members)
    assert grip.squeeze_stiffness() == pytest.approx(gained, rel=0.01)
    assert gained < 0.0


@pytest.mark.parametrize(
    ('shape', 'angle', 'friction', 'directions'),
    some_now(
        [
            (BOX, 1.0, 0.8, 8),
            (BOX, 0.0, 5.0, 8),
            (BOX, 1.0, 0.8, 24),
            (BOX, 0.0, 5.0, 24),
            (BOX, 0.0, 0.8, 24),
            (Disc(0.4), 0.4, 5.0, 24),
        ],
        2,
    ),
    ids=[
        'slips',
        'an end of a face opens first',
        'slips, 24 directions',
        'an end of a face opens first, 24 directions',
        'on a face',
        'lets go',
    ],
)
def test_member_slips_or_opens_at_the_slip_margin(shape, angle, friction, directions):
    grip = held(shape, angle)
    assert grip.hold(friction) is HoldStatus.HELD
    margin = grip.slip_margin(friction)
    assert margin > 0.0
    sticking = []
    for angle in np.linspace(0.0, 2.0 * np.pi, directions, endpoint=False):
        for across in (-0.7, 0.0, 0.7):
            along = np.sqrt(1.0 - across**2) * np.array([np.cos(angle), np.sin(angle)])
            unit = np.append(along, across * grip.body.arm)
            loaded = roll_grip(grip, HOME, 0.9 * margin * unit)
            assert loaded is not None
            assert loaded.hold(friction) is HoldStatus.HELD
            more = roll_grip(grip, HOME, 1.3 * margin * unit)
            sticking.append(more is not None and more.hold(friction) is HoldStatus.HELD)
    # Beyond it holds in some directions only.
    assert not all(sticking)
    assert any(sticking)


@pytest.mark.parametrize('shape', [Disc(0.4), Ellipse((0.25, 0.2))])
@pytest.mark.parametrize('share', [0.7, 1.3])
def test_with_pressures_agrees_with_attaching_at_these_pressures(shape, share):
    filed = held(shape, 0.0)
    assert with_pressures(filed, None) is filed
    pressures = tuple(share * each for each in NINE.description.pressures.values())
    changed = roll_grip(with_pressures(filed, pressures), HOME)
    anew = attach_grip(HOME, changed.body, filed.members, pressure=pressures)
    # With the dents that there were it would be off by 2 to 4 %.
    assert changed.squeeze == pytest.approx(anew.squeeze, rel=1e-3)
    assert abs(changed.squeeze / filed.squeeze - 1.0) > 0.03


def test_three_members_hold_a_disc_by_equal_friction():
    shape = Disc(0.65)
    grip = place_between(HOME, LOOP, shape, indentation=0.01)
    settled = settle_grasp(HOME, grip.body, 0.5, (0.0, 0.0, 1.0), members=LOOP)
    assert settled.hold is HoldStatus.HELD
    assert set(settled.normal_forces) == set(LOOP)
    rubs = np.array(list(settled.friction_forces.values()))
    assert rubs == pytest.approx([rubs.mean()] * 3, rel=1e-6)
    assert rubs.sum() * 0.325 == pytest.approx(-1.0, rel=1e-9)
    assert settled.slip_margin > 1.0
    # Found without their names too, where it presses into three.
    ellipse = place_between(HOME, LOOP, Ellipse((0.33, 0.32)), indentation=0.012)
    assert set(settle_grasp(HOME, ellipse.body, 0.5).normal_forces) == set(LOOP)


def gap_of_third(diameter):
    """Return a disc between two sides of a loop, and how far the third side is from it [m]."""
    body = place_between(HOME, LOOP[:2], Disc(diameter), indentation=0.012).body
    return body, -float(member_depths(HOME, body)[numbers(LOOP[2:])[0]])


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
    # Rolling linearises tubes within `FOLLOWED_MOTION`, so forces err by about 1e-4 N.
    for there, back in zip(states[:2], states[:2:-1], strict=True):
        assert back == pytest.approx(there, rel=1e-6, abs=1e-7)


def test_depth_in_another_member_is_the_depth_in_its_bent_line():
    body = gap_of_third(brentq(lambda size: gap_of_third(size)[1] - 2e-3, 0.4, 0.8))[0]
    grip = attach_grip(HOME, body, numbers(LOOP[:2]), np.array([3.0, 2.0, 0.0]))
    (member,), (depth,) = depths_in_others(grip)
    assert member == numbers(LOOP)[2]
    positions = np.linspace(0.0, HOME.member_lengths[member], 4001)
    lines, _ = grip.bent_lines(np.full(4001, member), positions)
    gaps = grip.body.moved_to(grip.pose).nearest(lines).gaps
    assert depth == pytest.approx(grip.statics.tube_radius - gaps.min(), abs=1e-5)


@pytest.mark.parametrize('beyond', [2e-4, -2e-4])
def test_contact_beside_a_guide_ring_rolls_in_one_step_as_in_many(beyond):
    ring = HOME.robot.description.module.guide_ring_distance

    def placed(diameter):
        center = tangent_center(HOME, 'north/Z', diameter, 0.01)
        return attach_grip(HOME, ConvexObject.disc(center, diameter))

    def beyond_ring(diameter):
        grip = placed(diameter)
        return min(*grip.state.feet, *(grip.statics.bent.lines.length - grip.state.feet)) - ring

    one = many = placed(brentq(lambda size: beyond_ring(size) - beyond, 0.1, 0.2, xtol=1e-6))
    travel = 3e-4 * np.array([0.3, -0.5, -0.9, -1.0, 0.6, 0.8])
    for share in np.linspace(0.1, 1.0, 10):
        many = roll_grip(many, HOME.moved_to(HOME.roller_positions + share * travel))
    one = roll_grip(one, HOME.moved_to(HOME.roller_positions + travel))
    assert one.friction_forces == pytest.approx(many.friction_forces, rel=2e-5)


@pytest.mark.parametrize('shape', [Disc(0.65), Ellipse((0.33, 0.32)), TRIANGLE])
def test_frictionless_forces_agree_with_analyze_grasp(shape):
    home, body = with_round_tubes(HOME), place_between(HOME, LOOP, shape, indentation=0.014).body
    statics = build_statics(home, body, attach_grip(home, body, numbers(LOOP)).contacts)
    unknowns = statics.start()
    for _ in range(3):  # tubes that are not linearised again are linear
        _, state = statics.settle(
            unknowns, np.zeros(3), least_friction_conditions(statics), reach=np.inf
        )
        unknowns, bent = state.unknowns, statics.bent
        straight = BentTubes.of(bent.structure, bent.members, state.feet)
        statics = replace(statics, bent=straight)
    assert np.abs(state.friction_forces).max() < 1e-6
    analysis = analyze_grasp(HOME, body.moved_to(state.unknowns[:3]), 0.5)
    forces = statics.contacts.sum_by_member(state.normal_forces)
    assert forces == pytest.approx([analysis.contact_forces[name] for name in LOOP], rel=0.004)


def test_face_between_three_members_determines_the_angle_without_friction():
    grip = place_between(HOME, LOOP, TRIANGLE, indentation=0.012)
    settled = settle_grasp(HOME, grip.body, 0.5)
    assert settled.hold is HoldStatus.HELD
    assert max(map(abs, settled.friction_forces.values())) < 1e-6
    turned = grip.body.moved_to(np.add(grip.body.pose, (0.0, 0.0, 0.005)))
    # Tables of dents are made for angles in steps.
    again = settle_grasp(HOME, turned, 0.5).pose
    assert np.array(again) == pytest.approx(np.array(settled.pose), abs=0.2 * 0.005)


def test_a_face_dents_less_than_a_corner_and_a_disc_like_a_circular_ellipse():
    right = 2
    pressure = next(iter(NINE.description.pressures.values()))
    kernel = flattening_of(NINE, pressure)
    table = dent_table(kernel, SHARP, right)
    assert table(15.0, 0.5 * np.pi)[0] < 0.2 * table(15.0, 0.25 * np.pi)[0]
    # Pressure times area: half of a face of 0.3 m on a foundation of 4 pi p / 3.
    foundation = 0.15 * 4.0 * np.pi * pressure / 3.0
    assert table(5.0, 0.5 * np.pi)[0] == pytest.approx(5.0 / foundation, rel=0.25)
    grip = attach_grip(CONFIG, CYLINDER)
    table = dent_table(kernel, Ellipse((0.15, 0.15)))
    depths, *_ = grip.statics.dents(np.array([10.0, 30.0]), grip.angles)
    assert [table(10.0, 0.0)[0], table(30.0, 0.0)[0]] == pytest.approx(depths, rel=0.02)


@pytest.mark.parametrize('grip', [attach_grip(CONFIG, CYLINDER), held(BOX, 0.2)])
def test_under_a_huge_load_there_is_no_equilibrium(grip):
    load = 1e6 * np.array([0.3, -0.8, 0.0])
    assert roll_grip(grip, grip.config, load) is None
    with pytest.raises(NotHeldError, match='balances the forces') as refused:
        attach_grip(grip.config, grip.body, grip.members, load)
    assert refused.value.hold is HoldStatus.NO_BALANCE
