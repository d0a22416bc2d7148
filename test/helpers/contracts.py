# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of the interfaces that an own shape or barrier implements, and of whole messages."""

from collections.abc import Iterable

from isotruss_ros.core import RollingGrip, Status
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.safety.barrier_law import ALL_VALUES
import numpy as np
import pytest
from shapes import dense_outline, surface_distance

#: Points or directions of one check [-], and points of an outline [-].
SAMPLES, OUTLINE = 40, 4000


def flatten(value):
    """Return the values of a message or of nested sequences one after another."""
    if hasattr(value, 'get_fields_and_field_types'):
        value = [getattr(value, name) for name in value.get_fields_and_field_types()]
    if isinstance(value, str | bytes) or not isinstance(value, Iterable):
        return [value]
    return [part for item in value for part in flatten(item)]


def check_fields(message, expected, **tolerances):
    """Check every field of a message; fields without expected value are an error."""
    assert {*message.get_fields_and_field_types()} == expected.keys()
    for name, value in expected.items():
        bounds = {'rel': 1e-6, 'abs': tolerances.get(name, 1e-9), 'nan_ok': True}
        assert flatten(getattr(message, name)) == pytest.approx(flatten(value), **bounds), name


def check_shape(shape, generator):
    """Check all quantities of a shape against its outline and against each other."""
    check_area(shape)
    check_distances(shape, generator)
    check_tangents(shape, generator)
    check_curvature(shape, generator)
    check_rolling(shape, generator)


def directions(generator):
    return np.exp(1j * generator.uniform(-np.pi, np.pi, SAMPLES))


def check_area(shape):
    """Check perimeter, centroid and radius of gyration against the outline."""
    z = dense_outline(shape, OUTLINE)
    following = np.roll(z, -1)
    cross = (z.conj() * following).imag
    area = 0.5 * cross.sum()
    centroid = (cross * (z + following)).sum() / 6.0 / area
    a, b = z - centroid, following - centroid
    product = a.conj() * b
    squares = np.abs(a) ** 2 + np.abs(b) ** 2 + product.real
    polar = (product.imag * squares).sum() / 12.0
    assert abs(shape.centroid - centroid) < 1e-5 * shape.perimeter
    assert shape.gyration == pytest.approx(np.sqrt(polar / area), rel=1e-5)
    assert shape.perimeter == pytest.approx(np.abs(following - z).sum(), rel=1e-5)
    assert shape.nearest(np.array([shape.centroid])).gaps[0] < 0.0


def check_distances(shape, generator):
    """Check `nearest` against the outline, inside and outside."""
    size = shape.perimeter / np.pi
    points = shape.centroid + generator.uniform(0.0, size, SAMPLES) * directions(generator)
    found = shape.nearest(points)
    wanted = surface_distance(dense_outline(shape, OUTLINE), points)
    step = shape.perimeter / OUTLINE
    near = np.maximum(np.abs(wanted), 0.1 * step)
    assert np.all(np.abs(found.gaps - wanted) <= step**2 / near + 1e-6 * shape.perimeter)
    feet = points - found.gaps * found.normals
    assert shape.nearest(feet).gaps == pytest.approx(0.0, abs=1e-12)
    assert np.abs(found.normals) == pytest.approx(1.0, abs=1e-12)
    # The foot is on the tangent with that normal.
    expected = shape.support(found.normals)
    assert (feet * found.normals.conj()).real == pytest.approx(expected, abs=1e-12)


def check_tangents(shape, generator):
    """Check `support`, `support_points` and `reach` against the outline."""
    normals, outline = directions(generator), dense_outline(shape, OUTLINE)
    far = (outline * normals[:, None].conj()).real.max(axis=1)
    support = shape.support(normals)
    assert np.all(far <= support + 1e-12)
    assert support == pytest.approx(far, abs=1e-3 * shape.perimeter)
    on = shape.support_points(normals)
    assert (on * normals.conj()).real == pytest.approx(support, abs=1e-12)
    assert shape.nearest(on).gaps == pytest.approx(0.0, abs=1e-12)
    furthest = np.abs(outline).max()
    assert furthest - 1e-12 <= shape.reach <= furthest + 1e-3 * shape.perimeter


def apart_from_faces(shape, corner, normal):
    """Return whether a normal at a corner is inclined to those of both faces."""
    return all(abs(face.normal / normal - 1.0) > 1e-4 for face in shape.faces_at(corner))


def check_curvature(shape, generator):
    """Check that gap and normal of a moved point change by the radius of curvature."""
    normals, away, step = directions(generator), 0.1 * shape.perimeter, 1e-6 * shape.perimeter
    points = shape.support_points(normals) + away * normals
    found, moved = shape.nearest(points), shape.nearest(points + 1j * step * normals)
    turned = np.angle(moved.normals / found.normals) / step
    corners = [shape.corner_at(normal) for normal in normals.tolist()]
    # Where a step leads from an arc to a face there is no derivative.
    pairs = zip(corners, normals.tolist(), strict=True)
    same = np.array([apart_from_faces(shape, *pair) for pair in pairs])
    wanted = 1.0 / (away + shape.surface_at(np.array(corners), normals)[1])
    assert turned[same] == pytest.approx(wanted[same], rel=1e-3, abs=1e-6)
    slope = (moved.gaps - found.gaps) / step
    assert slope == pytest.approx(np.zeros(SAMPLES), abs=1e-4)


def check_rolling(shape, generator):
    """Check that `surface_at` and `unroll` are integrals of the radii of curvature."""
    for angle in generator.uniform(-np.pi, np.pi, SAMPLES).tolist():
        corner = shape.corner_at(complex(np.exp(1j * angle)))
        angles, step = angle + np.linspace(0.0, 0.1, 101), 1e-5
        corners = np.full(len(angles), corner)
        _, radii = shape.surface_at(corners, np.exp(1j * angles))
        ahead, behind = (
            shape.surface_at(corners, np.exp(1j * (angles + sign * step)))[0]
            for sign in (1.0, -1.0)
        )
        tangents = 1j * np.exp(1j * angles)
        assert np.abs((ahead - behind) / (2.0 * step) - radii * tangents).max() == pytest.approx(
            0.0, abs=1e-6 * shape.perimeter
        )
        arcs = shape.unroll(angles, corners)
        integral = np.trapezoid if hasattr(np, 'trapezoid') else np.trapz
        expected = integral(radii, angles)
        assert arcs[-1] - arcs[0] == pytest.approx(expected, abs=1e-5 * shape.perimeter)
        assert (np.diff(arcs) >= -1e-12).all()
        turned = shape.unroll(angles - 14.0 * np.pi, corners)
        assert turned - arcs == pytest.approx(-7.0 * shape.perimeter, rel=1e-9)


def check_barrier(barrier, config, grip, generator):
    """
    Check the values, names and derivatives of a barrier near its bound.

    :param config: configuration in which a value of the barrier is within its band.
    :param grip: the grip; None for a barrier without an object.
    :param generator: random generator of the motion, which keeps the contacts of the grip.
    """
    assert isinstance(barrier.status, Status)
    near = barrier.active(config, grip)
    assert len(near.indices), 'no value is within the band: nothing to check'
    values = barrier.values(config, grip, ALL_VALUES)
    assert near.values == pytest.approx(values[near.indices], abs=1e-12)
    assert set(np.flatnonzero(values < barrier.law.active_below)) <= set(near.indices.tolist())
    assert len(barrier.names(near.indices)) == len(near.indices)
    rows = config.roller_rows(near.node_rows)
    rows = rows if near.roller_rows is None else rows + near.roller_rows
    way = generator.standard_normal(rows.shape[1])
    rolling = None
    if grip is not None:
        kept = grip_jacobian(config, grip)[3:]
        way -= np.linalg.pinv(kept) @ kept @ way
        rolling = RollingGrip.attach(config, grip)
    step, reached = 1e-6, []
    for sign in (1.0, -1.0):
        there = config.moved_to(config.roller_positions + sign * step * way)
        moved = None if rolling is None else rolling.moved_to(there).grip
        reached.append(barrier.values(there, moved, near.indices))
    slopes = (reached[0] - reached[1]) / (2.0 * step)
    # At a kink a value has two slopes.
    smooth = np.abs(reached[0] + reached[1] - 2.0 * near.values) < 1e-10
    assert smooth.any(), 'all values have kinks here: choose another configuration'
    assert (rows @ way)[smooth] == pytest.approx(slopes[smooth], abs=1e-5), (
        'the derivatives of `active` differ from differences of `values`; node coordinates are in '
        'the order x0, y0, x1, y1, ...'
    )
