# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Objects between members of the nine-member robot at home, and how they are held there."""

from isotruss_ros.core import ConvexObject, Grip, place_between, Polygon, Pose
from isotruss_ros.core.holding.attach_grip import attach_grip
import numpy as np
import random_grips
import robots

NINE = robots.preset('nine_member')
HOME = NINE.home
#: Two sides of different tubes, which meet at no module.
APART = ('south/P-Q', 'north/R-P')
NEAR = 0.42 - 0.24j
#: From the centre lines of the members to the object, pressed in somewhat [m].
OFF = 0.041
CORNERS = 0.26 * np.exp(2j * np.pi * np.arange(5) / 5)
PENTAGON = Polygon(CORNERS.view(float).reshape(-1, 2))
#: Two corners touch `APART` at this angle; the line between them almost halves the sides' angle.
ANGLE, DEPTH = -0.5, 0.01
BOX_FILE = (
    '{shape: polygon, vertices: [[-0.25, -0.2], [0.25, -0.2], [0.25, 0.2], [-0.25, 0.2]],'
    ' corner_radius: 0.02, mass: 0.8, friction: 0.9}'
)
BOX = Polygon([(-0.25, -0.2), (0.25, -0.2), (0.25, 0.2), (-0.25, 0.2)], corner_radius=0.02)
#: A triangle's own sides.
LOOP = ('south/P-Q', 'south/Q-X', 'south/X-P')
#: Two members that meet at a module, and three of different tubes around the hole between them.
CORNER, AROUND = ('north/P-Z', 'north/Z-R'), ('south/P-Q', 'east/Q-R', 'north/R-P')


def numbers(members):
    return np.array([NINE.member_names.index(name) for name in members])


def held(shape, angle, members=APART, depth=0.01, **options):
    """Return how an object is held that is pressed into members."""
    grip = place_between(HOME, members, shape, angle=angle, indentation=depth)
    return attach_grip(HOME, grip.body, numbers(members), **options)


def box_between(angle=ANGLE, depth=DEPTH):
    """Return a grip of the box between the two sides."""
    return place_between(HOME, APART, BOX, angle, depth)


def sides():
    """Return starts, unit vectors and normals out of the object of both members."""
    ends = np.array([robots.member_ends(NINE.home, name) for name in APART])
    spans = ends[:, 1] - ends[:, 0]
    normals = np.array([random_grips.toward(NEAR, *e) for e in ends])
    return ends[:, 0], spans / np.abs(spans), normals


def inclined_grip(inclined, friction):
    """Return a pentagon between two sides, a face inclined against the first one [rad]."""
    starts, _, normals = sides()
    turn = normals[0] / PENTAGON.normals[0] * np.exp(1j * inclined)
    reach = PENTAGON.support(normals / turn) + OFF
    away = ((starts - NEAR) * normals.conj()).real - reach
    x, y = np.linalg.solve(normals.view(float).reshape(2, 2), away)
    place = NEAR + complex(x, y)
    pose = Pose(place.real, place.imag, float(np.angle(turn)))
    return Grip(APART, ConvexObject(PENTAGON, pose), friction)
