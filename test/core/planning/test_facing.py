# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where members touch that face an object, and toward which directions they are to turn."""

import math

from isotruss_ros.core import ConvexObject, Disc, Ellipse, Polygon
from isotruss_ros.core.planning.facing import (
    balance_angles,
    contact_ends,
    find_facing,
    friction_angles,
)
import numpy as np
import pytest

BOX = ((-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1))
RADII = (0.02, 0.05, 0.01, 0.03)
TURNING = 0.5
#: Of the tubes [m].
RADIUS = 0.051


def box(radius=0.0, angle=0.0):
    """Return a box that is turned."""
    return ConvexObject(Polygon(BOX, corner_radius=radius), (0.3, -0.2, angle))


@pytest.mark.parametrize('angle', [0.0, 0.7, -2.0])
def test_faces_are_touched_between_the_arcs_at_their_ends(angle):
    body = box(RADII, angle)
    own = np.array([-1.0j, 1.0, 1.0j, -1.0])
    ends = contact_ends(body, own * body.turn, RADIUS)
    one = np.array([-0.13 - 0.1j, 0.15 - 0.05j, 0.14 + 0.1j, -0.15 + 0.07j])
    other = np.array([0.1 - 0.1j, 0.15 + 0.09j, -0.12 + 0.1j, -0.15 - 0.08j])
    assert ends[0] == pytest.approx(one * body.turn, abs=1e-12)
    assert ends[1] == pytest.approx(other * body.turn, abs=1e-12)


def test_arcs_are_touched_where_they_face_the_member():
    body, own = box(RADII, 0.4), np.exp(0.8j)
    (one,), (other,) = contact_ends(body, np.array([own]) * body.turn, RADIUS)
    assert one == other == pytest.approx((0.14 + 0.09j + 0.01 * own) * body.turn)


def price_of(body, found, normals, angle):
    """Return what directions take of friction and turning; no cone may be wider than the angle."""
    used = friction_angles(body, found[:1], found[1:], RADIUS)[0]
    assert used <= angle + 1e-12
    return used + TURNING * np.abs(np.angle(found / normals)).sum()


@pytest.mark.parametrize('shape', [Disc(0.3), Ellipse((0.2, 0.12)), Polygon(BOX, 0.02)])
def test_found_directions_are_nearly_the_nearest(shape):
    angle, rng = 0.3, np.random.default_rng(3)
    body = ConvexObject(shape, (1.0, -0.5, 0.6))
    # Several times as many as the search tries: pairs of directions in steps of a degree.
    directions = np.exp(1j * np.radians(np.arange(360)))
    first, wedge = (grid.ravel() for grid in np.meshgrid(np.arange(360), np.arange(-46, 47)))
    other = (first + 180 + wedge) % 360
    firsts, others = directions[first], directions[other]
    ends = np.array(contact_ends(body, directions, RADIUS))
    used = balance_angles(firsts, others, ends[:, first], ends[:, other])
    for _ in range(10):
        normals = np.exp(1j * rng.uniform(0.0, 2.0 * math.pi, 2))
        turned = np.abs(np.angle(firsts / normals[0])) + np.abs(np.angle(others / normals[1]))
        least = np.where(used <= angle, used + TURNING * turned, np.inf).min()
        found = find_facing(body, normals, angle, RADIUS, TURNING)
        # A step between two directions, and one between two angles of the members.
        assert price_of(body, found, normals, angle) < least + 0.1


def test_an_ellipse_is_held_along_its_axes_without_friction():
    body = ConvexObject(Ellipse((0.2, 0.1)), (0.0, 0.0, 0.1234))
    normals = np.array([1.0, -1.0 + 0j])
    found = find_facing(body, normals, 1e-9, RADIUS, 0.5)
    assert found == pytest.approx(normals * body.turn, abs=1e-9)
