# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The equations of a held object: rest, rolling; whether it is held by its forces."""

from dataclasses import replace

from grips import gripped
from held_grips import BOX, held, NINE
from isotruss_ros.core import HoldStatus, place_between, Polygon
from isotruss_ros.core.holding.attach_grip import attach_grip, least_friction_conditions
from isotruss_ros.core.holding.contact_statics import build_statics
from isotruss_ros.core.holding.pressed_contacts import ANGLE, CENTER
from isotruss_ros.core.holding.roll_grip import rolling_conditions
from nightly import some_now
import numpy as np
import pytest

CONFIG, DISC = gripped(squeeze=0.05)
MODEL = attach_grip(CONFIG, DISC)
UNLOADED = np.zeros(3)
NOTHING = np.zeros(0, dtype=int)


@pytest.fixture(scope='module')
def statics():
    """Return the equations of a disc between the two members at the tip."""
    return build_statics(CONFIG, DISC, MODEL.contacts)


def test_attached_pose_along_the_bisector_is_the_given_one(statics):
    _, state = statics.settle(statics.start(), UNLOADED, least_friction_conditions(statics))
    along = 1j * (state.normals[0] - state.normals[1])
    moved = complex(*state.unknowns[CENTER]) - DISC.center
    assert abs(moved) > 1e-3
    assert (moved * along.conjugate()).real == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize('steps', some_now([8, 2, 4, 10], 2))
def test_box_with_one_face_in_contact_is_at_its_given_position_across_the_chord(steps):
    box = Polygon([(-0.12, -0.1), (0.12, -0.1), (0.12, 0.1), (-0.12, 0.1)], 0.02)
    members = 'north/P-Z', 'north/Z-R'
    body = place_between(NINE.home, members, box, np.radians(15.0 * steps), 0.012).body
    grip = attach_grip(NINE.home, body)
    assert {len(contacts) for contacts in grip.contacts.by_member} == {1, 2}
    one, other = (grip.state.normals[contacts].mean() for contacts in grip.contacts.by_member)
    moved = grip.body.middle - body.middle
    assert abs(moved) > 1e-3
    assert (moved * (1j * (one - other)).conjugate()).real == pytest.approx(0.0, abs=1e-9)


def test_rolling_conditions_hold_at_rest_and_follow_the_tube(statics):
    turned = DISC.moved_to((*DISC.pose[:2], 0.3))
    _, state = statics.settle(
        statics.start(), UNLOADED, least_friction_conditions(replace(statics, body=turned))
    )
    angles = np.angle(state.normals) - 0.3
    anchors = statics.anchors(state.unknowns, state.normals, angles)
    closure = rolling_conditions(statics, anchors, angles, NOTHING)
    _, same = statics.settle(statics.start(), UNLOADED, closure)
    assert same.unknowns == pytest.approx(state.unknowns, abs=1e-8)
    # Both tubes run past the object alike: it turns in place (17), as far as 2 travel / d.
    along = 0.02
    closure = rolling_conditions(statics, anchors + along, angles, NOTHING)
    _, turned = statics.settle(state.unknowns, UNLOADED, closure)
    assert turned.unknowns[ANGLE] == pytest.approx(0.3 + along / statics.body.arm, abs=1e-9)
    places = state.places
    for part in (CENTER, slice(places.feet.start, None)):
        assert turned.unknowns[part] == pytest.approx(state.unknowns[part], abs=1e-8)


def with_unknowns(grip, **parts):
    """Return an equilibrium with other forces, feet or angle."""
    unknowns = grip.state.unknowns.copy()
    for name, values in parts.items():
        place = ANGLE if name == 'angle' else getattr(grip.state.places, name)
        unknowns[place] = values
    return replace(grip, state=replace(grip.state, unknowns=unknowns))


@pytest.mark.parametrize(
    ('normal', 'feet', 'hold'),
    [
        ([0.05, 1.0], [0.0, 1.0], HoldStatus.HELD),
        ([0.0, 1.0], [0.3, 0.3], HoldStatus.NO_CONTACT),
        ([1.0, -0.05], [0.3, 0.3], HoldStatus.NO_CONTACT),
        ([1.0, 1.0], [-0.01, 0.3], HoldStatus.OFF_MEMBER),
        ([1.0, 1.0], [0.3, 1.01], HoldStatus.OFF_MEMBER),
        ([1.0, 0.1], [0.3, 0.3], HoldStatus.SLIPS),
    ],
)
def test_a_grasp_holds_where_all_members_press_on_their_length_and_stick(normal, feet, hold):
    """Feet are shares of the lengths of their members."""
    places = np.array(feet) * MODEL.statics.bent.lines.length
    grasp = with_unknowns(MODEL, normal=normal, friction=[0.01, -0.06], feet=places)
    assert grasp.hold(0.5) is hold


def test_forces_of_members_are_sums_over_their_contacts():
    grip = held(BOX, 0.0)
    assert grip.contacts.owners.tolist() == [0, 1, 1]
    grasp = with_unknowns(grip, normal=[5.0, 1.0, 3.0], friction=[-2.0, 0.4, 0.8])
    assert grasp.normal_forces == pytest.approx([5.0, 4.0])
    assert grasp.friction_forces == pytest.approx([-2.0, 1.2])
    assert grasp.squeeze == pytest.approx(4.5)
    assert grasp.required_friction == pytest.approx(0.4)


@pytest.mark.parametrize(('angle', 'within'), [(3.0, 3.0), (4.0, 4.0 - 2.0 * np.pi)])
def test_the_angle_of_a_pose_is_within_half_a_turn(angle, within):
    assert with_unknowns(MODEL, angle=angle).pose.angle == pytest.approx(within)
