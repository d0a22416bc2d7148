# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Objects between members of the nine-member robot at home, and how they are held there."""

from isotruss_ros.core import ConvexObject, Grip, load_robot, place_between, Polygon, Pose
from isotruss_ros.core.holding.attach_grip import attach_grip
import numpy as np
import random_grips
import robots
from scipy.optimize import linprog

NINE = load_robot('nine_member')
HOME = NINE.home
#: Two sides of different tubes, which meet at no module.
APART = ('south/P-Q', 'north/R-P')
NEAR = 0.42 - 0.24j
#: From the centre lines of the members to the object, pressed in somewhat [m].
OFF = 0.041
#: Without these rollers a face that lies on a member keeps the object from turning alone.
FAILED = ('south/Q', 'east/R')
CORNERS = 0.26 * np.exp(2j * np.pi * np.arange(5) / 5)
PENTAGON = Polygon(CORNERS.view(float).reshape(-1, 2))
BOX = Polygon([(-0.25, -0.2), (0.25, -0.2), (0.25, 0.2), (-0.25, 0.2)], corner_radius=0.02)
#: A triangle's own sides.
LOOP = ('south/P-Q', 'south/Q-X', 'south/X-P')


def numbers(members):
    """Return the numbers of members."""
    return np.array([NINE.member_names.index(name) for name in members])


def held(shape, angle, members=APART, depth=0.01, **options):
    """Return how an object is held that is pressed into members."""
    grip = place_between(HOME, members, shape, angle=angle, indentation=depth)
    return attach_grip(HOME, grip.body, numbers(members), **options)


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


def inclination(rolling):
    """Return how far the face is from lying on the first member [rad]."""
    ends = robots.member_ends(rolling.config, APART[0])
    normal = random_grips.toward(rolling.grip.body.middle, *ends)
    return float(np.angle(normal / (PENTAGON.normals[0] * rolling.grip.body.turn)))


def wedged_grip(shift, half):
    """
    Return a quadrilateral with a face on each member.

    :param shift: of the middles of the faces along the members from next to its origin [m].
    :param half: of the length of each face [m].
    """
    starts, axes, normals = sides()
    feet = normals * (((starts - NEAR) * normals.conj()).real - OFF) + shift * axes
    corners = np.concatenate([feet - half * axes, feet + half * axes])
    corners = corners[np.argsort(np.angle(corners))]
    shape = Polygon(corners.view(float).reshape(-1, 2))
    return Grip(APART, ConvexObject(shape, Pose(NEAR.real, NEAR.imag, 0.0)))


def balance_exists(contacts, kept, friction):
    """Tell by a linear program whether contacts have forces in their cones that balance."""
    wrenches, pressing = [], []
    for k in kept:
        for sign in (1.0, -1.0):
            force = -contacts.normals[k] * (1.0 + sign * 1j * friction)
            moment = (contacts.points[k].conjugate() * force).imag
            wrenches.append([force.real, force.imag, moment])
            pressing.append(1.0)
    equal = np.vstack([np.array(wrenches).T, pressing])
    found = linprog(np.zeros(len(pressing)), A_eq=equal, b_eq=[0.0, 0.0, 0.0, 1.0])
    return found.status == 0
