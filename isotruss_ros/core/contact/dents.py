# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Depth of the dent of a tube's skin at one contact, as a function of the normal force.

The dent is the deformation of the tube's section by `flattening` while the centre line is fixed.
Its depth is the overlap of the object with the tube's undeformed section. Each point of the skin
presses across the tube, as in `sliding_contact`, so the dent follows from the heights of the
object's surface: under equal forces it is deep at a sharp corner and shallow at a face. The depth
depends only on tube and object, so one table is valid for every grasp. The depth is almost linear
in the 2/3 power of the force, as for a point contact.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
import copy
import functools
import math
from typing import NamedTuple

from isotruss_ros.core.contact.flattening import Flattening, flattening_of
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.numerics.qp import solve_complementarity
import numpy as np
import scipy

#: Depths in the tables [-]: of discs relative to the smaller radius of tube and disc, of corners
#: relative to the tube radius.
DISC_DEPTHS, CORNER_DEPTHS = (0.8 * np.linspace(0.0, 1.0, n)[1:] ** 2 for n in (15, 10))
#: Number of contact points on the chord along which the object overlaps the round tube [-].
CHORD_POINTS = 41
DEPTH_EXPONENT = 2.0 / 3.0
#: Spacing of the points on a corner's outline, and largest extent of the contact to each side of
#: the contact point, in tube radii [-].
OUTLINE_SPACING, MAX_EXTENT = 0.02, 4.0


class PressedSkin(NamedTuple):
    """Points of a tube's skin under an object, and the contact forces on them."""

    places: Array  #: (c,) distances from the contact point along the tube, counter-clockwise [m]
    spacing: float  #: distance between neighbouring points [m]
    heights: Array  #: (c,) heights of the object's surface above the contact point [m]
    forces: Array  #: (c,) contact forces, zero at points that the object does not touch [N]


class DentTable:
    """
    Table of a dent's depth as a function of the normal force, for one tube and one object.

    :param depths: (n,) tabulated depths of the dent, positive and increasing [m].
    :param press: skin under the object as a function of the depth.
    :param kernel: local compliance of the tubes' sections.
    :param tube: index of the tube.
    """

    def __init__(
        self,
        depths: Array,
        press: Callable[[float], PressedSkin],
        kernel: Flattening,
        tube: int,
    ) -> None:
        presses = [press(depth) for depth in depths.tolist()]
        places = np.append(
            0.0, np.array([skin.forces.sum() for skin in presses]) ** DEPTH_EXPONENT
        )
        self._spline = spline = scipy.interpolate.CubicSpline(
            places, np.append(0.0, depths), bc_type='natural'
        )
        # `__call__` evaluates the spline from lists, because for single numbers this is several
        # times faster than calling it.
        self._places: list[float] = places.tolist()
        self._pieces: list[list[float]] = spline.c.T.tolist()
        self._presses, self._kernel, self._tube = presses, kernel, tube
        self._press, self._deepest = press, float(depths[-1])

    def __call__(self, force: float) -> tuple[float, float]:
        """
        Return the dent's depth [m] and its derivative with respect to the force [m/N].

        The depth is extrapolated linearly beyond the table.

        :param force: normal force [N]. For a negative force, which may occur in an iteration, the
            depth is negative.
        """
        piece, x, beyond, per_force = self._locate(force)
        a, b, c, d = self._pieces[piece]
        slope = (3.0 * a * x + 2.0 * b) * x + c
        depth = ((a * x + b) * x + c) * x + d + slope * beyond
        return depth * force / max(abs(force), 1e-9), slope * per_force

    def _locate(self, force: float) -> tuple[int, float, float, float]:
        """
        Locate the 2/3 power of a force in the table.

        :return: index of the interval, position in the interval, excess beyond the end of the
            table, and derivative of the power with respect to the force.
        """
        size = max(abs(force), 1e-9)
        place = size**DEPTH_EXPONENT
        inside = min(place, self._places[-1])
        piece = max(min(bisect_right(self._places, inside), len(self._pieces)) - 1, 0)
        return piece, inside - self._places[piece], place - inside, DEPTH_EXPONENT * place / size

    def press(self, force: float) -> PressedSkin:
        """Return the skin under a normal force [N], at most at the largest depth of the table."""
        skin = self._press(min(self(force)[0], self._deepest))
        return skin._replace(forces=skin.forces * (force / skin.forces.sum()))

    def smooth_near(self, force: float) -> DentTable:
        """
        Return a table without intervals, whose polynomial is that of the interval of a force.

        :param force: normal force [N].
        """
        piece, _, beyond, _ = self._locate(force)
        if beyond > 0.0:
            return self
        found = copy.copy(self)
        found._places, found._pieces = [self._places[piece], math.inf], [self._pieces[piece]]
        return found

    def second_rates(self, force: float) -> tuple[float, float, float]:
        """
        Return the second derivatives of the dent's depth, and its derivative by pressure.

        :param force: normal force [N].
        :return: second derivative with respect to the force [m/N^2]; derivative with respect to
            the tube's gauge pressure [m/Pa]; mixed second derivative [m/(N Pa)].
        """
        size, sign = max(abs(force), 1e-9), math.copysign(1.0, force)
        piece, x, beyond, stretch = self._locate(force)
        place = self._places[piece] + x
        slope, bend = (float(self._spline(place, order)) for order in (1, 2))
        rate, steeper = (float(self._spline_rate(place, order)) for order in (0, 1))
        # The natural spline has no curvature at the ends of the table.
        curve = bend * stretch**2 + slope * stretch * (DEPTH_EXPONENT - 1.0) / size
        return sign * curve, sign * (rate + steeper * beyond), steeper * stretch

    @functools.cached_property
    def _place_rates(self) -> Array:
        """Return the derivatives (n + 1,) of the table's forces^(2/3) with respect to pressure."""
        kernel, tube, rates = self._kernel, self._tube, [0.0]
        for _, spacing, _, forces in self._presses:
            # The sum of q, where C q = -gaps, changes by -l . C' q, where C l = 1.
            closed = np.flatnonzero(forces)
            alike = np.zeros(len(closed), dtype=np.intp)
            dents = kernel.compliance(spacing * closed, alike, alike + tube, spacing)
            by_gaps = np.linalg.solve(dents, np.ones(len(closed)))
            apart = np.abs(closed[:, None] - closed)
            softer = kernel.compliance_rates(len(forces), spacing)[tube][apart]
            lost = float(by_gaps @ softer @ forces[closed])
            rates.append(-DEPTH_EXPONENT * forces.sum() ** (DEPTH_EXPONENT - 1.0) * lost)
        return np.array(rates)

    @functools.cached_property
    def _spline_rate(self) -> scipy.interpolate.PPoly:
        """Return the derivative of the table's spline by pressure, at constant depths."""
        spline, moved = self._spline, self._place_rates
        third = 6.0 * spline.c[0]
        # If a place moves by m, the spline changes by -m times its slope there. The second
        # derivative of this change jumps by -m times the jump of the spline's third derivative.
        jumps = np.append(0.0, -np.diff(third) * moved[1:-1]).cumsum()
        bent = scipy.interpolate.PPoly(jumps[None], spline.x).antiderivative(2)
        values = -spline(spline.x, 1) * moved - bent(spline.x)
        ends = (2, 0.0), (2, -third[-1] * moved[-1] - jumps[-1])
        found = scipy.interpolate.CubicSpline(spline.x, values, bc_type=ends)
        found.c[1:] += bent.c
        return found


class Dents:
    """
    Depths of the dents at k contacts with one object, each as a function of the normal force.

    :param tables: table of each of the k contacts; empty for tubes whose sections stay round.
    :param scale: ratio of the tubes' stiffness to the stiffness for which the tables hold [-].
    """

    def __init__(self, tables: Sequence[DentTable] = (), scale: float = 1.0) -> None:
        self._tables, self._scale = tables, scale

    def __call__(self, forces: Array) -> tuple[Array, Array]:
        """
        Return the dents' depths (k,) [m], and the derivatives (k,) of each by its force [m/N].

        :param forces: (k,) normal forces [N].
        """
        if not self._tables:
            return np.zeros(len(forces)), np.zeros(len(forces))
        pressing = zip(self._tables, forces.tolist(), strict=True)
        found = np.array([table(force / self._scale) for table, force in pressing])
        return found[:, 0], found[:, 1] / self._scale

    def press(self, forces: Array) -> list[PressedSkin]:
        """Return the skin at each contact under positive normal forces (k,) [N]; round: none."""
        pressing = zip(self._tables, forces.tolist(), strict=False)  # no tables: no dents
        pressed = [table.press(force / self._scale) for table, force in pressing]
        return [skin._replace(forces=self._scale * skin.forces) for skin in pressed]

    def smooth_near(self, forces: Array) -> Dents:
        """
        Return smooth depths, equal in the intervals of given forces; differences can cross them.

        :param forces: (k,) normal forces [N].
        """
        pressing = zip(self._tables, forces.tolist(), strict=False)  # no tables: no dents
        tables = [table.smooth_near(force / self._scale) for table, force in pressing]
        return Dents(tables, self._scale)

    def second_rates(self, forces: Array) -> Array:
        """
        Return the second derivatives of the dents' depths, and the derivatives by pressure.

        :param forces: (k,) normal forces [N].
        :return: (3, k) see `DentTable.second_rates`.
        """
        if not self._tables:
            return np.zeros((3, len(forces)))
        pressing = zip(self._tables, forces.tolist(), strict=True)
        found = np.array([table.second_rates(force / self._scale) for table, force in pressing])
        return (found / (self._scale**2, 1.0, self._scale)).T


@functools.lru_cache(maxsize=32)
def disc_dents(
    robot: Mechanism, tube: int, radius: float, pressures: tuple[float, ...] | None = None
) -> DentTable:
    """
    Return the table of the dent of a disc in one tube, cached.

    :param robot: the robot.
    :param tube: index of the tube.
    :param radius: radius of the object [m].
    :param pressures: (t,) gauge pressure of each tube [Pa]; None: as in the robot file.
    """
    depths = DISC_DEPTHS * min(radius, 0.5 * robot.description.tube_diameter)
    kernel = flattening_of(robot, pressures)
    return DentTable(depths, functools.partial(_press_disc, kernel, tube, radius), kernel, tube)


def _press_disc(kernel: Flattening, tube: int, radius: float, depth: float) -> PressedSkin:
    """Return the skin under a disc at a given depth."""
    half = np.sqrt(radius**2 - (radius - depth) ** 2)
    places = half * np.linspace(-1.0, 1.0, CHORD_POINTS)
    heights = radius - np.sqrt(radius**2 - places**2)
    return _press(kernel, tube, places, heights, depth)


def _press(
    kernel: Flattening, tube: int, places: Array, heights: Array, depth: float
) -> PressedSkin:
    """Return the skin whose contact forces close the gaps under an object at a given depth."""
    count, spacing = len(places), float(places[1] - places[0])
    dents = kernel.lattice_compliance(count, tube, spacing)
    forces, _ = solve_complementarity(dents, heights - depth, np.ones(count, dtype=bool))
    return PressedSkin(places, spacing, heights, forces)


@functools.lru_cache(maxsize=256)
def corner_dents(
    robot: Mechanism,
    tube: int,
    shape: Shape,
    angle: float,
    corner: int,
    cuts: tuple[float, float],
    pressures: tuple[float, ...] | None = None,
) -> DentTable:
    """
    Return the table of the dent of a corner or face in one tube, cached.

    :param robot: the robot.
    :param tube: index of the tube.
    :param shape: shape of the object.
    :param angle: direction of the object's outward normal that is perpendicular to the tube, in
        the object's frame [rad]. It is rounded, so that similar contacts share a table.
    :param corner: index of the corner in contact, see `Shape.corner_at`.
    :param cuts: largest extents of the contact along the surface, clockwise and counter-clockwise
        from the contact point [m]: half of the length of a face whose other end is another
        contact, otherwise infinite.
    :param pressures: (t,) gauge pressure of each tube [Pa]; None: as in the robot file.
    """
    radius = 0.5 * robot.description.tube_diameter
    point = shape.point_at(corner, complex(np.exp(1j * angle)))
    places, heights = _profile(shape, angle, point, OUTLINE_SPACING * radius)
    reach = np.minimum(cuts, MAX_EXTENT * radius)
    depths = CORNER_DEPTHS * radius
    kernel = flattening_of(robot, pressures)
    press = functools.partial(_press_corner, kernel, tube, places, heights, reach)
    return DentTable(depths, press, kernel, tube)


@functools.lru_cache(maxsize=16)
def _outline(shape: Shape, spacing: float) -> Points:
    """Return `Shape.outline`, cached."""
    return shape.outline(spacing)


def _profile(shape: Shape, angle: float, point: complex, spacing: float) -> tuple[Array, Array]:
    """Return positions along a tube, counter-clockwise, and the surface's heights there [m]."""
    inward = -np.exp(1j * angle)
    seen = (_outline(shape, spacing) - point) * inward.conjugate()
    # Positions along the tube, counter-clockwise, and heights into the object.
    along, height = -seen.imag, seen.real
    first, last = int(along.argmin()), int(along.argmax())
    count = (last - first) % len(along)
    chain = (first + np.arange(count + 1)) % len(along)
    places, found = along[chain], np.maximum(height[chain], 0.0)
    # The contact point may be between two points of the outline.
    place = int(np.searchsorted(places, 0.0))
    return np.insert(places, place, 0.0), np.insert(found, place, 0.0)


def _press_corner(
    kernel: Flattening, tube: int, places: Array, heights: Array, reach: Array, depth: float
) -> PressedSkin:
    """Return the skin under a corner at a given depth."""
    low = np.flatnonzero(heights <= depth)
    first, last = max(low[0] - 1, 0), min(low[-1] + 1, len(places) - 1)
    # Interpolated positions at which the height of the surface is the depth.
    begin, end = (
        float(np.interp(depth, heights[pair], places[pair]))
        for pair in ([low[0], first], [low[-1], last])
    )
    begin, end = max(begin, -float(reach[0])), min(end, float(reach[1]))
    spacing = max(end - begin, 1e-6) / CHORD_POINTS
    # Each point is in the middle of a piece of tube; the outer pieces end at `begin` and `end`.
    middles = begin + (np.arange(CHORD_POINTS) + 0.5) * spacing
    return _press(kernel, tube, middles, np.interp(middles, places, heights), depth)
