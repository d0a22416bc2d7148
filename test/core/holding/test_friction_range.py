# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Range of friction in which the contact history decides whether an object is held."""

from dataclasses import replace
import math

from grips import gripped
from held_grips import APART, BOX, CORNER, HOME, LOOP
from isotruss_ros.core import ConvexObject, place_between, Polygon, settle_grasp
from isotruss_ros.core.holding.roll_grip import roll_grip
import numpy as np
import pytest
import robots
from robots import with_round_tubes

FRICTION = 0.9
HEXAGON, SMALL_HEXAGON = (
    Polygon([(r * math.cos(a), r * math.sin(a)) for a in math.pi / 3.0 * np.arange(6)])
    for r in (0.34, 0.175)
)


def settled_between(members, shape, degrees, friction=FRICTION, home=HOME, **options):
    """Return an object that members press by 10 mm."""
    grip = place_between(home, members, shape, math.radians(degrees), 0.01)
    return settle_grasp(home, grip.body, friction, members=members, **options)


def test_range_of_a_disc_between_two_members_is_the_required_friction():
    settled = settle_grasp(*gripped(40.0, squeeze=0.04), FRICTION)
    required = settled.required_friction
    assert settled.friction_range == pytest.approx((required, required), abs=2e-5)


def test_range_of_an_object_on_two_corners_is_the_required_friction():
    settled = settled_between(CORNER, SMALL_HEXAGON, 30.0)
    required = settled.required_friction
    assert len(settled.equilibrium.state.normals) == 2
    assert settled.friction_range == pytest.approx((required, required), abs=2e-5)


@pytest.mark.parametrize(('share', 'verdict'), [(0.99, 'lost'), (1.01, 'unknown'), (1.3, 'held')])
def test_verdict_depends_on_the_place_of_friction_in_the_range(share, verdict):
    settled = settled_between(APART, BOX, 0.0)
    assert settled.friction_range.verdict(share * settled.required_friction) == verdict


@pytest.mark.parametrize(('members', 'degrees'), [(APART, 0.0), (CORNER, 60.0)])
def test_force_of_a_box_on_a_face_turns_by_twice_its_way_to_rest_after_a_sudden_fall(
    members, degrees
):
    settled = settled_between(members, BOX, degrees)
    # The force between the members is at the edge of one cone. It turns toward the other cone,
    # to rest at the edge of the smaller cone, and then as far again.
    opening = 2.0 * math.atan(settled.required_friction)
    expected = math.tan((opening + math.atan(FRICTION)) / 3.0)
    assert settled.friction_range.necessary == pytest.approx(settled.required_friction, abs=2e-5)
    assert settled.friction_range.sufficient == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(
    ('members', 'shape', 'degrees'), [(CORNER, BOX, 60.0), (LOOP, HEXAGON, 10.0)]
)
def test_equilibria_after_other_histories_use_the_necessary_friction_or_more(
    members, shape, degrees
):
    settled = settled_between(members, shape, degrees)
    grip, rng = settled.equilibrium, np.random.default_rng(0)
    used = []
    for slips in rng.uniform(-1e-4, 1e-4, (20, len(grip.anchors))):
        other = roll_grip(replace(grip, anchors=grip.anchors + slips), grip.config)
        used.append(np.abs(other.state.friction_forces / other.state.normal_forces).max())
    assert min(used) > 0.995 * settled.friction_range.necessary
    assert max(used) > 1.005 * settled.friction_range.necessary


def moved_home(change, supports):
    """Return the home configuration of a robot with moved joints and its own supports."""
    document = robots.preset_document('nine_member')
    places = {name: change(complex(*place)) for name, place in document['joints'].items()}
    document['joints'] = {name: [place.real, place.imag] for name, place in places.items()}
    return robots.load({**document, 'supports': supports}).home


@pytest.mark.parametrize(
    ('members', 'shape', 'degrees'), [(CORNER, BOX, 60.0), (LOOP, HEXAGON, 10.0)]
)
def test_range_is_invariant_to_turns_and_reflections(members, shape, degrees):
    expected = settled_between(members, shape, degrees).friction_range
    turned_home = moved_home(lambda place: 1j * place, {'X': ['x', 'y'], 'Y': ['x']})
    turned = settled_between(members, shape, degrees + 90.0, home=turned_home)
    reflected_home = moved_home(lambda place: -place.conjugate(), {'X': ['x', 'y'], 'Y': ['y']})
    reflected_shape = Polygon([(-x, y) for x, y in shape.vertices][::-1], shape.corner_radius)
    reflected = settled_between(members, reflected_shape, -degrees, home=reflected_home)
    assert turned.friction_range == pytest.approx(expected, abs=1e-4)
    assert reflected.friction_range == pytest.approx(expected, abs=1e-4)


def test_range_does_not_depend_on_the_scale_of_the_forces():
    home = with_round_tubes(HOME)
    soft, stiff = (
        settled_between(CORNER, BOX, 60.0, home=home, stiffness=scale) for scale in (1.0, 2.0)
    )
    assert stiff.friction_range == pytest.approx(soft.friction_range, abs=1e-3)


def test_range_of_three_members_grows_with_the_friction_of_the_histories():
    histories = [settled_between(LOOP, HEXAGON, 10.0, friction) for friction in (0.5, 0.9)]
    small, large = (settled.friction_range for settled in histories)
    assert small.necessary == pytest.approx(large.necessary, abs=2e-5)
    assert small.necessary < small.sufficient < large.sufficient


def test_range_without_an_equilibrium_is_infinite():
    settled = settle_grasp(HOME, ConvexObject.disc((9.0, 9.0), 0.3), FRICTION)
    assert settled.friction_range == (math.inf, math.inf)
    assert settled.friction_range.verdict(FRICTION) == 'lost'


def test_history_of_contacts_that_have_rolled_is_known():
    settled = settled_between(LOOP, HEXAGON, 10.0)
    rolled = roll_grip(settled.equilibrium, HOME)
    known = replace(settled, equilibrium=rolled)
    assert known.friction_range.sufficient < settled.friction_range.sufficient
