# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Depth of the dent of a tube's skin at one contact, by normal force and angle of the normal.

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
from collections.abc import Callable, Iterator, Sequence
import copy
import functools
import math
from typing import NamedTuple

from isotruss_ros.core.contact.flattening import Flattening
from isotruss_ros.core.contact.pressed_skin import (
    find_profile,
    MAX_EXTENT,
    OUTLINE_SPACING,
    press_corner,
    press_disc,
    PressedSkin,
)
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.tolerances import EPSILON, ROUNDING
import numpy as np
import scipy

DEPTH_EXPONENT = 2.0 / 3.0
#: Depths in the tables [-]: of discs relative to the smaller radius of tube and disc, of corners
#: relative to the tube radius.
DISC_DEPTHS, CORNER_DEPTHS = (0.8 * np.linspace(0.0, 1.0, n) ** 2 for n in (15, 10))
#: Largest step of the angles of normals for which depths are sampled; a divisor of 15 degrees, so
#: that turned and mirrored objects have the same samples [rad]. Between them the depths are
#: interpolated: depths err by up to 1 %, at a third of the step by 0.3 %, and at three times the
#: step by 30 %, all of them where a face is within 0.05 rad of the tube.
ANGLE_STEP = math.radians(15.0) / 16


class Spline:
    """Natural cubic spline through n points, the first at zero; linear beyond the last."""

    def __init__(self, places: Array, values: Array) -> None:
        # It is evaluated from lists, because for single numbers this is several times faster.
        self._places: list[float] = places.tolist()
        spline = scipy.interpolate.CubicSpline(places, values, bc_type='natural')
        self._pieces: list[list[float]] = spline.c.T.tolist()

    def __call__(self, place: float, near: float) -> tuple[float, float]:
        """Return value and slope at abscissa `place` by the polynomial valid at `near`."""
        end = self._places[-1]
        piece = min(bisect_right(self._places, near), len(self._pieces)) - 1
        inside, beyond = (place, 0.0) if near < end else (end, place - end)
        x, (a, b, c, d) = inside - self._places[piece], self._pieces[piece]
        slope = (3.0 * a * x + 2.0 * b) * x + c
        return ((a * x + b) * x + c) * x + d + slope * beyond, slope


class DentSample:
    """Dents at increasing depths (n,) [m], the first zero, for a normal with a given angle."""

    def __init__(
        self, depths: Array, press: Callable[[float], PressedSkin], kernel: Flattening
    ) -> None:
        self._depths, self._kernel = depths, kernel
        self._skins = [press(depth) for depth in depths[1:].tolist()]
        forces = np.array([skin.forces.sum() for skin in self._skins])
        self._places = np.append(0.0, forces) ** DEPTH_EXPONENT
        #: depth [m] by the 2/3 power of the force [N^(2/3)]
        self.depth = Spline(self._places, depths)

    @functools.cached_property
    def inflated(self) -> tuple[Spline, Spline, float]:
        """Return `depth` at a higher and a lower pressure, and the pressures' difference [Pa]."""
        # This step minimises the error of central differences, about step^2 + EPSILON / step.
        step = EPSILON ** (1.0 / 3.0) * self._kernel.pressure.real
        rates = [0.0]
        for _, spacing, _, forces in self._skins:
            # The sum of q, where C q = -gaps, changes by -l . C' q, where C l = 1.
            pressed = np.flatnonzero(forces)
            compliance = self._kernel.compliance(pressed, spacing)
            by_gaps = np.linalg.solve(compliance, np.ones(len(pressed)))
            compliance_rates = self._kernel.compliance_rates(pressed, spacing)
            force_loss = float(by_gaps @ compliance_rates @ forces[pressed])
            rates.append(-DEPTH_EXPONENT * forces.sum() ** (DEPTH_EXPONENT - 1.0) * force_loss)
        change = step * np.array(rates)
        at_more, at_less = (Spline(self._places + sign * change, self._depths) for sign in (1, -1))
        return at_more, at_less, 2.0 * step


class DentTable:
    """
    Depth of the dent of one corner, face or smooth surface of an object in a tube.

    The angle is that of the object's outward normal perpendicular to the tube, in the object's
    frame [rad]. The depths are interpolated between angles by polynomials with continuous
    second derivatives. The contacts at both ends of a face extend to its middle, so forces
    are continuous if an end gains contact; a face shorter than a tube radius has one contact.
    """

    def __init__(self, kernel: Flattening, shape: Shape, corner: int = 0) -> None:
        self._kernel, self._shape, self._corner = kernel, shape, corner
        self._depths = CORNER_DEPTHS * kernel.radius
        if shape.is_round:
            self._depths = DISC_DEPTHS * min(shape.reach, kernel.radius)
        self._outline = shape.outline(OUTLINE_SPACING * kernel.radius)
        self._faces = shape.faces_at(corner)
        if self._faces:
            before, after = (face.normal for face in self._faces)
            self._middle = cmath.phase(before + after)
            self._half = 0.5 * cmath.phase(after / before)
            self._count = math.ceil(self._half / ANGLE_STEP)
        self._samples: dict[int, DentSample] = {}
        #: place and angle of `smooth_near`
        self._near: tuple[float, float] | None = None

    def __call__(self, force: float, angle: float) -> tuple[float, float, float]:
        """Return the depth [m], odd in the force, and derivatives by force and angle [m/rad]."""
        size = max(abs(force), 1e-9)
        place, sign = size**DEPTH_EXPONENT, force / size
        samples, near, weights = self._find_samples(place, angle)
        depths = weights @ [sample.depth(place, near) for sample in samples]
        (depth, by_place), (by_angle, _) = depths.tolist()
        return sign * depth, DEPTH_EXPONENT * place / size * by_place, sign * by_angle

    def pressure_rate(self, force: float, angle: float) -> float:
        """Return the derivative of the depth by the tube's gauge pressure [m/Pa]."""
        place = abs(force) ** DEPTH_EXPONENT
        samples, near, weights = self._find_samples(place, angle)
        rates = [
            (at_more(place, near)[0] - at_less(place, near)[0]) / difference
            for at_more, at_less, difference in (sample.inflated for sample in samples)
        ]
        return math.copysign(1.0, force) * float(weights[0] @ rates)

    def press(self, force: float, angle: float) -> PressedSkin:
        """Return the skin under a normal force [N], at most at the largest depth of the table."""
        depth = min(max(self(force, angle)[0], 0.0), float(self._depths[-1]))
        skin = self._press(angle)(depth)
        total = float(skin.forces.sum())
        return skin._replace(forces=skin.forces * (force / total if total > 0.0 else 0.0))

    def smooth_near(self, force: float, angle: float) -> DentTable:
        """Return a table that uses the polynomials valid at a force [N] and angle everywhere."""
        smooth = copy.copy(self)
        smooth._near = abs(force) ** DEPTH_EXPONENT, angle
        return smooth

    def _find_samples(self, place: float, angle: float) -> tuple[list[DentSample], float, Array]:
        """Return samples nearby, the place of their polynomials, and weights (2, s) with rates."""
        near, nearby = self._near or (place, angle)
        numbers, weights = [0], np.array([[1.0], [0.0]])
        if not self._shape.is_round:
            numbers, weights = self._weigh(angle, nearby)
        for number in numbers:
            if number not in self._samples:
                press = self._press(self._sampled_angle(number))
                self._samples[number] = DentSample(self._depths, press, self._kernel)
        return [self._samples[number] for number in numbers], near, weights

    def _sampled_angle(self, number: int) -> float:
        """Return the angle of the normal in the sample of this number [rad]."""
        if not self._faces:
            return ANGLE_STEP * number
        return self._middle + self._half * math.sin(0.5 * math.pi * number / self._count)

    def _locate(self, angle: float, near: int) -> tuple[float, float]:
        """Return the coordinate of an angle among the numbers of samples, and its derivative."""
        if not self._faces:
            difference = math.remainder(angle - ANGLE_STEP * near, 2.0 * math.pi)
            return near + difference / ANGLE_STEP, 1.0 / ANGLE_STEP
        # Near the normal of a face the depth is almost linear in the root of the angle from it, so
        # the samples are at equal steps of the arc sine. Beyond the face it is constant, and also
        # within rounding of its normal, where the derivative would have any size.
        sine = math.remainder(angle - self._middle, 2.0 * math.pi) / self._half
        sine *= 1.0 + ROUNDING
        sine, quarter = min(max(sine, -1.0), 1.0), 0.5 * math.pi / self._count
        cosine = math.sqrt(1.0 - sine * sine)
        return math.asin(sine) / quarter, cosine and 1.0 / (self._half * cosine * quarter)

    def _weigh(self, angle: float, nearby: float) -> tuple[list[int], Array]:
        """Return the numbers of four samples around an angle `nearby`, and weights (2, 4)."""
        start = math.floor(self._locate(nearby, 0)[0])
        if self._faces:
            start = min(start, self._count - 1)
        place, rate = self._locate(angle, start)
        powers = [(place - start) ** n for n in range(6)]
        rates = [0.0, *(rate * n * power for n, power in enumerate(powers[:-1], start=1))]
        # Quintic polynomials, with the first and second central differences at both samples.
        columns = [[0, -1, 1, 3, -5, 2], [2, 0, -2, -9, 15, -6]]
        columns += [[0, 1, 1, 9, -15, 6], [0, 0, 0, -3, 5, -2]]
        weights = 0.5 * np.array([powers, rates]) @ np.array(columns).T
        numbers = [start + i for i in (-1, 0, 1, 2)]
        if self._faces:  # samples beyond the faces are extrapolated
            if start == -self._count:
                weights[:, 1:] += np.outer(weights[:, 0], [3.0, -3.0, 1.0])
                weights[:, 0] = 0.0
            if start == self._count - 1:
                weights[:, :-1] += np.outer(weights[:, -1], [1.0, -3.0, 3.0])
                weights[:, -1] = 0.0
            numbers = [min(max(number, -self._count), self._count) for number in numbers]
        return numbers, weights

    def _press(self, angle: float) -> Callable[[float], PressedSkin]:
        """Return a function that gives the skin at a depth [m] for a normal with this angle."""
        kernel, shape, normal = self._kernel, self._shape, cmath.rect(1.0, angle)
        if shape.is_round:
            return functools.partial(press_disc, kernel, shape.reach)
        profile = find_profile(self._outline, shape.point_at(self._corner, normal), normal)
        reach = np.full(2, MAX_EXTENT * kernel.radius)
        for side, face in enumerate(self._faces):
            if face.length >= kernel.radius:
                reach[side] = min(reach[side], 0.5 * face.length)
        return functools.partial(press_corner, kernel, *profile, reach)


#: Returns a `DentTable`, cached.
dent_table = functools.lru_cache(maxsize=256)(DentTable)


class Dents(NamedTuple):
    """Depths of the dents at k contacts with one object."""

    tables: Sequence[DentTable]
    scale: float  #: ratio of the tubes' stiffness to that of the tables [-]

    def __call__(self, forces: Array, angles: Array) -> tuple[Array, Array, Array]:
        """Return the depths (k,) [m], and their derivatives by forces [m/N] and angles [m/rad]."""
        depths, softs, tilts = np.array([table(*at) for table, *at in self._at(forces, angles)]).T
        return depths, softs / self.scale, tilts

    def press(self, forces: Array, angles: Array) -> list[PressedSkin]:
        """Return the skin at each contact under positive normal forces (k,) [N]."""
        pressed = [table.press(*at) for table, *at in self._at(forces, angles)]
        return [skin._replace(forces=self.scale * skin.forces) for skin in pressed]

    def smooth_near(self, forces: Array, angles: Array) -> Dents:
        """Return the dents with smooth tables, see `DentTable.smooth_near`; forces (k,) [N]."""
        tables = [table.smooth_near(*at) for table, *at in self._at(forces, angles)]
        return self._replace(tables=tables)

    def pressure_rates(self, forces: Array, angles: Array) -> Array:
        """Return the derivatives (k,) of the depths by the tubes' gauge pressures [m/Pa]."""
        return np.array([table.pressure_rate(*at) for table, *at in self._at(forces, angles)])

    def _at(self, forces: Array, angles: Array) -> Iterator[tuple[DentTable, float, float]]:
        """Yield table, force divided by the stiffness factor [N], and angle of each contact."""
        return zip(self.tables, (forces / self.scale).tolist(), angles.tolist(), strict=True)
