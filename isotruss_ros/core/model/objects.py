# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Objects: a cylinder between the tubes, and the pose that it has in the robot frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.numerics.arrays import finite_array
from numpy.typing import ArrayLike

#: No object is smaller or farther away [m]; products of such numbers neither vanish nor overflow.
MIN_DIAMETER, MAX_DISTANCE = 1e-9, 1e9


class Pose(NamedTuple):
    """
    Position x, y [m] and angle [rad] in the robot frame.

    :ivar x: in the robot frame [m].
    :ivar y: in the robot frame [m].
    :ivar angle: counter-clockwise from the x axis [rad].
    """

    x: float
    y: float
    angle: float


@dataclass(frozen=True)
class Cylinder:
    """
    An object with a circular cross-section.

    :ivar center: (x, y) in the robot frame [m].
    :ivar diameter: its own diameter d [m].
    :raises GraspError: the centre is not two finite numbers, or the diameter not positive.
    """

    center: tuple[float, float]
    diameter: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        center, diameter = validate_disc(self.center, self.diameter)
        object.__setattr__(self, 'center', center)
        object.__setattr__(self, 'diameter', diameter)


def validate_disc(center: ArrayLike, diameter: float) -> tuple[tuple[float, float], float]:
    """
    Return centre and diameter of an object's cross-section as floats [m].

    :param center: (x, y) in the robot frame [m].
    :param diameter: of the object [m].
    :raises GraspError: the centre is not two finite numbers, or the diameter not positive.
    """
    if _plain(center, diameter):
        return center, diameter
    x, y = finite_array(center, 2, "the object's centre [m]", GraspError)
    (size,) = finite_array([diameter], 1, "the object's diameter [m]", GraspError)
    if size <= 0.0:
        raise GraspError(f"the object's diameter {diameter!r} m: must be positive")
    if size < MIN_DIAMETER or max(size, abs(x), abs(y)) > MAX_DISTANCE:
        raise GraspError(
            f'the object of diameter {size:g} m at ({x:g}, {y:g}) m: must be '
            f'within {MAX_DISTANCE:g} m, and the diameter at least {MIN_DIAMETER:g} m'
        )
    return (float(x), float(y)), float(size)


def _plain(center: ArrayLike, diameter: float) -> bool:
    """Tell whether these are good floats already, as they are in every cycle of a servo."""
    return (
        type(center) is tuple
        and len(center) == 2
        and type(center[0]) is type(center[1]) is type(diameter) is float
        and -MAX_DISTANCE <= center[0] <= MAX_DISTANCE
        and -MAX_DISTANCE <= center[1] <= MAX_DISTANCE
        and MIN_DIAMETER <= diameter <= MAX_DISTANCE
    )
