# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Dents of tubes by objects, and their tables."""

from __future__ import annotations

import cmath
from collections import defaultdict
from collections.abc import Sequence
import contextlib
import functools
import math
from typing import Any, NamedTuple, TypeAlias

from isotruss_ros.core.contact.pressed_skin import (
    find_corner_chords,
    find_disc_chords,
    find_profile,
    Flattening,
    flattening_of,
    MAX_EXTENT,
    OUTLINE_SPACING,
    press_skin,
    PressedSkin,
)
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.model.scaled_shape import ScaledShape
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.tolerances import EPSILON, ROUNDING
from isotruss_ros.core.numerics.work_limit import (
    count_work,
    limited_work,
    work_left,
    WorkLimitError,
)
from isotruss_ros.core.statics.tube_stiffness import tube_pressures
import numpy as np

# Natural cubic splines of many dents at once.


def fit_splines(abscissae: Array, values: Array) -> Array:
    """
    Return the numbers (s, q) of natural cubic splines through values (n,) or (s, n).

    The abscissae (s, n) begin with 0. The numbers are the abscissae of all points but the first,
    and then, for each of the n - 1 pieces, the coefficients of its polynomial and its first
    abscissa.
    """
    steps = np.diff(abscissae)
    slopes = np.diff(np.broadcast_to(values, abscissae.shape)) / steps
    inner = np.arange(abscissae.shape[1] - 2)
    matrix = np.zeros((len(abscissae), len(inner), len(inner)))
    matrix[:, inner, inner] = 2.0 * (steps[:, :-1] + steps[:, 1:])
    matrix[:, inner[:-1], inner[1:]] = matrix[:, inner[1:], inner[:-1]] = steps[:, 1:-1]
    bending = np.zeros(abscissae.shape)  # half of the second derivatives
    bending[:, 1:-1] = np.linalg.solve(matrix, 3.0 * np.diff(slopes)[..., None])[..., 0]
    before, after = bending[:, :-1], bending[:, 1:]
    pieces = [
        (after - before) / (3.0 * steps),
        before,
        slopes - steps * (2.0 * before + after) / 3.0,
        np.broadcast_to(values, abscissae.shape)[:, :-1],
        abscissae[:, :-1],
    ]
    flat = np.stack(pieces, axis=-1).reshape(len(abscissae), -1)
    return np.concatenate([abscissae[:, 1:], flat], axis=1)


def evaluate_splines(numbers: Array, x: Array, x_of_piece: Array) -> tuple[Array, Array]:
    """
    Return values and slopes (c, m) at x (c,), of m splines each, see `fit_splines`.

    The splines have the numbers (c, m, q). The values are those of the polynomial piece that
    contains `x_of_piece` (c,).
    """
    count, x, x_of_piece = numbers.shape[-1] // 6, x[:, None], x_of_piece[:, None]
    ends = numbers[..., count - 1]
    piece = (numbers[..., : count - 1] <= x_of_piece[..., None]).sum(axis=-1)
    a, b, c, d, begin = numbers.take(_places_of_first_piece(*numbers.shape) + 5 * piece)
    inside = np.where(x_of_piece < ends, x, ends)
    s = inside - begin
    slope = (3.0 * a * s + 2.0 * b) * s + c
    return ((a * s + b) * s + c) * s + d + slope * (x - inside), slope


@functools.lru_cache(maxsize=64)
def _places_of_first_piece(count: int, splines: int, size: int) -> Indices:
    """Return the places (5, c, m) of the numbers of the first pieces of (c, m, q), cached."""
    begins = size // 6 + size * np.arange(count * splines).reshape(count, splines)
    return begins + np.arange(5)[:, None, None]


# Interpolation of the depths of dents between the angles of the object's normal.
#
# The polynomials have continuous second derivatives.

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
EXPONENTS = np.arange(6.0)
#: Coefficients of their derivatives.
SLOPE_WEIGHTS = np.pad(EXPONENTS[1:] * WEIGHTS[:, 1:], ((0, 0), (0, 1)))


def weigh_samples(angles: Array, piece_angles: Array, of_tables: Array) -> tuple[Indices, Array]:
    """
    Return numbers (c,) of samples, and weights of four samples near each.

    The weights (2, c, 4) are those at given angles, and their derivatives by the angles. The rows
    (3, c) are `DentTable.angles`, all of corners or all of smooth surfaces.
    """
    # The polynomial interpolates the two samples before and the two after its own angle; the
    # second of the four has the number `base`. It is evaluated at `angles`, which may differ.
    last, is_corner = of_tables[2], bool(of_tables[2, 0])
    numbers, rates = _fractional_numbers(piece_angles, 0.0, of_tables)
    bases = np.floor(numbers)
    if is_corner:
        bases = np.minimum(bases, last - 1.0)
    if piece_angles is not angles:
        numbers, rates = _fractional_numbers(angles, bases, of_tables)
    # The base of the powers is 0 at the second sample, 1 at the third.
    powers = (numbers - bases)[:, None] ** EXPONENTS
    weights = np.empty((2, len(angles), 4))
    np.matmul(powers, WEIGHTS.T, out=weights[0])
    np.matmul(powers, SLOPE_WEIGHTS.T, out=weights[1])
    weights[1] *= rates[:, None]
    if is_corner:
        # Instead of a sample beyond a face, its depth d is extrapolated by a parabola through the
        # other three: d_0 = 3 d_1 - 3 d_2 + d_3.
        at_start, at_end = np.flatnonzero(bases == -last), np.flatnonzero(bases == last - 1.0)
        if at_start.size:
            weights[:, at_start, 1:] += weights[:, at_start, :1] * np.array([3.0, -3.0, 1.0])
            weights[:, at_start, 0] = 0.0
        if at_end.size:
            weights[:, at_end, :-1] += weights[:, at_end, -1:] * np.array([1.0, -3.0, 3.0])
            weights[:, at_end, -1] = 0.0
    return bases.astype(int), weights


def _fractional_numbers(
    angles: Array, turn_of: Array | float, of_tables: Array
) -> tuple[Array, Array]:
    """Return angles (c,) as fractional sample numbers in the turns of samples, and derivatives."""
    middle, half_turn, last = of_tables
    if not last[0]:
        difference = _wrapped(angles - ANGLE_STEP * turn_of)
        return turn_of + difference / ANGLE_STEP, np.full(len(angles), 1.0 / ANGLE_STEP)
    # Near the normal of a face the depth is almost linear in the root of the angle from it, so the
    # samples are at equal steps of the arc sine. Beyond the face it is constant, and also within
    # rounding of its normal, where the derivative would have any size.
    sines = _wrapped(angles - middle) / half_turn
    sines = np.minimum(np.maximum(sines * (1.0 + ROUNDING), -1.0), 1.0)
    step, cosines = 0.5 * math.pi / last, np.sqrt(1.0 - sines * sines)
    slopes = 1.0 / (half_turn * step * np.where(cosines > 0.0, cosines, np.inf))
    return np.arcsin(sines) / step, slopes


def _wrapped(angles: Array) -> Array:
    """Return angles within half a turn [rad]."""
    return angles - 2.0 * math.pi * np.round(angles / (2.0 * math.pi))


# Depth of the dent of a tube's skin at one contact, by normal force and angle of the normal.
#
# The dent is the deformation of the tube's section by `flattening` while the centre line is fixed.
# Its depth is the overlap of the object with the tube's undeformed section. Each point of the skin
# presses across the tube, see `pressed_skin`, so the dent follows from the heights of the object's
# surface: under equal forces it is deep at a sharp corner and shallow at a face. The depth depends
# only on tube and object, so one table is valid for every grasp. The depth is almost linear in the
# 2/3 power of the force, as for a point contact.

DEPTH_EXPONENT = 2.0 / 3.0
#: Depths in the tables [-]: of discs relative to the smaller radius of tube and disc, of corners
#: relative to the tube radius.
DISC_DEPTHS, CORNER_DEPTHS = (0.8 * np.linspace(0.0, 1.0, n) ** 2 for n in (15, 10))
#: Largest number of samples that are computed together, which bounds the memory [-].
TOGETHER = 64


class DentSample(NamedTuple):
    """Depths and forces of n dents for one angle of the object's normal."""

    kernel: Flattening  #: local compliance of the tube
    depths: Array  #: (n + 1,) depths, the first of which is 0 [m]
    skins: PressedSkin  #: pressed skins at the other depths
    abscissae: Array  #: (n + 1,) 2/3 powers of the forces [N^(2/3)]
    numbers: Array  #: (q,) numbers of the spline of the depth by the abscissae

    def inflate(self) -> tuple[Array, float]:
        """Return `numbers` (2, q) at a higher and a lower pressure, and their difference [Pa]."""
        # This step minimises the error of central differences, about step^2 + EPSILON / step.
        step = EPSILON ** (1.0 / 3.0) * self.kernel.pressure.real
        rates = [0.0]
        for spacing, forces in zip(self.skins.spacing.tolist(), self.skins.forces, strict=True):
            # The forces q solve C q = -gaps with constant gaps. With the pressure, their sum
            # changes by -l . C' q, where C' is the derivative of C, and `sum_by_gaps` l solves
            # C l = 1.
            pressed = np.flatnonzero(forces)
            compliance = self.kernel.compliance(pressed, spacing)
            sum_by_gaps = np.linalg.solve(compliance, np.ones(len(pressed)))
            compliance_rates = self.kernel.compliance_rates(pressed, spacing)
            force_rate = -float(sum_by_gaps @ compliance_rates @ forces[pressed])
            rates.append(DEPTH_EXPONENT * forces.sum() ** (DEPTH_EXPONENT - 1.0) * force_rate)
        changes = step * np.array(rates) * np.array([[1.0], [-1.0]])
        return fit_splines(self.abscissae + changes, self.depths), 2.0 * step


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

    :ivar kernel: local compliance of the tube.
    :ivar angles: middle and half of the range of a corner's angles [rad], and n; zeros if smooth.
    """

    def __init__(self, kernel: Flattening, shape: Shape, corner: int = 0) -> None:
        self.kernel, self._shape, self._corner = kernel, shape, corner
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
        # Both ends of a long face have contacts, which extend to its middle.
        self._extents = np.full(2, MAX_EXTENT * kernel.radius)
        for side, face in enumerate(self._faces):
            if face.length >= kernel.radius:
                self._extents[side] = min(self._extents[side], 0.5 * face.length)
        self.samples: dict[int, DentSample] = {}
        self._numbers: dict[int, Array] = {}
        self._inflated: dict[int, tuple[Array, float]] = {}

    @property
    def is_round(self) -> bool:
        """Return whether the depth does not depend on the angle."""
        return self._shape.is_round

    def numbers_near(self, base: int) -> list[int]:
        """Return the numbers of the four samples near one, none beyond a face; or of a disc."""
        if self.is_round:
            return [0]
        last, near = int(self.angles[-1]), range(base - 1, base + 3)
        return [min(max(n, -last), last) for n in near] if self._faces else list(near)

    def splines_near(self, base: int) -> Array:
        """Return the numbers (4, q) of the splines in the samples near a number."""
        if base not in self._numbers:
            compute_samples([(self, base)])
            self._numbers[base] = np.array(
                [self.samples[n].numbers for n in self.numbers_near(base)]
            )
        return self._numbers[base]

    def inflated_near(self, base: int) -> list[tuple[Array, float]]:
        """Return `DentSample.inflate` of the samples near a number."""
        compute_samples([(self, base)])
        for number in self.numbers_near(base):
            if number not in self._inflated:
                self._inflated[number] = self.samples[number].inflate()
        return [self._inflated[number] for number in self.numbers_near(base)]

    def sampled_angle(self, number: int) -> float:
        """Return the angle of the normal in the sample of this number [rad]."""
        if not self._faces:
            return ANGLE_STEP * number
        middle, half_turn, last = self.angles
        return middle + half_turn * math.sin(0.5 * math.pi * number / last)

    def chords(self, angle: float, depths: Array) -> tuple[Array, Array]:
        """Return positions and heights (s, c) of the surface on the chords at depths [m]."""
        shape, normal = self._shape, cmath.rect(1.0, angle)
        if shape.is_round:
            return find_disc_chords(shape.reach, depths)
        profile = find_profile(self._outline, shape.point_at(self._corner, normal), normal)
        return find_corner_chords(profile, self._extents, depths)


def press_tables(
    tables: Sequence[DentTable], angles: Sequence[float], depths: Sequence[Array]
) -> list[PressedSkin]:
    """Return the pressed skins of tables, each at one angle [rad] and several depths [m]."""
    skins = [PressedSkin(*4 * (np.zeros(0),))] * len(tables)
    for kernel in dict.fromkeys(table.kernel for table in tables):
        alike = [i for i, table in enumerate(tables) if table.kernel is kernel]
        chords = [tables[i].chords(angles[i], depths[i]) for i in alike]
        positions, heights = map(np.concatenate, zip(*chords, strict=True))
        pressed = press_skin(
            kernel, positions, heights, np.concatenate([depths[i] for i in alike])
        )
        ends = np.cumsum([len(depths[i]) for i in alike])[:-1]
        parts = zip(*(np.split(values, ends) for values in pressed), strict=True)
        for i, part in zip(alike, parts, strict=True):
            skins[i] = PressedSkin(*part)
    return skins


def compute_samples(wanted: Sequence[tuple[DentTable, int]]) -> None:
    """Compute all samples that tables lack near numbers together, and count them as work."""
    missing = [
        (table, number)
        for table, number in dict.fromkeys((t, n) for t, b in wanted for n in t.numbers_near(b))
        if number not in table.samples
    ]
    while missing:
        # Those beyond a bound on the work are not computed.
        count = min(max(1, work_left()), TOGETHER)
        now, missing = missing[:count], missing[count:]
        tables = [table for table, _ in now]
        depths = [table.depths[1:] for table in tables]
        skins = press_tables(tables, [t.sampled_angle(n) for t, n in now], depths)
        abscissae = [np.append(0.0, s.forces.sum(axis=1)) ** DEPTH_EXPONENT for s in skins]
        for size in {len(table.depths) for table in tables}:
            alike = [i for i, table in enumerate(tables) if len(table.depths) == size]
            ordinates = np.array([tables[i].depths for i in alike])
            splines = fit_splines(np.array([abscissae[i] for i in alike]), ordinates)
            for i, numbers in zip(alike, splines, strict=True):
                table, number = now[i]
                table.samples[number] = DentSample(
                    table.kernel, table.depths, skins[i], abscissae[i], numbers
                )
        for _ in now:
            count_work(is_stored=True)


#: Returns a `DentTable`, cached.
dent_table = functools.lru_cache(maxsize=256)(DentTable)


# Dents of similar objects in tubes under similar pressures, interpolated between tables.
#
# A table for each of many random sizes and pressures would take longer than their equilibria. At a
# given relative depth the force is almost a product of powers of size and pressure, so its
# logarithm is interpolated in their logarithms, and what remains of the depth in these as well.
# Tables are computed for size and pressure of the given object, and at steps from them.

#: Steps of the logarithms of the pressure and of the size between tables [-]. For deviations of 5
#: and 3 %, depths of discs err by up to 3e-4, those of polygons by up to 7e-3 (median 4e-4) of
#: themselves, less than those of a table between its angles, see `ANGLE_STEP`.
PRESSURE_STEP, SIZE_STEP = 0.2, 0.1
#: Steps of pressure and size of several tables, and those between which a value is interpolated.
Steps: TypeAlias = tuple[tuple[int, int], ...]
STEPS: Steps = (0, 0), (-1, 0), (1, 0), (0, -1), (0, 1)


class DentFamily:
    """Dents of one corner of all objects similar to one, in a tube under any pressure."""

    def __init__(self, robot: Mechanism, pressure: float, shape: Shape, corner: int) -> None:
        self._robot, self._pressure, self._shape, self._corner = robot, pressure, shape, corner
        self._splines: dict[tuple[int, int, int], tuple[Array, Array]] = {}
        self._joined: dict[tuple[Steps, int], tuple[Array, Array]] = {}
        self.nominal = self.table(0, 0)

    def table(self, of_pressure: int, of_size: int) -> DentTable:
        """Return the table so many steps from the given pressure and from the given size."""
        pressure, shape = self._pressure * math.exp(PRESSURE_STEP * of_pressure), self._shape
        if of_size:
            shape = ScaledShape(shape, math.exp(SIZE_STEP * of_size))
        return dent_table(flattening_of(self._robot, pressure), shape, self._corner)

    def coordinates(self, pressure: float, factor: float) -> tuple[float, float]:
        """Return pressure and size as numbers of steps from the given ones."""
        ratio = pressure / self._pressure
        return math.log(ratio) / PRESSURE_STEP, math.log(factor) / SIZE_STEP

    def splines_near(self, of_pressure: int, of_size: int, base: int) -> tuple[Array, Array]:
        """
        Return the splines (4, q) of a table near a number, and logarithms (4,) of their scales.

        The abscissae are divided by their scale, so that the splines have the pieces of those of
        the nominal table.
        """
        key = of_pressure, of_size, base
        if key not in self._splines:
            nominal = self.nominal.splines_near(base)
            numbers = self.table(of_pressure, of_size).splines_near(base)
            size, count = nominal.shape[-1], nominal.shape[-1] // 6
            scales = numbers[:, count - 1] / nominal[:, count - 1]
            abscissae = np.concatenate([0.0 * nominal[:, :1], nominal[:, :count]], axis=1)
            at = (scales[:, None] * abscissae).ravel()
            depths, _ = evaluate_splines(
                numbers.repeat(count + 1, axis=0).reshape(-1, 1, size), at, at
            )
            splines = fit_splines(abscissae, depths.reshape(abscissae.shape))
            self._splines[key] = splines, np.log(scales)
        return self._splines[key]

    def splines_at(self, steps: Steps, base: int) -> tuple[Array, Array]:
        """Return `splines_near` of the tables at t steps, joined: (t, 4, q) and (t, 4)."""
        if (steps, base) not in self._joined:
            near = [self.splines_near(*step, base) for step in steps]
            splines, logarithms = (np.array(arrays) for arrays in zip(*near, strict=True))
            self._joined[steps, base] = splines, logarithms
        return self._joined[steps, base]


#: Returns a `DentFamily`, cached.
_dent_family = functools.lru_cache(maxsize=256)(DentFamily)


class InterpolatedTable:
    """Interpolated `DentTable` of an object with a factor on its size, under a pressure [Pa]."""

    def __init__(self, family: DentFamily, pressure: float, factor: float) -> None:
        self.family = family
        #: numbers of the splines near a sample, see `splines_of`
        self.numbers = dict[int, Array]()
        self.is_round, self.angles = family.nominal.is_round, family.nominal.angles
        # Parabolas through three tables in each direction, whose ends are even numbers of steps
        # beside the middle.
        at = family.coordinates(pressure, factor)
        middle = [2 * round(0.5 * x) for x in at]
        t, s = at[0] - middle[0], at[1] - middle[1]
        ends = [0.5 * x * (x + way) for x in (t, s) for way in (-1.0, 1.0)]
        #: weights of tables, and their steps; a table without weight is replaced by the middle
        self.weights = [1.0 - t * t - s * s, *ends]
        self.steps = tuple(
            (middle[0] + i, middle[1] + j) if weight else (middle[0], middle[1])
            for weight, (i, j) in zip(self.weights, STEPS, strict=True)
        )

    def splines_near(self, base: int) -> Array:
        """Return the numbers (4, q) of the splines near a sample that `splines_of` computed."""
        return self.numbers[base]


def splines_of(tables: Sequence[DentTable | InterpolatedTable], bases: Sequence[int]) -> Array:
    """Return the numbers (c, m, q) of the splines of tables (c,), each near a sample."""
    missing, wanted = list[tuple[InterpolatedTable, int]](), list[tuple[DentTable, int]]()
    for table, base in zip(tables, bases, strict=True):
        if isinstance(table, DentTable):
            wanted.append((table, base))
        elif base not in table.numbers:
            missing.append((table, base))
            at_steps = [table.family.table(*step) for step in table.steps]
            wanted += [(each, base) for each in (table.family.nominal, *at_steps)]
    compute_samples(wanted)
    if missing:
        near = [table.family.splines_at(table.steps, base) for table, base in missing]
        splines, logarithms = (np.array(arrays) for arrays in zip(*near, strict=True))
        weights = np.array([[table.weights] for table, _ in missing])
        scales = np.exp((weights @ logarithms)[:, 0, :, None] * _powers(splines.shape[-1]))
        sums = weights @ splines.reshape(*splines.shape[:2], -1)
        values = scales * sums.reshape(scales.shape)
        for (table, base), numbers in zip(missing, values, strict=True):
            table.numbers[base] = numbers
    return np.array([table.splines_near(base) for table, base in zip(tables, bases, strict=True)])


@functools.lru_cache(maxsize=8)
def _powers(size: int) -> Array:
    """Return the powers (q,) of the scale of the abscissae in `fit_splines`."""
    count = size // 6
    return np.append(np.ones(count), np.tile([-3.0, -2.0, -1.0, 0.0, 1.0], count))


def find_table(
    robot: Mechanism, tube: int, pressure: float, shape: Shape, corner: int
) -> DentTable | InterpolatedTable:
    """Return the dents of a corner in a tube, interpolated if the shape asks for it."""
    if isinstance(shape, ScaledShape) and shape.interpolated:
        given = tube_pressures(robot.description)[tube]
        family = _dent_family(robot, given, shape.base, corner)
        return InterpolatedTable(family, pressure, shape.factor)
    return dent_table(flattening_of(robot, pressure), shape, corner)


# Depths of the dents at the contacts of an object, or of several objects.


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
        """
        Return the contacts of discs, of smooth surfaces and of corners.

        The depths of discs, which have True, do not depend on the angle.
        """
        kinds = defaultdict[tuple[bool, bool], list[int]](list)
        for i, table in enumerate(self.tables.ravel().tolist()):
            kinds[table.is_round, table.angles[-1] > 0.0].append(i)
        if len(kinds) == 1:
            return [(are_round, slice(None)) for are_round, _ in kinds]
        return [(are_round, np.array(chosen)) for (are_round, _), chosen in kinds.items()]

    @functools.cached_property
    def _round_numbers(self) -> Array:
        """Return the numbers (c, 1, q) of the splines of the contacts that are round."""
        tables = [table for table in self.tables.ravel().tolist() if table.is_round]
        return splines_of(tables, [0] * len(tables))

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
        bases, (weights, by_angle) = weigh_samples(angles, piece_angles, of_tables)
        numbers = splines_of(tables, bases.tolist())
        depths, slopes = evaluate_splines(numbers, abscissae, piece_abscissae)
        products = weights * depths, weights * slopes, by_angle * depths
        return np.array(products).sum(axis=-1)

    def press(self, forces: Array, angles: Array) -> PressedSkin:
        """
        Return the pressed skins at all contacts under positive normal forces (k,) [N].

        The skin is at most as deep as the table.
        """
        depths, _, _ = self(forces, angles)
        deepest = np.array([table.depths[-1] for table in self.tables])
        clipped = np.clip(depths, 0.0, deepest)[:, None]
        skins = press_tables(self.tables.tolist(), angles.tolist(), list(clipped))
        pressed = PressedSkin(*map(np.concatenate, zip(*skins, strict=True)))
        totals = pressed.forces.sum(axis=1)
        factors = np.divide(forces, totals, out=np.zeros(len(totals)), where=totals > 0.0)
        return pressed._replace(forces=pressed.forces * factors[:, None])

    def smooth_near(self, forces: Array, angles: Array) -> Dents:
        """Return dents interpolated with the polynomials near given forces (k,) [N] and angles."""
        return Dents(self.tables, self._angles, (np.abs(forces) ** DEPTH_EXPONENT, angles))

    def pressure_rates(self, forces: Array, angles: Array) -> Array:
        """Return the derivatives of the depths by the tubes' gauge pressures [m/Pa]."""
        if forces.ndim > 1:
            near = self._polynomials_at and tuple(map(np.ravel, self._polynomials_at))
            flat = Dents(self.tables.ravel(), self._angles.reshape(-1, 3), near)
            return flat.pressure_rates(forces.ravel(), angles.ravel()).reshape(forces.shape)
        of_tables, abscissae = self._angles.T, np.abs(forces) ** DEPTH_EXPONENT
        piece_abscissae, piece_angles = self._polynomials_at or (abscissae, angles)
        bases, (weights, _) = weigh_samples(angles, piece_angles, of_tables)
        numbers, owners, factors = [], list[int](), list[float]()
        for i, (table, base) in enumerate(zip(self.tables, bases.tolist(), strict=True)):
            near = table.inflated_near(base)
            of_samples = [1.0] if table.is_round else weights[i].tolist()
            for (splines, change), weight in zip(near, of_samples, strict=True):
                numbers.append(splines)
                owners.append(i)
                factors.append(weight / change)
        depths, _ = evaluate_splines(np.array(numbers), abscissae[owners], piece_abscissae[owners])
        rates = np.bincount(owners, factors * (depths[:, 0] - depths[:, 1]), len(forces))
        return np.copysign(1.0, forces) * rates

    def sample_ahead(self, angles: Array) -> None:
        """
        Compute one sample that the tables lack and need beyond these angles (k,), if any.

        A control loop calls this in cycles with little work, because a sample takes long.
        """
        bases, _ = weigh_samples(angles, angles, self._angles.T)
        with contextlib.suppress(WorkLimitError), limited_work(0):
            for table, base in zip(self.tables, bases.tolist(), strict=True):
                compute_samples([(table, base - 1), (table, base + 1)])

    def take_samples(self, index: Any) -> Dents:
        """Return the dents of chosen objects, or of one, see `samples.take`."""
        near = self._polynomials_at and tuple(values[index] for values in self._polynomials_at)
        return Dents(self.tables[index], self._angles[index], near)
