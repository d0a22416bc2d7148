# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses in the robot frame, and the admissible ranges of an object's numbers."""

from __future__ import annotations

import math
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError, IsotrussError
from isotruss_ros.core.model.robot_schema import plausible_range
from isotruss_ros.core.model.units import likely_unit
from isotruss_ros.core.numerics.arrays import Array, finite_array
from isotruss_ros.core.numerics.tolerances import ROUNDING
import numpy as np
from numpy.typing import ArrayLike

#: Smallest size of an object [m]; smaller sizes are rounding errors.
MIN_DIAMETER = ROUNDING
#: Largest size [m] and mass [kg] of an object, several times what a robot of a few metres holds. A
#: tenth of these limits would refuse objects of the examples; ten times these limits would accept
#: a size in centimetres as one in metres. Largest coefficient of friction [-]: soft rubber has 2
#: to 4; a third of this limit would refuse it, three times this limit would accept it in percent.
MAX_SIZE, MAX_MASS, MAX_FRICTION = 10.0, 100.0, 10.0


class Pose(NamedTuple):
    """
    Position x, y [m] and angle [rad] in the robot frame.

    :ivar x: coordinate x in the robot frame [m].
    :ivar y: coordinate y in the robot frame [m].
    :ivar angle: angle, counter-clockwise from the x axis [rad].
    """

    x: float
    y: float
    angle: float


def pose_fault(x: float, y: float, angle: float = 0.0) -> str:
    """Return the fault of a pose that is too far away or beyond one turn; empty if none."""
    _, farthest = plausible_range('joints')
    for name, value, unit, most in (
        ('x', x, 'm', farthest),
        ('y', y, 'm', farthest),
        ('angle', angle, 'rad', 2.0 * math.pi),
    ):
        if not abs(value) <= most:
            hint = likely_unit(value, unit, -most, most)
            return f'{name} must be finite, at most {most:.4g} {unit} in magnitude{hint}'
    return ''


def pose_difference(pose: ArrayLike, other: ArrayLike) -> Array:
    """Return the first pose minus the second, (3,) [m, rad]; the angle is wrapped to (-pi, pi]."""
    difference = np.subtract(pose, other)
    difference[2] = math.remainder(difference[2], 2.0 * math.pi)
    return difference


def check_range(
    value: float,
    what: str,
    unit: str,
    low: float,
    high: float,
    error: type[IsotrussError] = GraspError,
) -> float:
    """Return a checked number; raise an error if it is not finite or not within its range."""
    subject, in_unit = (f'{what} [{unit}]', f' {unit}') if unit else (what, '')
    (number,) = finite_array([value], 1, subject, error).tolist()
    if not low <= number <= high:
        limits = f'from {low:g} to {high:g}{in_unit}{likely_unit(number, unit, low, high)}'
        raise error(f'{what} {value!r}{in_unit}: must be {limits}')
    return float(number)
