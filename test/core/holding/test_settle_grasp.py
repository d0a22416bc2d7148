# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The equilibrium of a free object: held or not, by which forces, and how far from slipping."""

from dataclasses import replace
from itertools import product

from grips import gripped
from isotruss_ros.core import (
    analyze_grasp,
    ConvexObject,
    Disc,
    HoldStatus,
    place_between,
    settle_grasp,
    tangent_center,
)
from isotruss_ros.core.holding import attach_grip as attach_grip_module
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.kinematics.depths import member_depths
from nightly import some_now
import numpy as np
import pytest
from robots import preset, with_round_tubes

HOME = preset('nine_member').home
CONFIG, CYLINDER = gripped(35.0, squeeze=0.08)
FRICTION = 0.5


def moved(cylinder, shift):
    """Return a cylinder somewhere else."""
    x, y, angle = cylinder.pose
    return cylinder.moved_to((x + shift.real, y + shift.imag, angle))


def test_a_narrow_wedge_holds_and_statics_gives_the_friction():
    settled = settle_grasp(CONFIG, CYLINDER, FRICTION)
    assert settled.pose == settle_grasp(CONFIG, CYLINDER, FRICTION, (0.0, 0.0, 0.0)).pose
    assert settled.hold is HoldStatus.HELD
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
    attached = attach_grip(CONFIG, CYLINDER)
    assert settled.slip_margin == pytest.approx(attached.slip_margin(FRICTION), rel=1e-9)
    assert settled.slip_margin > 1.0
    assert np.linalg.eigvalsh(0.5 * (settled.stiffness + settled.stiffness.T)).min() > 0.0
    assert settled.displacement[:2] == pytest.approx(
        np.subtract(settled.pose[:2], CYLINDER.pose[:2])
    )


@pytest.mark.parametrize(
    ('degrees', 'squeeze'),
    some_now(
        dict.fromkeys(
            [(31.0, 2e-3), (60.0, 5e-4), *product([31.0, 40.0, 60.0], [5e-4, 1e-3, 2e-3])]
        ),
        2,
    ),
)
def test_settled_grasp_without_friction_agrees_with_analyze_grasp(degrees, squeeze):
    config, cylinder = gripped(degrees, squeeze=squeeze)
    config = with_round_tubes(config)
    analysis = analyze_grasp(config, cylinder, FRICTION)
    state = attach_grip(config, cylinder, None, -analysis.normal_wrench).state
    expected = [analysis.contact_forces[name] for name in ('north/P-Z', 'north/Z-R')]
    pressing = sum(expected)
    assert state.normal_forces == pytest.approx(expected, abs=3e-3 * pressing)
    assert np.abs(state.friction_forces).max() < 3e-3 * pressing
    assert abs(complex(*state.unknowns[:2]) - cylinder.center) < 5e-4


@pytest.mark.parametrize('module', ['south/S', 'west/K'])
@pytest.mark.parametrize('depth', [0.004, 0.012, 0.02])
def test_rounding_in_a_soft_robot_does_not_hide_the_equilibrium(module, depth):
    home = preset('ring_of_four').home
    cylinder = ConvexObject.disc(tangent_center(home, module, 0.3, depth), 0.3)
    round_tubes = settle_grasp(with_round_tubes(home), cylinder).normal_forces
    flattened = settle_grasp(home, cylinder).normal_forces
    assert flattened
    assert all(round_tubes[name] > force for name, force in flattened.items())


@pytest.mark.parametrize('center', [(9.0, 9.0), (0.5, 0.2)])
def test_object_with_one_contact_is_not_held(center):
    settled = settle_grasp(HOME, ConvexObject.disc(center, 0.1), FRICTION, (0.0, -5.0, 0.0))
    assert settled.hold is HoldStatus.NO_CONTACT
    assert settled.pose == (*center, 0.0)
    assert settled.normal_forces == {}
    assert settled.required_friction == np.inf
    assert settled.slip_margin < -5.0


@pytest.mark.parametrize('change', [0.0, 1e-4, -1e-3, [0.0] * 5 + [2.5, 2.5] + [0.0] * 4])
def test_rolled_equilibrium_is_independent_of_the_prediction(change):
    """From a last one, too, from which there is no way: then the search begins where it was."""
    grasp = attach_grip(CONFIG, CYLINDER)
    travel = np.full(6, 1e-4)
    config = CONFIG.moved_to(CONFIG.roller_positions + travel)
    expected = roll_grip(grasp, config).state.unknowns
    ahead = replace(grasp, motion=(travel, np.broadcast_to(change, 11)))
    moved = roll_grip(ahead, config)
    # Tubes are linearised about where it is expected: what that leaves is below 1e-7 m.
    assert moved.state.unknowns == pytest.approx(expected, rel=1e-6, abs=1e-5)
    assert moved.state.unknowns[:5] == pytest.approx(expected[:5], abs=1e-7)
    assert moved.motion[1] == pytest.approx(moved.state.unknowns - grasp.state.unknowns)


def test_more_than_three_members_are_named_as_what_it_does_not_settle(monkeypatch):
    monkeypatch.setattr(attach_grip_module, 'GRIP_SIZES', (2,))
    settled = settle_grasp(HOME, ConvexObject.disc((0.0, -0.8267), 0.65), FRICTION)
    assert settled.hold is HoldStatus.OTHER_CONTACT
    assert not settled.held
    assert 'another member' in settled.reason


@pytest.mark.parametrize('diameter', [0.182, 0.1866, 0.188])
def test_a_deep_disc_whose_contacts_cross_guide_rings_settles(diameter):
    triangle = preset('triangle')
    members, ring = triangle.member_names[:2], triangle.description.module.guide_ring_distance
    grip = place_between(triangle.home, members, Disc(diameter), indentation=0.02)
    found = settle_grasp(triangle.home, grip.body, members=members).equilibrium
    # The contact of straight tubes and the contact of bent tubes are up to 13 mm apart.
    assert found is not None
    assert abs(found.state.feet[1] - ring) < 0.006


def test_refusal_of_a_deep_object_has_its_deepest_member_and_depth():
    body = ConvexObject.disc((0.75, -0.2), 0.6)
    depths = member_depths(HOME, body)
    deepest = f'{1e3 * depths.max():.3g} mm deep in {HOME.robot.member_names[depths.argmax()]}'
    assert deepest in settle_grasp(HOME, body).reason


def test_contacts_that_bend_beyond_the_ends_of_their_members_are_named():
    members = ('south/P-Q', 'north/R-P')
    grip = place_between(HOME, members, Disc(0.27), indentation=0.015)
    assert settle_grasp(HOME, grip.body, members=members).hold is HoldStatus.OFF_MEMBER


def test_used_friction_is_the_share_of_the_cone():
    settled = settle_grasp(CONFIG, CYLINDER, FRICTION, external_wrench=(0.3, 0.0, 0.05))
    for name, used in settled.friction_used.items():
        cone = FRICTION * settled.normal_forces[name]
        assert used == pytest.approx(abs(settled.friction_forces[name]) / cone)
    assert max(settled.friction_used.values()) == pytest.approx(
        settled.required_friction / FRICTION
    )
