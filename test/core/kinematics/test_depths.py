# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How deep an object is in members, and where they push it, without friction."""

from isotruss_ros.core import ConvexObject, Disc, load_robot, Polygon
from isotruss_ros.core.kinematics.depths import member_depths, push_out
from isotruss_ros.core.model.convex_object import segment_gaps
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
HOME = ROBOT.home
TOPOLOGY = ROBOT.topology
BEGIN, END = HOME.points[TOPOLOGY.b], HOME.points[TOPOLOGY.end]
TUBE = 0.5 * ROBOT.description.tube_diameter
SIZE = 0.12
BOX = Polygon([(-0.05, -0.04), (0.05, -0.04), (0.05, 0.04), (-0.05, 0.04)])


def test_closed_form_for_discs_agrees_with_the_general_search():
    rng = np.random.default_rng(0)
    for _ in range(200):
        body = ConvexObject.disc(rng.uniform(-1.0, 1.0, 2), rng.uniform(0.05, 0.8))
        expected = TUBE - segment_gaps(body, BEGIN, END).gaps
        assert member_depths(HOME, body) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize('member', range(len(BEGIN)))
@pytest.mark.parametrize('side', [1.0, -1.0])
def test_one_member_pushes_along_its_normal_until_the_surfaces_touch(member, side):
    along = (END[member] - BEGIN[member]) / abs(END[member] - BEGIN[member])
    middle, normal = 0.5 * (BEGIN[member] + END[member]), side * 1j * along
    touching = middle + (0.5 * SIZE + TUBE) * normal
    lying, away = touching - 0.03 * normal, touching + 0.001 * normal
    body = ConvexObject(Disc(SIZE), (lying.real, lying.imag, 0.4))
    moved = push_out(HOME, body)
    assert moved.center == pytest.approx(touching, abs=1e-9)
    assert moved.pose.angle == 0.4
    apart = body.moved_to((away.real, away.imag, 0.4))
    assert push_out(HOME, apart) == apart
    box = ConvexObject(BOX, (lying.real, lying.imag, 0.4))
    moved = push_out(HOME, box)
    gaps = segment_gaps(moved, BEGIN, END).gaps - TUBE
    assert gaps[member] == pytest.approx(0.0, abs=2e-9)
    assert ((moved.center - box.center) * normal.conjugate()).imag == pytest.approx(0.0, abs=1e-9)
    assert moved.pose.angle == 0.4


def test_two_members_push_out_of_their_wedge():
    """Where two members meet, on the bisector, after many pushes."""
    one, other = 0, TOPOLOGY.following[0]
    tip = 0.5 * (END[one] + BEGIN[other])
    sides = [BEGIN[one] - tip, END[other] - tip]
    inward = sum(side / abs(side) for side in sides)
    center = tip + 0.1 * inward / abs(inward)
    pushed = push_out(HOME, ConvexObject(Disc(SIZE), (center.real, center.imag, 0.0)))
    assert segment_gaps(pushed, BEGIN, END).gaps.min() - TUBE > -2e-9
    assert 0.0 < ((pushed.center - center) * inward.conjugate()).real < 0.5
