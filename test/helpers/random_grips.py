# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random objects between members of random robots."""

import itertools
from types import SimpleNamespace

from isotruss_ros.core import ConvexObject, Disc, Ellipse, Grip, Polygon, Pose
from isotruss_ros.core.errors import ConfigurationError, GraspError
from isotruss_ros.core.manipulation.grip import find_contacts, GripContact
import numpy as np
import robots
import shapes


def contacts_of(config, grip):
    """Return the contacts of a grip as arrays: owners, starts, normals, points, sides."""
    columns = zip(*find_contacts(config, grip), strict=True)
    names = [f'{name}s' for name in GripContact._fields]
    return SimpleNamespace(**dict(zip(names, map(np.array, columns), strict=True)))


def robots_with(kind):
    """Return a strategy of robots that may have members of a kind, see `kind_of`."""
    return robots.robots({'tube': ('polygon',), 'tubes': ('arch', 'ring')}.get(kind, robots.KINDS))


def kind_of(robot, members):
    """Return whether members are of different tubes, meet at a module, or neither."""
    topology = robot.topology
    numbers = [robot.member_names.index(name) for name in members]
    if len(set(topology.tube[numbers])) > 1:
        return 'tubes'
    meet = any(topology.following[i] == j for i, j in itertools.permutations(numbers, 2))
    return 'module' if meet else 'tube'


def random_grip(robot, rng, kind, count=2):
    """Return a random state and a disc pressed into members of a kind there, or None."""
    try:
        config = robots.random_state(robot, rng)
    except ConfigurationError:
        return robot.home, None
    tube = robot.description.tube_diameter
    combinations = [
        names
        for names in itertools.combinations(robot.member_names, count)
        if kind_of(robot, names) == kind
    ]
    for _ in range(100 if combinations else 0):
        names = combinations[rng.integers(len(combinations))]
        names = [names[i] for i in rng.permutation(count)]
        ends = [robots.member_ends(config, name) for name in names]
        share = rng.uniform(0.05, 0.95, count)
        touched = np.array([a + s * (b - a) for (a, b), s in zip(ends, share, strict=True)])
        center = complex(rng.dirichlet(np.full(count, 3.0)) @ touched)
        if count == 3:
            center = equally_far(ends, center)
            center += 0.5 * tube * complex(*rng.uniform(-1.0, 1.0, 2))
        lengths = [abs(b - a) for a, b in ends]
        places = [(center - a) * abs(b - a) / (b - a) for a, b in ends]
        offs = np.array([abs(place.imag) for place in places])
        on = all(0.0 < p.real < n for p, n in zip(places, lengths, strict=True))
        diameter = offs.min() + offs.max() - tube
        if on and np.ptp(offs) < 1.8 * tube and 0.02 < diameter < 2.0:
            body = ConvexObject.disc((center.real, center.imag), float(diameter))
            return config, Grip(names, body)
    return config, None


def random_convex_grip(robot, rng, kind, count=2, flat=False):
    """Return a random state and shape at members; flat: a face on the first, None: a disc."""
    config, round_grip = random_grip(robot, rng, kind, count)
    if round_grip is None or flat is None:
        return config, round_grip
    size = round_grip.body.arm
    shape = shapes.random_polygon(rng, size) if flat else shapes.random_shape(rng, size)
    center = round_grip.center
    ends = [robots.member_ends(config, name) for name in round_grip.members]
    normals = [toward(center, start, end) for start, end in ends]
    turn = np.exp(1j * rng.uniform(-3.0, 3.0))
    if flat:
        turn = normals[0] / shape.normals[rng.integers(len(shape.normals))]
    width = shape.support(np.array(normals) / turn).mean()
    try:
        shape = scaled(shape, size / width)
    except GraspError:  # too large
        return config, None
    # As far from all members as they are apart, pressed in a little.
    reach = shape.support(np.array(normals) / turn) + 0.4 * robot.description.tube_diameter
    rows = np.array([[n.real, n.imag] for n in normals])
    right = [
        ((a - center) * n.conjugate()).real - r
        for (a, _), n, r in zip(ends, normals, reach, strict=True)
    ]
    x, y = np.linalg.lstsq(rows, np.array(right), rcond=0.2)[0]
    place = center + complex(x, y)
    body = ConvexObject(shape, Pose(place.real, place.imag, float(np.angle(turn))))
    grip = Grip(round_grip.members, body)
    middle = body.middle
    if any(abs(toward(middle, *e) - n) > 1e-9 for e, n in zip(ends, normals, strict=True)):
        return config, None
    try:
        find_contacts(config, grip)
    except GraspError:
        return config, None
    return config, grip


def scaled(shape, factor):
    if isinstance(shape, Disc):
        return Disc(factor * shape.diameter)
    if isinstance(shape, Ellipse):
        return Ellipse(tuple(factor * np.array(shape.semi_axes)))
    return Polygon(factor * np.array(shape.vertices), tuple(factor * shape.radii))


def toward(point, start, end):
    """Return the unit vector from a point at right angles to a member."""
    across = 1j * (end - start) / abs(end - start)
    away = ((point - start) * across.conjugate()).real
    return -across if away > 0.0 else across


def equally_far(ends, near):
    """Return the point as far from three lines, on the sides of them on which a point is."""
    rows, right = [], []
    for start, end in ends:
        inward = 1j * (end - start) / abs(end - start)
        if (inward.conjugate() * (near - start)).real < 0.0:
            inward = -inward
        rows.append([inward.real, inward.imag, -1.0])
        right.append((inward.conjugate() * start).real)
    x, y, _ = np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)[0]
    return complex(x, y)
