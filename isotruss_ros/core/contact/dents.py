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

import cmath
from collections.abc import Callable, Sequence
import functools
import math
from typing import Any

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
from isotruss_ros.core.numerics.arrays import Array, Indices
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
#: Quintic polynomials by which four samples are interpolated, with the first and second central
#: differences at both middle ones: for each sample, the coefficients of the powers.
WEIGHTS = 0.5 * np.array(
    [
        [0.0, -1.0, 1.0, 3.0, -5.0, 2.0],
        [2.0, 0.0, -2.0, -9.0, 15.0, -6.0],
        [0.0, 1.0, 1.0, 9.0, -15.0, 6.0],
        [0.0, 0.0, 0.0, -3.0, 5.0, -2.0],
    ]
)


class Spline:
    """Natural cubic spline through n points, linear beyond the last; the first abscissa is 0."""

    def __init__(self, abscissae: Array, values: Array) -> None:
        pieces = scipy.interpolate.CubicSpline(abscissae, values, bc_type='natural').c.T
        #: abscissae of all points but the first, and then, for each of the n - 1 pieces, the
        #: coefficients of its polynomial and its first abscissa
        self.numbers = np.append(abscissae[1:], np.column_stack([pieces, abscissae[:-1]]))

    def __call__(self, x: float, x_of_piece: float) -> float:
        """Return the value at x, see `evaluate_splines`."""
        at = np.array([x]), np.array([x_of_piece])
        return evaluate_splines(self.numbers[None, None], *at)[0].item()


def evaluate_splines(numbers: Array, x: Array, x_of_piece: Array) -> tuple[Array, Array]:
    """
    Return values and slopes (c, m) at x (c,), of m splines each with `Spline.numbers` (c, m, q).

    They are those of the polynomial piece that contains `x_of_piece` (c,).
    """
    size, x, x_of_piece = numbers.shape[-1], x[:, None], x_of_piece[:, None]
    count = size // 6
    ends = numbers[..., count - 1]
    piece = (numbers[..., : count - 1] <= x_of_piece[..., None]).sum(axis=-1)
    begins = (count + size * np.arange(piece.size)).reshape(piece.shape) + 5 * piece
    a, b, c, d, begin = numbers.take(begins + np.arange(5).reshape(-1, *[1] * piece.ndim))
    inside = np.where(x_of_piece < ends, x, ends)
    s = inside - begin
    slope = (3.0 * a * s + 2.0 * b) * s + c
    return ((a * s + b) * s + c) * s + d + slope * (x - inside), slope


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
    second derivatives, see `Dents`. The contacts at both ends of a face extend to its middle, so
    forces are continuous if an end gains contact; a face shorter than a tube radius has one
    contact.

    Samples have integer numbers in the order of their angles: for a smooth surface from the angle
    0 on, for a corner from -n at the normal of the face before it to n at that of the face after
    it.

    :ivar angles: middle and half of the range of a corner's angles [rad], and n; zeros if smooth.
    """

    def __init__(self, kernel: Flattening, shape: Shape, corner: int = 0) -> None:
        self._kernel, self._shape, self._corner = kernel, shape, corner
        self.depths = CORNER_DEPTHS * kernel.radius
        if shape.is_round:
            self.depths = DISC_DEPTHS * min(shape.reach, kernel.radius)
        self._outline = shape.outline(OUTLINE_SPACING * kernel.radius)
        self._faces, self.angles = shape.faces_at(corner), (0.0, 0.0, 0.0)
        if self._faces:
            before, after = (face.normal for face in self._faces)
            half_turn = 0.5 * cmath.phase(after / before)
            number = math.ceil(half_turn / ANGLE_STEP)
            self.angles = cmath.phase(before + after), half_turn, float(number)
        self._samples: dict[int, DentSample] = {}
        self._numbers: dict[int, Array] = {}

    @property
    def is_round(self) -> bool:
        """Return whether the depth does not depend on the angle."""
        return self._shape.is_round

    def samples_near(self, base: int) -> list[DentSample]:
        """Return the four samples near a number, none beyond a face; or that of a disc."""
        numbers, last = [base + i for i in (-1, 0, 1, 2)], int(self.angles[-1])
        if self.is_round:
            numbers = [0]
        elif self._faces:
            numbers = [min(max(n, -last), last) for n in numbers]
        for number in numbers:
            if number not in self._samples:
                count_work(is_stored=True)
                skin_at = self.skin_by_depth(self._sampled_angle(number))
                self._samples[number] = DentSample(self.depths, skin_at, self._kernel)
        return [self._samples[number] for number in numbers]

    def splines_near(self, base: int) -> Array:
        """Return the numbers (4, q) of the splines in the samples near a number."""
        if base not in self._numbers:
            depths = [sample.depth.numbers for sample in self.samples_near(base)]
            self._numbers[base] = np.array(depths)
        return self._numbers[base]

    def _sampled_angle(self, number: int) -> float:
        """Return the angle of the normal in the sample of this number [rad]."""
        if not self._faces:
            return ANGLE_STEP * number
        middle, half_turn, last = self.angles
        return middle + half_turn * math.sin(0.5 * math.pi * number / last)

    def skin_by_depth(self, angle: float) -> Callable[[float], PressedSkin]:
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


class Dents:
    """
    Depths of the dents at k contacts with one object, or with each of n objects.

    :ivar tables: (k,) or (n, k) table of each contact.
    """

    def __init__(
        self,
        tables: Any,
        angles: Array | None = None,
        polynomials_at: tuple[Array, Array] | None = None,
    ) -> None:
        self.tables = tables
        if angles is None:
            self.tables = np.empty(np.shape(tables), dtype=object)
            self.tables[...] = tables
            angles = np.array([table.angles for table in self.tables.ravel()])
            angles = angles.reshape(*self.tables.shape, 3)
        #: (..., k, 3) `DentTable.angles` of the tables
        self._angles = angles
        #: 2/3 powers of the forces and angles (k,) whose polynomials are used; None: those of the
        #: arguments
        self._polynomials_at = polynomials_at

    def __call__(self, forces: Array, angles: Array) -> tuple[Array, Array, Array]:
        """
        Return the depths (k,) [m], and their derivatives by forces [m/N] and angles [m/rad].

        The depths are odd in the forces.
        """
        sizes = np.maximum(np.abs(forces), 1e-9)
        abscissae, signs = sizes**DEPTH_EXPONENT, forces / sizes
        rates = np.empty((3, forces.size))
        for are_round, chosen in self._kinds:
            values = self._evaluate(are_round, chosen, abscissae.ravel(), angles.ravel())
            rates[:, chosen] = values
        depths, by_abscissa, by_angle = rates.reshape(3, *forces.shape)
        by_force = DEPTH_EXPONENT * abscissae / sizes * by_abscissa
        return signs * depths, by_force, signs * by_angle

    @functools.cached_property
    def _kinds(self) -> list[tuple[bool, Indices | slice]]:
        """Return the contacts whose depths do not depend on the angle, and the others."""
        are_round = np.array([table.is_round for table in self.tables.ravel().tolist()])
        if are_round.all() or not are_round.any():
            return [(bool(are_round[0]), slice(None))]
        return [(kind, np.flatnonzero(are_round == kind)) for kind in (True, False)]

    @functools.cached_property
    def _round_numbers(self) -> Array:
        """Return the numbers (c, 1, q) of the splines of the contacts that are round."""
        tables = self.tables.ravel().tolist()
        return np.array([table.splines_near(0) for table in tables if table.is_round])

    def _evaluate(
        self, are_round: bool, chosen: Indices | slice, abscissae: Array, angles: Array
    ) -> Any:
        """Return depths and derivatives (3, c) by abscissa and angle, of chosen contacts."""
        abscissae, angles = piece_abscissae, piece_angles = abscissae[chosen], angles[chosen]
        if self._polynomials_at is not None:
            piece_abscissae, piece_angles = (v.ravel()[chosen] for v in self._polynomials_at)
        if are_round:
            values = evaluate_splines(self._round_numbers, abscissae, piece_abscissae)
            return values[0][:, 0], values[1][:, 0], np.zeros(len(abscissae))
        tables = self.tables.ravel()[chosen].tolist()
        of_tables = self._angles.reshape(-1, 3)[chosen].T
        bases, (weights, by_angle) = _weigh(angles, piece_angles, of_tables)
        pairs = zip(tables, bases.tolist(), strict=True)
        numbers = np.array([table.splines_near(base) for table, base in pairs])
        depths, slopes = evaluate_splines(numbers, abscissae, piece_abscissae)
        products = weights * depths, weights * slopes, by_angle * depths
        return np.array(products).sum(axis=-1)

    def press(self, forces: Array, angles: Array) -> list[PressedSkin]:
        """
        Return the pressed skin at each contact under positive normal forces (k,) [N].

        The skin is at most as deep as the table.
        """
        depths, _, _ = self(forces, angles)
        skins = []
        for table, depth, force, angle in zip(self.tables, depths, forces, angles, strict=True):
            skin = table.skin_by_depth(float(angle))(float(np.clip(depth, 0.0, table.depths[-1])))
            total = float(skin.forces.sum())
            factor = float(force) / total if total > 0.0 else 0.0
            skins.append(skin._replace(forces=skin.forces * factor))
        return skins

    def smooth_near(self, forces: Array, angles: Array) -> Dents:
        """Return dents interpolated with the polynomials near given forces (k,) [N] and angles."""
        return Dents(self.tables, self._angles, (np.abs(forces) ** DEPTH_EXPONENT, angles))

    def pressure_rates(self, forces: Array, angles: Array) -> Array:
        """Return the derivatives (k,) of the depths by the tubes' gauge pressures [m/Pa]."""
        of_tables, abscissae = self._angles.T, np.abs(forces) ** DEPTH_EXPONENT
        piece_abscissae, piece_angles = self._polynomials_at or (abscissae, angles)
        bases, (weights, _) = _weigh(angles, piece_angles, of_tables)
        at, rates = np.column_stack([abscissae, piece_abscissae]).tolist(), []
        for table, base, weight, x in zip(self.tables, bases.tolist(), weights, at, strict=True):
            samples = [
                sample.inflated for sample in table.samples_near(0 if table.is_round else base)
            ]
            by_sample = [(higher(*x) - lower(*x)) / change for higher, lower, change in samples]
            rates.append(by_sample[0] if table.is_round else float(weight @ by_sample))
        return np.copysign(1.0, forces) * rates

    def take_samples(self, index: Any) -> Dents:
        """Return the dents of chosen objects, or of one, see `samples.take`."""
        return Dents(self.tables[index], self._angles[index])

    @staticmethod
    def join_samples(values: Sequence[Dents]) -> Dents:
        """Return the dents of several samples, see `samples.join`."""
        tables = np.concatenate([dents.tables for dents in values])
        return Dents(tables, np.concatenate([dents._angles for dents in values]))


def _wrapped(angles: Array) -> Array:
    """Return angles within half a turn [rad]."""
    return angles - 2.0 * math.pi * np.round(angles / (2.0 * math.pi))


def _fractional_numbers(
    angles: Array, turn_of: Array | float, of_tables: Array
) -> tuple[Array, Array]:
    """
    Return angles (c,) as fractional sample numbers in the turns of samples, with derivatives.

    The rows (3, c) are `DentTable.angles`.
    """
    middle, half_turn, last = of_tables
    is_corner = last > 0.0
    numbers, rates = np.empty((2, len(angles)))
    if not is_corner.all():
        difference = _wrapped(angles - ANGLE_STEP * turn_of)
        numbers, rates = turn_of + difference / ANGLE_STEP, np.full(len(angles), 1.0 / ANGLE_STEP)
    if not is_corner.any():
        return numbers, rates
    # Near the normal of a face the depth is almost linear in the root of the angle from it, so the
    # samples are at equal steps of the arc sine. Beyond the face it is constant, and also within
    # rounding of its normal, where the derivative would have any size.
    if not is_corner.all():
        half_turn, last = np.where(is_corner, (half_turn, last), 1.0)
    sines = _wrapped(angles - middle) / half_turn
    sines = np.minimum(np.maximum(sines * (1.0 + ROUNDING), -1.0), 1.0)
    step, cosines = 0.5 * math.pi / last, np.sqrt(1.0 - sines * sines)
    slopes = 1.0 / (half_turn * step * np.where(cosines > 0.0, cosines, np.inf))
    of_corners = np.arcsin(sines) / step, slopes
    if is_corner.all():
        return of_corners
    return np.where(is_corner, of_corners[0], numbers), np.where(is_corner, slopes, rates)


def _weigh(angles: Array, piece_angles: Array, of_tables: Array) -> tuple[Indices, Array]:
    """
    Return numbers (c,) of samples, and weights of four samples near each.

    The weights (2, c, 4) are those at given angles, and their derivatives by the angles.
    """
    # The polynomial interpolates the two samples before and the two after its own angle; the
    # second of the four has the number `base`. It is evaluated at `angles`, which may differ.
    last, is_corner = of_tables[2], of_tables[2] > 0.0
    numbers, rates = _fractional_numbers(piece_angles, 0.0, of_tables)
    bases = np.floor(numbers)
    bases = np.where(is_corner, np.minimum(bases, last - 1.0), bases)
    if piece_angles is not angles:
        numbers, rates = _fractional_numbers(angles, bases, of_tables)
    x = numbers - bases  # 0 at the second sample, 1 at the third
    powers = np.ones((2, len(angles), 6))
    powers[0, :, 1:] = np.multiply.accumulate(np.repeat(x[:, None], 5, axis=1), axis=1)
    powers[1, :, 0] = 0.0
    powers[1, :, 1:] = rates[:, None] * np.arange(1, 6) * powers[0, :, :-1]
    weights = powers @ WEIGHTS.T
    # Instead of a sample beyond a face, its depth d is extrapolated by a parabola through the
    # other three: d_0 = 3 d_1 - 3 d_2 + d_3.
    at_start, at_end = is_corner & (bases == -last), is_corner & (bases == last - 1.0)
    if at_start.any():
        weights[:, at_start, 1:] += weights[:, at_start, :1] * np.array([3.0, -3.0, 1.0])
        weights[:, at_start, 0] = 0.0
    if at_end.any():
        weights[:, at_end, :-1] += weights[:, at_end, -1:] * np.array([1.0, -3.0, 3.0])
        weights[:, at_end, -1] = 0.0
    return bases.astype(int), weights
