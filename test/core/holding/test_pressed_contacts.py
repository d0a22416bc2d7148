# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where objects press into tubes: corners or faces by how they lie, and a start near to them."""

from held_grips import HOME
from isotruss_ros.core import ConvexObject, Disc, Polygon
from isotruss_ros.core.holding.contact_statics import build_statics
from isotruss_ros.core.holding.pressed_contacts import find_pressed, PressedContacts
import numpy as np
import pytest
import robots
from shapes import regular_polygon

NUMBER = HOME.robot.member_names.index('south/P-Q')
RADIUS = 0.5 * HOME.robot.description.tube_diameter


def member_line():
    """Return where the member starts, and its direction."""
    start, end = robots.member_ends(HOME, 'south/P-Q')
    return start, (end - start) / abs(end - start)


def lain_on(length, tilt, side=1.0, depth=0.01):
    """Return a box whose face of a length is on a member, one end higher, the other this deep."""
    half = 0.5 * length
    shape = Polygon([(-half, 0.0), (half, 0.0), (half, 0.3), (-half, 0.3)])
    start, axis = member_line()
    turn = axis if side > 0.0 else -axis
    # The lower end of the face, off the centre line.
    corner = half * np.exp(1j * tilt) * turn * (-1.0 if tilt > 0.0 else 1.0)
    center = start + 0.4 * axis + 1j * turn * (RADIUS - depth) - corner
    return ConvexObject(shape, (center.real, center.imag, np.angle(turn) + tilt))


def test_face_shorter_than_the_tube_radius_is_one_contact():
    found = find_pressed(HOME, lain_on(0.98 * RADIUS, 0.01), np.array([NUMBER]))
    assert found.corners.tolist() == [0]


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_small_objects_keep_their_side_of_a_member(side):
    start, axis = member_line()
    center = start + (0.4 - 0.08j * side) * axis
    place = (center.real, center.imag)
    outward = 1j * side * axis
    small = regular_polygon(5, 0.04)
    for shape in (Disc(0.08), small):
        body = ConvexObject(shape, (*place, 0.3))
        found = find_pressed(HOME, body, np.array([NUMBER]))
        statics = build_statics(HOME, body, found)
        assert statics.sides.tolist() == [side]
        assert statics.straight_normals == pytest.approx(np.array([outward]))
    # The corner that is farthest out.
    corners = np.array(small.vertices) @ [1.0, 1j] * body.turn
    assert found.corners.tolist() == [(corners * outward.conjugate()).real.argmax()]


#: Large arcs beside short faces.
ROUNDED = Polygon(
    [
        (-0.06437508664973714, -0.2101028283309208),
        (0.04090426319996171, -0.17997485528691023),
        (0.10341299861524661, 0.024984324751507133),
        (-0.05883918213948619, 0.17307766633871405),
        (-0.1206102416289031, 0.11569351212129327),
        (-0.15950340874092248, -0.016184804122091973),
        (-0.13959537290760876, -0.13181093320418152),
    ],
    (
        0.08112582594732186,
        0.09062635524040105,
        0.15261018511298427,
        0.04120285884927663,
        0.13832332408324016,
        0.07562513574736195,
        0.0,
    ),
)


@pytest.mark.parametrize('beyond', [0.0, 0.1, 0.307, 1.0])
def test_dents_of_a_corner_whose_faces_are_turned_away_grow_with_the_force(beyond):
    start, axis = member_line()
    before = ROUNDED.faces_at(4)[0].normal
    turn = -1j * axis / (before * np.exp(-1j * beyond))
    center = start + (0.4 + 0.15j) * axis
    body = ConvexObject(ROUNDED, (center.real, center.imag, np.angle(turn)))
    contacts = PressedContacts(np.array([NUMBER]), np.array([4]))
    dents = build_statics(HOME, body, contacts).dents
    angle = np.array([np.angle(before) - beyond])
    depths = [dents(np.array([force]), angle)[0] for force in (1.0, 5.0, 20.0, 60.0)]
    assert (np.diff(depths, axis=0) > 0.0).all()
