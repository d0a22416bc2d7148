# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contacts of a face with a tube are the same in shapes, grips, rolling, equilibria and plans."""

from held_grips import HOME, NINE
from isotruss_ros.core import ConvexObject, Grip, Polygon, RollingGrip
from isotruss_ros.core.holding.pressed_contacts import find_pressed
from isotruss_ros.core.manipulation.grip import find_contacts
from isotruss_ros.core.manipulation.rolling_grip import roll_object
from isotruss_ros.core.model.object_samples import ObjectSamples
from isotruss_ros.core.model.shapes import PLANNED_DEPTH
from isotruss_ros.core.planning.facing import contact_ends
from isotruss_ros.core.statics.structure import ConfigurationSamples
import numpy as np
import pytest
import robots

RADIUS = 0.5 * NINE.description.tube_diameter
MEMBERS = ('south/P-Q', 'north/R-P')
#: Length of the face [m].
FACE = 0.24
TILTS = (1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 5e-3, 1e-2, 2e-2, 5e-2)
DEPTHS = (1e-4, 1e-3, 3e-3, 6e-3, 1.2e-2, 2e-2)
#: Numbers of ends of the face in contact, by tilt and depth: tilt times face against the depth.
TABLE = {
    tilt: [1 + (FACE * np.sin(tilt) <= max(depth, PLANNED_DEPTH * RADIUS)) for depth in DEPTHS]
    for tilt in TILTS
}


def tilted(tilt, depth):
    """Return a triangle with a face on the first member, its lower end this deep in that."""
    (start, end), (other, far) = (robots.member_ends(HOME, name) for name in MEMBERS)
    axis = (end - start) / abs(end - start)
    inward = 1j * axis * np.sign(((other - start) / axis).imag)
    turn = -1j * inward * np.exp(1j * tilt)
    lower = 0.5 * FACE * turn * (-1.0 if tilt > 0.0 else 1.0)
    center = start + 0.5 * (end - start) + inward * (RADIUS - depth) - lower
    # The tip touches the other member in the middle.
    middle, across = 0.5 * (other + far), 1j * (far - other) / abs(far - other)
    across *= np.sign(((middle - center) * across.conjugate()).real)
    tip = (middle - RADIUS * across - center) / turn
    shape = Polygon([(-0.5 * FACE, 0.0), (0.5 * FACE, 0.0), (tip.real, tip.imag)])
    return ConvexObject(shape, (center.real, center.imag, float(np.angle(turn))))


def normal_in(body):
    """Return the normal toward the first member, in the object's frame, and the skin's height."""
    start, end = robots.member_ends(HOME, MEMBERS[0])
    across = 1j * (end - start) / abs(end - start)
    outward = across if ((start - body.middle) * across.conjugate()).real > 0.0 else -across
    skin = ((start - body.center) * outward.conjugate()).real - RADIUS
    return outward, skin


@pytest.mark.parametrize('depth', DEPTHS)
@pytest.mark.parametrize('sign', [1.0, -1.0])
@pytest.mark.parametrize('tilt', TILTS)
def test_contacts_of_a_face_are_the_same_for_all_tilts_and_depths(tilt, sign, depth):
    body = tilted(sign * tilt, depth)
    wanted = TABLE[tilt][DEPTHS.index(depth)]
    outward, skin = normal_in(body)
    patch = body.shape.contact_patch(outward / body.turn, RADIUS, skin)
    corners = tuple(end.corner for end in patch)
    assert len(corners) == wanted
    number = np.array([NINE.member_names.index(MEMBERS[0])])
    home, bodies = ConfigurationSamples([HOME]), ObjectSamples([body])
    pressed = find_pressed(home, bodies, {0: number})[0]
    assert tuple(pressed.corners.tolist()) == corners
    # Twist, rolling and guard take the contacts of the model of the held object.
    known = Grip(MEMBERS, body, corners=(corners, (2,)))
    for grip in (known, known.moved_to(body.pose)):
        assert _corners_of(grip) == corners
    rolling = RollingGrip.attach(HOME, known)
    assert tuple(rolling.corners[rolling.owners == 0].tolist()) == corners
    assert _corners_of(roll_object(known, HOME, HOME)) == corners
    assert rolling.moved_to(HOME).pose == pytest.approx(body.pose, abs=1e-12)


@pytest.mark.parametrize('tilt', [*TILTS, *(-tilt for tilt in TILTS)])
def test_plans_have_the_contacts_of_grips_at_the_planned_indentation(tilt):
    body = tilted(tilt, PLANNED_DEPTH * RADIUS)
    one, other = contact_ends(body, np.array([normal_in(body)[0]]), RADIUS)
    is_face = FACE * np.sin(abs(tilt)) <= PLANNED_DEPTH * RADIUS
    assert (one[0] != other[0]) == is_face
    assert len(_corners_of(Grip(MEMBERS, body))) == 1 + is_face


def _corners_of(grip, owner=0):
    return tuple(each.corner for each in find_contacts(HOME, grip) if each.owner == owner)
