# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of the vertices and corner radii of a convex polygon."""

from __future__ import annotations

from collections.abc import Sequence

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.model.pose import check_range, MAX_SIZE, MIN_DIAMETER
from isotruss_ros.core.model.units import likely_unit
from isotruss_ros.core.numerics.arrays import Array, finite_array, MAX_ENTRIES, Points
from isotruss_ros.core.numerics.tolerances import ROUNDING
import numpy as np


def check_outline(vertices: object, corner_radius: object) -> tuple[Points, Array]:
    """Return the vertices (k,) x + iy and corner radii (k,) of a `Polygon`, checked [m]."""
    corners = _validate_vertices(vertices)
    radii = _validate_radii(corner_radius, len(corners))
    _check_convex(corners)
    _check_fit(corners, radii)
    return corners, radii


def polygon_moments(corners: Points) -> tuple[float, complex, float]:
    """Return the integrals of 1, z = x + iy and |z|^2 over a polygon, negated if clockwise."""
    ends = np.roll(corners, -1)
    cross = (corners.conj() * ends).imag
    squares = np.abs(corners) ** 2 + np.abs(ends) ** 2 + (corners * ends.conj()).real
    first_moment = (cross * (corners + ends)).sum() / 6.0
    return float(0.5 * cross.sum()), complex(first_moment), float((cross * squares).sum() / 12.0)


def _validate_vertices(vertices: object) -> Points:
    """Return the vertices as an array (k,) x + iy [m]."""
    try:
        count = len(vertices)  # type: ignore[arg-type]
    except TypeError:
        raise GraspError(f'vertices {vertices!r}: must be a list of [x, y] [m]') from None
    if not 3 <= count <= MAX_ENTRIES:
        raise GraspError(
            f'a polygon of {count} vertices: must have at least 3 and at most {MAX_ENTRIES}'
        )
    corners = np.empty(count, dtype=np.complex128)
    for i, vertex in enumerate(vertices):  # type: ignore[arg-type, var-annotated]
        x, y = finite_array(vertex, 2, f'vertex {i + 1} (x, y) [m]', GraspError)
        distance = float(max(abs(x), abs(y)))
        if distance > MAX_SIZE:
            hint = likely_unit(distance, 'm', MIN_DIAMETER, MAX_SIZE)
            raise GraspError(
                f'vertex {i + 1} ({x:g}, {y:g}) m: must be within '
                f'{MAX_SIZE:g} m of the origin{hint}'
            )
        corners[i] = complex(x, y)
    # Other programs close an outline by a repeated first vertex.
    return corners[:-1] if count > 3 and corners[0] == corners[-1] else corners


def _validate_radii(radius: object, count: int) -> Array:
    """Return the corner radii at the vertices as an array (k,) [m]."""
    if isinstance(radius, Sequence) and not isinstance(radius, str):
        radii = finite_array(radius, count, 'corner_radius [m], one for each vertex', GraspError)
    else:
        radii = np.repeat(finite_array([radius], 1, 'corner_radius [m]', GraspError), count)
    for value in radii.tolist():
        check_range(value, 'corner_radius', 'm', 0.0, MAX_SIZE)
    return radii


def _vertex(corners: Points, i: int) -> str:
    return f'vertex {i + 1} ({corners[i].real:g}, {corners[i].imag:g}) m'


def _check_convex(corners: Points) -> None:
    """Raise GraspError if the polygon is not convex."""
    # Vertices that coincide.
    sides = np.roll(corners, -1) - corners
    lengths = np.abs(sides)
    shortest = int(lengths.argmin())
    if lengths[shortest] < MIN_DIAMETER:
        raise GraspError(
            f'{_vertex(corners, shortest)}: the next vertex has the same position; the '
            f'distance must be at least {MIN_DIAMETER:g} m'
        )

    # Sides on one line.
    turns = np.angle(sides * np.roll(sides, 1).conj())
    abs_sines = np.abs(np.sin(turns))
    straightest = int(abs_sines.argmin())
    if abs_sines[straightest] < ROUNDING:
        raise GraspError(
            f'{_vertex(corners, straightest)}: on one line with its neighbours; remove it, or '
            'move it so that the outline is convex'
        )

    # Exterior angles of different signs.
    total_turn = float(turns.sum())
    concave = np.flatnonzero(turns * total_turn < 0.0)
    # An outline that winds more than once crosses itself, though all turns have one sign.
    winds_once = 1.0 < abs(total_turn) < 3.0 * np.pi
    if len(concave) or not winds_once:
        culprit = int(concave[0]) if len(concave) else 0
        raise GraspError(
            f'{_vertex(corners, culprit)}: the polygon is concave there, or its sides cross each '
            'other; must be convex: list the vertices in their order around the polygon, remove '
            'this vertex, or divide the object'
        )
    area = abs(polygon_moments(corners - corners[0])[0])
    if area < MIN_DIAMETER**2:
        raise GraspError(
            f'a polygon of area {area:g} m^2: must be {MIN_DIAMETER**2:g} m^2 or more'
        )


def _check_fit(corners: Points, radii: Array) -> None:
    """Raise GraspError if the arcs at both ends of a side do not fit on the side."""
    sides = np.roll(corners, -1) - corners
    lengths = np.abs(sides)
    turns = np.abs(np.angle(sides * np.roll(sides, 1).conj()))
    tangent_lengths = radii * np.tan(0.5 * turns)  # between a vertex and an end of its arc
    required = tangent_lengths + np.roll(tangent_lengths, -1)
    i = int((lengths - required).argmin())
    # Arcs may take all of a side, up to rounding.
    if required[i] > (1.0 + ROUNDING) * lengths[i]:
        raise GraspError(
            f'corner_radius {radii[i]:g} m does not fit: the side of {lengths[i]:g} m that '
            f'begins at {_vertex(corners, i)} must be at least {required[i]:g} m long for its '
            'two arcs; use a smaller radius'
        )
