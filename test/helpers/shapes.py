# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Convex shapes for tests, and what is known of a shape by its outline alone."""

from isotruss_ros.core import ConvexObject, Disc, Ellipse, Polygon
from isotruss_ros.core.fixed_object.contact_points import Surface
import numpy as np

BRICK = Polygon([(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)], corner_radius=0.02)
#: One shape of each kind.
SHAPES = [BRICK, Ellipse((0.2, 0.12)), Disc(0.3), Polygon([(0.0, 0.0), (0.3, 0.05), (0.1, 0.25)])]


def circle(center, radius):
    """Return the surface of a disc, which points of the tubes meet."""
    return Surface(ConvexObject.disc((center.real, center.imag), 2.0 * radius))


def random_polygon(generator, size=0.2, rounded=True):
    """Return a convex polygon with corners on an ellipse somewhere, some of them rounded."""
    count = int(generator.integers(3, 9))
    gaps = 0.3 + generator.random(count)
    angles = generator.uniform(0.0, 6.0) + 2.0 * np.pi * np.cumsum(gaps) / gaps.sum()
    a, b = size * generator.uniform(0.4, 1.0, 2)
    z = a * np.cos(angles) + 1j * b * np.sin(angles)
    z = z * np.exp(1j * generator.uniform(0.0, 6.0)) + 0.3 * size * complex(
        *generator.uniform(-1.0, 1.0, 2)
    )
    vertices = [(w.real, w.imag) for w in z]
    if not rounded:
        return Polygon(vertices)
    sides = np.abs(np.roll(z, -1) - z)
    turns = np.angle((np.roll(z, -1) - z) / (z - np.roll(z, 1)))
    room = 0.5 * np.minimum(sides, np.roll(sides, 1)) / np.tan(0.5 * np.abs(turns))
    return Polygon(vertices, tuple(room * generator.choice([0.0, 0.3, 0.9], count)))


def sampled(shape, count, begin, away=0j):
    """Return the polygon of corners on a disc or an ellipse, in a frame away from its middle."""
    angles = begin + 2.0 * np.pi * np.arange(count) / count
    a, b = shape.semi_axes if isinstance(shape, Ellipse) else (0.5 * shape.diameter,) * 2
    corners = away + a * np.cos(angles) + 1j * b * np.sin(angles)
    return Polygon(tuple(zip(corners.real, corners.imag, strict=True)))


def random_shape(generator, size=0.2):
    kind = generator.integers(4)
    if kind == 0:
        return Disc(2.0 * size * generator.uniform(0.3, 1.0))
    if kind == 1:
        return Ellipse(tuple(size * generator.uniform(0.2, 1.0, 2)))
    return random_polygon(generator, size, rounded=kind == 2)


def dense_outline(shape, count=20_000):
    """Return points along the surface no farther apart than perimeter / count, also on faces."""
    corners = shape.outline(shape.perimeter / count)
    sides = np.abs(np.roll(corners, -1) - corners)
    along = np.concatenate([[0.0], np.cumsum(sides)])
    closed = np.append(corners, corners[0])
    places = np.union1d(along[:-1], np.linspace(0.0, along[-1], count, endpoint=False))
    return np.interp(places, along, closed.real) + 1j * np.interp(places, along, closed.imag)


def surface_distance(outline, points):
    """Return the distance of points from a dense outline, negative inside."""
    distance = np.abs(points[:, None] - outline).min(axis=1)
    spokes = outline - points[:, None]
    wound = np.angle(np.roll(spokes, -1, axis=1) / spokes).sum(axis=1)
    return np.where(np.abs(wound) > np.pi, -distance, distance)


def regular_polygon(count, radius, angle=0.1):
    """Return a polygon of equal sides within a circle around the origin."""
    angles = angle + 2.0 * np.pi * np.arange(count) / count
    return Polygon(radius * np.column_stack([np.cos(angles), np.sin(angles)]))
