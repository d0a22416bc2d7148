# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Dents of similar objects in tubes under similar pressures, interpolated between tables.

A table for each of many random sizes and pressures would take longer than their equilibria. At a
given relative depth the force is almost a product of powers of size and pressure, so its logarithm
is interpolated in their logarithms, and what remains of the depth in these as well. Tables are
computed for size and pressure of the given object, and at steps from them.
"""

from __future__ import annotations

from collections.abc import Sequence
import functools
import math
from typing import TypeAlias

from isotruss_ros.core.contact.dent_table import compute_samples, dent_table, DentTable
from isotruss_ros.core.contact.flattening import flattening_of
from isotruss_ros.core.contact.splines import evaluate_splines, fit_splines
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.model.scaled_shape import ScaledShape
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.section import tube_pressures
import numpy as np

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
