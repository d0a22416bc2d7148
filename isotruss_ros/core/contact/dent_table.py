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
from collections.abc import Callable
import functools
import math

from isotruss_ros.core.contact.dent_angles import ANGLE_STEP
from isotruss_ros.core.contact.flattening import Flattening
from isotruss_ros.core.contact.pressed_skin import (
    find_profile,
    MAX_EXTENT,
    OUTLINE_SPACING,
    press_corner,
    press_disc,
    PressedSkin,
)
from isotruss_ros.core.contact.splines import Spline
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.tolerances import EPSILON
from isotruss_ros.core.numerics.work_limit import count_work
import numpy as np

DEPTH_EXPONENT = 2.0 / 3.0
#: Depths in the tables [-]: of discs relative to the smaller radius of tube and disc, of corners
#: relative to the tube radius.
DISC_DEPTHS, CORNER_DEPTHS = (0.8 * np.linspace(0.0, 1.0, n) ** 2 for n in (15, 10))


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
                skin_at = self.skin_by_depth(self._sampled_angle(number))
                self._samples[number] = DentSample(self.depths, skin_at, self._kernel)
                count_work(is_stored=True)
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
