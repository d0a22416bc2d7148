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
from isotruss_ros.core.numerics.work_limit import count_work
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
    """Natural cubic spline through n points, linear beyond the last; the first abscissa is 0."""

    def __init__(self, abscissae: Array, values: Array) -> None:
        # It is evaluated from lists, because for single numbers this is several times faster.
        self._abscissae: list[float] = abscissae.tolist()
        spline = scipy.interpolate.CubicSpline(abscissae, values, bc_type='natural')
        self._pieces: list[list[float]] = spline.c.T.tolist()

    def __call__(self, x: float, x_of_piece: float) -> tuple[float, float]:
        """Return value and slope at x, by the polynomial piece that contains `x_of_piece`."""
        end = self._abscissae[-1]
        piece = min(bisect_right(self._abscissae, x_of_piece), len(self._pieces)) - 1
        inside, beyond = (x, 0.0) if x_of_piece < end else (end, x - end)
        s, (a, b, c, d) = inside - self._abscissae[piece], self._pieces[piece]
        slope = (3.0 * a * s + 2.0 * b) * s + c
        return ((a * s + b) * s + c) * s + d + slope * beyond, slope


class DentSample:
    """Depths and forces of n dents for one angle of the object's normal."""

    def __init__(
        self, depths: Array, skin_at: Callable[[float], PressedSkin], kernel: Flattening
    ) -> None:
        self._depths, self._kernel = depths, kernel
        self._skins = [skin_at(depth) for depth in depths[1:].tolist()]  # the first depth is 0
        forces = np.array([skin.forces.sum() for skin in self._skins])
        self._abscissae = np.append(0.0, forces) ** DEPTH_EXPONENT
        #: depth [m] by the 2/3 power of the force [N^(2/3)]
        self.depth = Spline(self._abscissae, depths)

    @functools.cached_property
    def inflated(self) -> tuple[Spline, Spline, float]:
        """Return `depth` at a higher and a lower pressure, and the pressures' difference [Pa]."""
        # This step minimises the error of central differences, about step^2 + EPSILON / step.
        step = EPSILON ** (1.0 / 3.0) * self._kernel.pressure.real
        abscissa_rates = [0.0]
        for _, spacing, _, forces in self._skins:
            # The forces q solve C q = -gaps with constant gaps. With the pressure, their sum
            # changes by -l . C' q, where C' is the derivative of C, and `sum_by_gaps` l solves
            # C l = 1.
            pressed = np.flatnonzero(forces)
            compliance = self._kernel.compliance(pressed, spacing)
            sum_by_gaps = np.linalg.solve(compliance, np.ones(len(pressed)))
            compliance_rates = self._kernel.compliance_rates(pressed, spacing)
            force_rate = -float(sum_by_gaps @ compliance_rates @ forces[pressed])
            abscissa_by_force = DEPTH_EXPONENT * forces.sum() ** (DEPTH_EXPONENT - 1.0)
            abscissa_rates.append(abscissa_by_force * force_rate)
        change = step * np.array(abscissa_rates)
        higher = Spline(self._abscissae + change, self._depths)
        lower = Spline(self._abscissae - change, self._depths)
        return higher, lower, 2.0 * step


class DentTable:
    """
    Depth of the dent of one corner, face or smooth surface of an object in a tube.

    The angle is that of the object's outward normal perpendicular to the tube, in the object's
    frame [rad]. The depths are interpolated between angles by polynomials with continuous
    second derivatives. The contacts at both ends of a face extend to its middle, so forces
    are continuous if an end gains contact; a face shorter than a tube radius has one contact.

    Samples have integer numbers in the order of their angles: for a smooth surface from the angle
    0 on, for a corner from -n at the normal of the face before it to n at that of the face after
    it.
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
            self._middle_angle = cmath.phase(before + after)
            self._half_turn = 0.5 * cmath.phase(after / before)
            self._last_number = math.ceil(self._half_turn / ANGLE_STEP)
        self._samples: dict[int, DentSample] = {}
        #: 2/3 power of the force and angle whose polynomials are used; None: those of the argument
        self._polynomial_at: tuple[float, float] | None = None

    def __call__(self, force: float, angle: float) -> tuple[float, float, float]:
        """Return the depth [m], odd in the force, and derivatives by force and angle [m/rad]."""
        size = max(abs(force), 1e-9)
        abscissa, sign = size**DEPTH_EXPONENT, force / size
        samples, piece_abscissa, weights = self._samples_at(abscissa, angle)
        depths = weights @ [sample.depth(abscissa, piece_abscissa) for sample in samples]
        (depth, by_abscissa), (by_angle, _) = depths.tolist()
        return sign * depth, DEPTH_EXPONENT * abscissa / size * by_abscissa, sign * by_angle

    def pressure_rate(self, force: float, angle: float) -> float:
        """Return the derivative of the depth by the tube's gauge pressure [m/Pa]."""
        abscissa = abs(force) ** DEPTH_EXPONENT
        samples, piece_abscissa, weights = self._samples_at(abscissa, angle)
        rates = [
            (higher(abscissa, piece_abscissa)[0] - lower(abscissa, piece_abscissa)[0]) / difference
            for higher, lower, difference in (sample.inflated for sample in samples)
        ]
        return math.copysign(1.0, force) * float(weights[0] @ rates)

    def press(self, force: float, angle: float) -> PressedSkin:
        """Return the pressed skin under a normal force [N], at most as deep as the table."""
        depth = min(max(self(force, angle)[0], 0.0), float(self._depths[-1]))
        skin = self._skin_by_depth(angle)(depth)
        total = float(skin.forces.sum())
        return skin._replace(forces=skin.forces * (force / total if total > 0.0 else 0.0))

    def smooth_near(self, force: float, angle: float) -> DentTable:
        """Return a table that interpolates with the polynomial near one force [N] and angle."""
        smooth = copy.copy(self)
        smooth._polynomial_at = abs(force) ** DEPTH_EXPONENT, angle
        return smooth

    def _samples_at(self, abscissa: float, angle: float) -> tuple[list[DentSample], float, Array]:
        """Return s samples, the abscissa that selects a piece of them, and weights (2, s)."""
        piece_abscissa, polynomial_angle = self._polynomial_at or (abscissa, angle)
        numbers, weights = [0], np.array([[1.0], [0.0]])  # of a disc
        if not self._shape.is_round:
            numbers, weights = self._weigh(angle, polynomial_angle)
        for number in numbers:
            if number not in self._samples:
                count_work(is_stored=True)
                skin_at = self._skin_by_depth(self._sampled_angle(number))
                self._samples[number] = DentSample(self._depths, skin_at, self._kernel)
        return [self._samples[number] for number in numbers], piece_abscissa, weights

    def _sampled_angle(self, number: int) -> float:
        """Return the angle of the normal in the sample of this number [rad]."""
        if not self._faces:
            return ANGLE_STEP * number
        sine = math.sin(0.5 * math.pi * number / self._last_number)
        return self._middle_angle + self._half_turn * sine

    def _fractional_number(self, angle: float, turn_of: int) -> tuple[float, float]:
        """Return an angle as a fractional sample number in the turn of a sample, and the slope."""
        if not self._faces:
            difference = math.remainder(angle - ANGLE_STEP * turn_of, 2.0 * math.pi)
            return turn_of + difference / ANGLE_STEP, 1.0 / ANGLE_STEP
        # Near the normal of a face the depth is almost linear in the root of the angle from it, so
        # the samples are at equal steps of the arc sine. Beyond the face it is constant, and also
        # within rounding of its normal, where the derivative would have any size.
        sine = math.remainder(angle - self._middle_angle, 2.0 * math.pi) / self._half_turn
        sine = min(max(sine * (1.0 + ROUNDING), -1.0), 1.0)
        cosine, step = math.sqrt(1.0 - sine * sine), 0.5 * math.pi / self._last_number
        derivative = 1.0 / (self._half_turn * cosine * step) if cosine else 0.0
        return math.asin(sine) / step, derivative

    def _weigh(self, angle: float, polynomial_angle: float) -> tuple[list[int], Array]:
        """Return four samples' numbers, and their weights (2, 4) at an angle, with derivatives."""
        # The polynomial interpolates the two samples before and the two after its own angle; the
        # second of the four has the number `base`. It is evaluated at `angle`, which may differ.
        base = math.floor(self._fractional_number(polynomial_angle, 0)[0])
        if self._faces:
            base = min(base, self._last_number - 1)
        number, rate = self._fractional_number(angle, base)
        x = number - base  # 0 at the second sample, 1 at the third
        powers = [x**n for n in range(6)]
        power_rates = [0.0, *(rate * n * power for n, power in enumerate(powers[:-1], start=1))]
        # Quintic polynomials, with the first and second central differences at both samples: for
        # each sample, twice the coefficients of the powers.
        coefficients = [[0, -1, 1, 3, -5, 2], [2, 0, -2, -9, 15, -6]]
        coefficients += [[0, 1, 1, 9, -15, 6], [0, 0, 0, -3, 5, -2]]
        weights = 0.5 * np.array([powers, power_rates]) @ np.array(coefficients).T
        numbers = [base + i for i in (-1, 0, 1, 2)]
        if self._faces:
            # Instead of a sample beyond a face, its depth d is extrapolated by a parabola through
            # the other three: d_0 = 3 d_1 - 3 d_2 + d_3.
            if base == -self._last_number:
                weights[:, 1:] += np.outer(weights[:, 0], [3.0, -3.0, 1.0])
                weights[:, 0] = 0.0
            if base == self._last_number - 1:
                weights[:, :-1] += np.outer(weights[:, -1], [1.0, -3.0, 3.0])
                weights[:, -1] = 0.0
            numbers = [min(max(n, -self._last_number), self._last_number) for n in numbers]
        return numbers, weights

    def _skin_by_depth(self, angle: float) -> Callable[[float], PressedSkin]:
        """Return a function of the depth [m] that returns the pressed skin, for one angle."""
        kernel, shape, normal = self._kernel, self._shape, cmath.rect(1.0, angle)
        if shape.is_round:
            return functools.partial(press_disc, kernel, shape.reach)
        profile = find_profile(self._outline, shape.point_at(self._corner, normal), normal)
        # Both ends of a long face have contacts, which extend to its middle.
        extents = np.full(2, MAX_EXTENT * kernel.radius)
        for side, face in enumerate(self._faces):
            if face.length >= kernel.radius:
                extents[side] = min(extents[side], 0.5 * face.length)
        return functools.partial(press_corner, kernel, *profile, extents)


#: Returns a `DentTable`, cached.
dent_table = functools.lru_cache(maxsize=256)(DentTable)


class Dents(NamedTuple):
    """Depths of the dents at k contacts with one object."""

    tables: Sequence[DentTable]

    def __call__(self, forces: Array, angles: Array) -> tuple[Array, Array, Array]:
        """Return the depths (k,) [m], and their derivatives by forces [m/N] and angles [m/rad]."""
        rows = [table(force, angle) for table, force, angle in self._contacts(forces, angles)]
        depths, by_force, by_angle = np.array(rows).T
        return depths, by_force, by_angle

    def press(self, forces: Array, angles: Array) -> list[PressedSkin]:
        """Return the pressed skin at each contact under positive normal forces (k,) [N]."""
        return [table.press(*at) for table, *at in self._contacts(forces, angles)]

    def smooth_near(self, forces: Array, angles: Array) -> Dents:
        """Return dents interpolated with the polynomials near given forces (k,) [N] and angles."""
        tables = [table.smooth_near(*at) for table, *at in self._contacts(forces, angles)]
        return Dents(tables)

    def pressure_rates(self, forces: Array, angles: Array) -> Array:
        """Return the derivatives (k,) of the depths by the tubes' gauge pressures [m/Pa]."""
        rates = [table.pressure_rate(*at) for table, *at in self._contacts(forces, angles)]
        return np.array(rates)

    def _contacts(self, forces: Array, angles: Array) -> Iterator[tuple[DentTable, float, float]]:
        """Yield table, force [N] and angle of each contact."""
        return zip(self.tables, forces.tolist(), angles.tolist(), strict=True)
