# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Search for contacts: its work is bounded, and ends of faces that graze are continuous."""

from dataclasses import replace
from functools import cache
import math
from types import SimpleNamespace

from held_grips import BOX, held
from isotruss_ros.core import (
    ConvexObject,
    Disc,
    Ellipse,
    HoldStatus,
    Polygon,
    settle_grasp,
)
from isotruss_ros.core.holding import contact_search
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_search import ContactSet, find_free_corners, search_contacts
from isotruss_ros.core.holding.contact_statics import ContactStatics
from isotruss_ros.core.holding.pressed_contacts import PressedContacts
from isotruss_ros.core.holding.roll_grip import roll_contacts
from isotruss_ros.core.statics.bent_tubes import BentTubes
from nightly import some_now
import numpy as np
import pytest
from robots import preset
from shapes import random_polygon
from skin_depths import corner_depths

ROBOTS = [preset(name) for name in ('nine_member', 'triangle', 'ring_of_four')]
#: Largest numbers of evaluated equations and of linearised tubes in one call.
MOST_EQUATIONS, MOST_LINEARISATIONS = 650, 100
TURNED = ROBOTS[1].configuration([0.051, 0.069])


def deep_objects(numbers):
    """Yield objects of 0.2 to 3 m anywhere in a robot, discs to polygons of many corners."""
    rng = np.random.default_rng(3)
    for number in range(max(numbers) + 1):
        robot = ROBOTS[number % len(ROBOTS)]
        low, high = robot.home.nodes.min(axis=0), robot.home.nodes.max(axis=0)
        size = 10.0 ** rng.uniform(np.log10(0.1), np.log10(1.5))
        shape = (
            Disc(2.0 * size),
            Ellipse((size, size * rng.uniform(0.4, 1.0))),
            random_polygon(rng, size),
            random_polygon(rng, size, corners=int(rng.integers(9, 40))),
        )[number % 4]
        pose = *rng.uniform(low, high), rng.uniform(-3.0, 3.0)
        if number in numbers:
            yield robot.home, ConvexObject(shape, pose)


# First those objects of the 60 that take the most equations and linearisations.
@pytest.mark.parametrize(
    ('by_name', 'numbers'),
    some_now([(False, (7,)), (True, (55,)), (False, range(60)), (True, range(60))], 2),
)
def test_refusals_of_deep_objects_take_bounded_work(monkeypatch, by_name, numbers):
    counted = {'equations': 0, 'update': 0}

    def watch(kind, name):
        called = getattr(kind, name)

        def count(*arguments):
            counted[name] += 1
            return called(*arguments)

        monkeypatch.setattr(kind, name, count)

    watch(ContactStatics, 'equations')
    watch(BentTubes, 'update')
    refused = 0
    for config, body in deep_objects(numbers):
        counted.update(equations=0, update=0)
        members = config.robot.member_names[:2] if by_name else None
        refused += settle_grasp(config, body, 0.5, members=members).hold is not HoldStatus.HELD
        assert counted['equations'] <= MOST_EQUATIONS
        assert counted['update'] <= MOST_LINEARISATIONS
    assert refused > 2 * len(numbers) / 3


def test_a_search_without_end_solves_a_bounded_number_of_sets(monkeypatch):
    contacts, solved = held(BOX, 0.0).contacts, []

    def solve(chosen, _):
        solved.append(chosen)
        return SimpleNamespace(contacts=chosen.contacts)

    def others(grip, _):
        more = ContactSet.of(grip.contacts)._replace(grazing=None)
        origins = more.origins.copy()
        origins[0] = -1 - len(solved)
        return [more._replace(origins=origins), more._replace(grazing=len(solved))]

    monkeypatch.setattr(contact_search, '_propose_sets', others)
    assert search_contacts(solve, contacts, limit=5) is None
    assert len(solved) == 5
    solved.clear()
    assert search_contacts(lambda chosen, _: solved.append(chosen), contacts) is None
    assert 1 < len(solved) < 12


def test_corners_of_a_thin_plate_are_reached_the_shorter_way_round():
    grip = held(BOX, 0.0)
    statics, normal = grip.statics, complex(grip.statics.straight_normals[0])
    plate = Polygon([(-0.1, -0.01), (0.1, -0.01), (0.1, 0.01), (-0.08, 0.01)])
    lines, half = statics.bent.lines, 0.5 * statics.bent.lines.length[0]
    center = complex(lines.start[0] + half * lines.axis[0]) - (statics.tube_radius + 0.01) * normal
    body = ConvexObject(plate, (center.real, center.imag, np.angle(normal) - 0.5 * np.pi))
    one = PressedContacts(grip.members[:1], np.array([2]))
    state = replace(grip.state, unknowns=np.append(body.pose, grip.state.unknowns[3:]))
    beside = replace(grip, state=state, statics=replace(statics, body=body, contacts=one))
    along = {corner.corner: corner.face_distance for corner in find_free_corners(beside, np.inf)}
    assert along == pytest.approx({3: 0.18, 0: 0.18 + math.hypot(0.02, 0.02)})


@pytest.mark.parametrize('order', [(-0.3, 0.1, 0.2), (0.1, 0.2, -0.3)])
def test_the_equilibrium_nearest_to_the_measured_pose_is_chosen(monkeypatch, order):
    """Without a history, all sets that follow from the first one are solved."""
    contacts, measured = held(BOX, 0.0).contacts, SimpleNamespace(body=SimpleNamespace(middle=0.4))
    moved = dict(enumerate(order))

    def solve(chosen, before):
        middle = 0.4 + (9.0 if before is None else moved[int(chosen.origins[0])])
        body = SimpleNamespace(middle=middle)
        return SimpleNamespace(contacts=chosen.contacts, body=body, statics=measured)

    def others(grip, _):
        if grip.body.middle < 9.0:
            return None
        return [
            ContactSet(
                replace(grip.contacts, corners=grip.contacts.corners + 1 + number),
                np.full(len(grip.contacts.corners), number),
            )
            for number in moved
        ]

    monkeypatch.setattr(contact_search, '_propose_sets', others)
    chosen = search_contacts(solve, contacts)
    assert chosen.body.middle == pytest.approx(0.4 + 0.1)


@cache
def grip_with_turned_face(turn):
    """Return the equilibrium of a polygon whose face turns toward a tube [rad]."""
    corners = [(0.068, -0.12), (0.011, 0.281), (-0.235, 0.176), (-0.19, -0.083), (-0.079, -0.192)]
    shape = Polygon(corners, (0.0, 0.09, 0.14, 0.0, 0.09))
    body = ConvexObject(shape, (0.8462, 0.7344, 0.5733 + turn))
    return attach_grip(TURNED, body, np.array([1, 2]))


def test_contact_patches_are_finite_with_a_contact_without_force():
    grips = [grip_with_turned_face(1e-3 * turn) for turn in range(-18, -5, 4)]
    touching = [grip for grip in grips if grip.state.normal_forces.min() < 1e-9]
    assert touching
    for grip in touching:
        patches = grip.patches
        assert patches.areas * patches.pressures == pytest.approx(grip.normal_forces)
        assert (np.diff(patches.spans)[:, 0] >= patches.lengths - 1e-9).all()


def test_the_response_with_a_contact_without_force_is_that_without_the_contact():
    grip = grip_with_turned_face(1e-3 * -10)
    (idle,) = np.flatnonzero(np.abs(grip.state.normal_forces) < 1e-9)
    others = ContactSet.of(grip.contacts).without(int(idle))
    alone = roll_contacts(grip, grip.config, others, grip.wrench)
    size = np.abs(alone.response.pose).max()
    assert grip.response.pose == pytest.approx(alone.response.pose, abs=2e-4 * size)
    assert grip.slip_margin(0.9) == pytest.approx(alone.slip_margin(0.9), rel=1e-3)


@pytest.mark.parametrize('turns', some_now([range(-18, -5, 2), range(-30, 31)]))
def test_an_end_of_a_face_that_grazes_touches_without_force(turns):
    """The turns are in milliradians."""
    kinds, poses = [], []
    for turn in [1e-3 * turn for turn in turns]:
        grip = grip_with_turned_face(turn)
        config = grip.config
        normal, count = grip.state.normal_forces, len(grip.contacts.members)
        kinds.append(count)
        poses.append(np.array(grip.pose))
        if count == 3:
            end = int(normal.argmin())
            depth = corner_depths(grip, config.robot.member_names[grip.contacts.members[end]])
            assert normal[end] == pytest.approx(0.0, abs=1e-9)
            assert grip.state.friction_forces[end] == pytest.approx(0.0, abs=1e-9)
            assert depth[grip.contacts.corners[end]] == pytest.approx(0.0, abs=1e-4)
        else:
            assert grip.pose.angle == pytest.approx(0.5733 + turn, abs=1e-9)
    # The end comes into contact once, and the pose does not jump there.
    assert kinds == sorted(kinds)
    assert {2, 3} == set(kinds)
    assert np.abs(np.diff(poses, axis=0)).max() < 5e-3


@pytest.mark.parametrize(('share', 'opens'), [(-1e-7, True), (-1e-11, False), (1e-7, False)])
def test_only_an_end_of_a_face_in_tension_opens(share, opens):
    grip = held(BOX, 0.0)
    unknowns = grip.state.unknowns.copy()
    normal = unknowns[grip.state.places.normal]
    normal[1] = share * normal.sum()
    tense = replace(grip, state=replace(grip.state, unknowns=unknowns))
    proposed = [chosen.origins.tolist() for chosen in contact_search._propose_sets(tense, True)]
    others = [k for k in range(len(normal)) if k != 1]
    assert (others in proposed) == opens
