# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Depth of the dent of a tube's skin at one contact, as a function of the normal force.

The dent is the deformation of the tube's section by `flattening` while the centre line is fixed.
Its depth is the overlap of the object with the tube's undeformed section. Each point of the skin
presses across the tube, see `pressed_skin`, so the dent follows from the heights of the object's
surface: under equal forces it is deep at a sharp corner and shallow at a face. The depth
depends only on tube and object, so one table is valid for every grasp. The depth is almost linear
in the 2/3 power of the force, as for a point contact.
"""

from __future__ import annotations

from bisect import bisect_right
import cmath
from collections.abc import Callable, Sequence
import copy
import functools
import math

from isotruss_ros.core.contact.flattening import Flattening
from isotruss_ros.core.contact.pressed_skin import (
    DentSamples,
    DEPTH_EXPONENT,
    find_profile,
    MAX_EXTENT,
    OUTLINE_SPACING,
    press_corner,
    press_disc,
    PressedSkin,
)
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array
import numpy as np
from numpy.typing import ArrayLike
import scipy

#: Depths in the tables [-]: of discs relative to the smaller radius of tube and disc, of corners
#: relative to the tube radius.
DISC_DEPTHS, CORNER_DEPTHS = (0.8 * np.linspace(0.0, 1.0, n)[1:] ** 2 for n in (15, 10))
#: Largest step of the angles of normals for which forces are sampled; a divisor of 15 degrees, so
#: that turned and mirrored objects have the same samples [rad]. Between them the forces are
#: interpolated: depths err by up to 1 %, at a third of the step by 0.3 %, and at three times the
#: step by 30 %, all of them where a face is within 0.05 rad of the tube.
ANGLE_STEP = math.radians(15.0) / 16


class DentTable:
    """
    Table of a dent's depth as a function of the normal force, for one tube and one object.

    The depths are increasing [m]. `turning` are the derivatives of the samples' weights by the
    angle of the normal [1/rad].
    """

    def __init__(
        self,
        depths: Array,
        samples: Sequence[DentSamples],
        press: Callable[[float], PressedSkin],
        weights: ArrayLike = (1.0,),
        turning: ArrayLike = (0.0,),
    ) -> None:
        self._samples, self._weights, self._turning = samples, weights, turning
        abscissae = np.asarray(weights) @ [sample.places for sample in samples]
        self._spline = scipy.interpolate.CubicSpline(
            abscissae, np.append(0.0, depths), bc_type='natural'
        )
        # The splines are evaluated from lists, because for single numbers this is several times
        # faster than calling them.
        self._places: list[float] = abscissae.tolist()
        self._pieces: list[list[float]] = self._spline.c.T.tolist()
        self._press, self._deepest = press, float(depths[-1])

    def __call__(self, force: float) -> tuple[float, float]:
        """
        Return the dent's depth [m] and its derivative with respect to the force [m/N].

        It is extrapolated linearly, and negative for negative forces in an iteration.
        """
        piece, x, beyond, per_force = self._locate(force)
        depth, slope = _evaluate(self._pieces[piece], x)
        return (depth + slope * beyond) * force / max(abs(force), 1e-9), slope * per_force

    def _locate(self, force: float) -> tuple[int, float, float, float]:
        """
        Locate the 2/3 power of a force in the table, and differentiate it by the force.

        The place is an interval, the position in it, and the excess beyond the end of the table.
        """
        size = max(abs(force), 1e-9)
        place = size**DEPTH_EXPONENT
        inside = min(place, self._places[-1])
        piece = max(min(bisect_right(self._places, inside), len(self._pieces)) - 1, 0)
        return piece, inside - self._places[piece], place - inside, DEPTH_EXPONENT * place / size

    def press(self, force: float) -> PressedSkin:
        """Return the skin under a normal force [N], at most at the largest depth of the table."""
        skin = self._press(min(max(self(force)[0], 0.0), self._deepest))
        total = float(skin.forces.sum())
        return skin._replace(forces=skin.forces * (force / total if total > 0.0 else 0.0))

    def smooth_near(self, force: float) -> DentTable:
        """Return the table with one polynomial for all forces, that at a given force [N]."""
        piece, _, beyond, _ = self._locate(force)
        if beyond > 0.0:
            return self
        smooth = copy.copy(self)
        smooth._places, smooth._pieces = [self._places[piece], math.inf], [self._pieces[piece]]
        smooth._by_pressure = [self._by_pressure[piece]]
        smooth._by_angle = [self._by_angle[piece]]
        return smooth

    def rates(self, force: float) -> tuple[float, float]:
        """Return the depth's derivatives by gauge pressure [m/Pa] and normal's angle [m/rad]."""
        piece, x, beyond, _ = self._locate(force)
        blown, by_blown = _evaluate(self._by_pressure[piece], x)
        turned, by_turned = _evaluate(self._by_angle[piece], x)
        sign = math.copysign(1.0, force)
        return sign * (blown + by_blown * beyond), sign * (turned + by_turned * beyond)

    @functools.cached_property
    def _by_pressure(self) -> list[list[float]]:
        """Return the polynomials of the depth's derivative by pressure, at constant force."""
        rates = [sample.pressure_rates for sample in self._samples]
        return self._moved_pieces(np.asarray(self._weights) @ rates)

    @functools.cached_property
    def _by_angle(self) -> list[list[float]]:
        """Return the polynomials of the depth's derivative by the angle, at constant force."""
        abscissae = [sample.places for sample in self._samples]
        return self._moved_pieces(np.asarray(self._turning) @ abscissae)

    def _moved_pieces(self, moved: Array) -> list[list[float]]:
        """Return the spline's derivative for given derivatives (n + 1,) of its knots."""
        spline = self._spline
        third = 6.0 * spline.c[0]
        # If a place moves by m, the spline changes by -m times its slope there. The second
        # derivative of this change jumps by -m times the jump of the spline's third derivative.
        jumps = np.append(0.0, -np.diff(third) * moved[1:-1]).cumsum()
        bent = scipy.interpolate.PPoly(jumps[None], spline.x).antiderivative(2)
        values = -spline(spline.x, 1) * moved - bent(spline.x)
        ends = (2, 0.0), (2, -third[-1] * moved[-1] - jumps[-1])
        change = scipy.interpolate.CubicSpline(spline.x, values, bc_type=ends)
        change.c[1:] += bent.c
        return change.c.T.tolist()


def _evaluate(piece: list[float], x: float) -> tuple[float, float]:
    """Return a cubic polynomial and its derivative."""
    a, b, c, d = piece
    return ((a * x + b) * x + c) * x + d, (3.0 * a * x + 2.0 * b) * x + c


class Dents:
    """
    Depths of the dents at k contacts with one object, each as a function of the normal force.

    `scale` is the ratio of the tubes' stiffness to that of the tables [-].
    """

    def __init__(self, tables: Sequence[DentTable], scale: float) -> None:
        self._tables, self._scale = tables, scale

    def __call__(self, forces: Array) -> tuple[Array, Array]:
        """Return the dents' depths (k,) [m], and their derivatives (k,) by the forces [m/N]."""
        pressing = zip(self._tables, forces.tolist(), strict=True)
        depths_and_slopes = np.array([table(force / self._scale) for table, force in pressing])
        return depths_and_slopes[:, 0], depths_and_slopes[:, 1] / self._scale

    def press(self, forces: Array) -> list[PressedSkin]:
        """Return the skin at each contact under positive normal forces (k,) [N]."""
        pressing = zip(self._tables, forces.tolist(), strict=True)
        pressed = [table.press(force / self._scale) for table, force in pressing]
        return [skin._replace(forces=self._scale * skin.forces) for skin in pressed]

    def smooth_near(self, forces: Array) -> Dents:
        """Return the depths with one polynomial at each contact, that at a given force [N]."""
        pressing = zip(self._tables, forces.tolist(), strict=True)
        tables = [table.smooth_near(force / self._scale) for table, force in pressing]
        return Dents(tables, self._scale)

    def rates(self, forces: Array) -> Array:
        """Return the depths' derivatives (2, k) by pressure and angle, see `DentTable.rates`."""
        pressing = zip(self._tables, forces.tolist(), strict=True)
        return np.array([table.rates(force / self._scale) for table, force in pressing]).T


@functools.lru_cache(maxsize=32)
def disc_dents(kernel: Flattening, radius: float) -> DentTable:
    """Return the table of the dent of a disc with a given radius [m] in a tube, cached."""
    depths = DISC_DEPTHS * min(radius, kernel.radius)
    press = functools.partial(press_disc, kernel, radius)
    return DentTable(depths, [DentSamples(depths, press, kernel)], press)


@functools.lru_cache(maxsize=256)
def corner_dents(
    kernel: Flattening, shape: Shape, angle: float, corner: int, cuts: tuple[float, float]
) -> DentTable:
    """
    Return the table of the dent of a corner or face in a tube, cached.

    The forces are interpolated between neighbouring angles by cubic polynomials, so their
    derivatives are continuous. The angle is that of the object's outward normal perpendicular to
    the tube, in the object's frame [rad]. The cuts are the largest extents of the contact along
    the surface, clockwise and counter-clockwise from the contact point [m]: half of the length of
    a face whose other end is another contact, otherwise infinite.
    """
    angles, weights = _weigh_angles(shape, corner, angle)
    samples = [_sample_corner(kernel, shape, near, corner, cuts) for near in angles]
    press = _corner_press(kernel, shape, angle, corner, cuts)
    return DentTable(CORNER_DEPTHS * kernel.radius, samples, press, *weights.T)


def _weigh_angles(shape: Shape, corner: int, angle: float) -> tuple[list[float], Array]:
    """Return the four sampled angles nearby, and their weights with derivatives by the angle."""
    faces = shape.faces_at(corner)
    if faces:
        # Near the normal of a face the depth is almost linear in the root of the angle from it,
        # so the samples are at equal steps of the arc sine. Beyond the face it is constant.
        before, after = (face.normal for face in faces)
        middle, half = cmath.phase(before + after), 0.5 * cmath.phase(after / before)
        count = math.ceil(half / ANGLE_STEP)
        sine = min(max(math.remainder(angle - middle, 2.0 * math.pi) / half, -1.0), 1.0)
        cosine, quarter = math.sqrt(1.0 - sine * sine), 0.5 * math.pi / count
        place, rate = math.asin(sine) / quarter, cosine and 1.0 / (half * cosine * quarter)
        first = min(math.floor(place), count - 1)
    else:
        place, rate = angle / ANGLE_STEP, 1.0 / ANGLE_STEP
        first = math.floor(place)
    t = place - first
    powers, rates = np.array([1.0, t, t * t, t**3]), np.array([0.0, 1.0, 2.0 * t, 3.0 * t * t])
    # Cubic interpolation of Catmull and Rom.
    weights = np.array([[0, -1, 2, -1], [2, 0, -5, 3], [0, 1, 4, -3], [0, 0, -1, 1]])
    weights = 0.5 * weights @ np.column_stack([powers, rate * rates])
    if not faces:
        return [ANGLE_STEP * (first + i) for i in (-1, 0, 1, 2)], weights
    # Samples beyond the faces are extrapolated.
    if first == -count:
        weights[1:] += np.outer([3.0, -3.0, 1.0], weights[0])
        weights[0] = 0.0
    if first == count - 1:
        weights[:-1] += np.outer([1.0, -3.0, 3.0], weights[-1])
        weights[-1] = 0.0
    numbers = [min(max(first + i, -count), count) for i in (-1, 0, 1, 2)]
    return [middle + half * math.sin(number * quarter) for number in numbers], weights


@functools.lru_cache(maxsize=512)
def _sample_corner(
    kernel: Flattening, shape: Shape, angle: float, corner: int, cuts: tuple[float, float]
) -> DentSamples:
    """Return the forces at the depths of the table for one angle, cached; see `corner_dents`."""
    press = _corner_press(kernel, shape, angle, corner, cuts)
    return DentSamples(CORNER_DEPTHS * kernel.radius, press, kernel)


def _corner_press(
    kernel: Flattening, shape: Shape, angle: float, corner: int, cuts: tuple[float, float]
) -> Callable[[float], PressedSkin]:
    """Return the skin under a corner as a function of the depth; see `corner_dents`."""
    positions, heights = find_profile(shape, angle, corner, OUTLINE_SPACING * kernel.radius)
    reach = np.minimum(cuts, MAX_EXTENT * kernel.radius)
    return functools.partial(press_corner, kernel, positions, heights, reach)
