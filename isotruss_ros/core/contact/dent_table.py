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
from collections.abc import Sequence
import functools
import math
from typing import NamedTuple

from isotruss_ros.core.contact.dent_angles import ANGLE_STEP
from isotruss_ros.core.contact.flattening import Flattening
from isotruss_ros.core.contact.pressed_skin import (
    find_corner_chords,
    find_disc_chords,
    find_profile,
    MAX_EXTENT,
    OUTLINE_SPACING,
    press_skin,
    PressedSkin,
)
from isotruss_ros.core.contact.splines import fit_splines
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.tolerances import EPSILON
from isotruss_ros.core.numerics.work_limit import count_work, work_left
import numpy as np

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
