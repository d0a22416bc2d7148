# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Section stiffness of tube members, and the lengths and gauge pressures that it belongs to."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.model.description import RobotDescription
from isotruss_ros.core.numerics.arrays import Array, finite_array
import numpy as np
from numpy.typing import ArrayLike

#: One gauge pressure for all tubes, one for each in the order of the robot file, or by tube name.
Pressure = ArrayLike | Mapping[str, float]


class SectionStiffness(NamedTuple):
    """
    EA, EI and GA of Timoshenko beams.

    :ivar axial: (k,) EA [N].
    :ivar flexural: (k,) EI [N m^2].
    :ivar shear: (k,) GA [N], infinite where nothing shears.
    """

    axial: Array
    flexural: Array
    shear: Array


def broadcast_members(length: ArrayLike, pressure: ArrayLike) -> tuple[Array, Array]:
    """
    Return lengths and gauge pressures as arrays (k,).

    :param length: (k,) [m].
    :param pressure: (k,) or one for all [Pa].
    :raises StructureError: a value is not a positive number; names the first.
    """
    length = np.atleast_1d(np.asarray(length, dtype=float))
    pressure = np.asarray(pressure, dtype=float)
    if pressure.shape != length.shape:
        pressure = np.broadcast_to(pressure, length.shape)
    for what, unit, values in (('length', 'm', length), ('gauge pressure', 'Pa', pressure)):
        wrong = ~((values > 0.0) & (values < np.inf))
        if wrong.any():
            raise StructureError(
                f'{what} of a tube member: {values[wrong][0]:g} {unit}: must be a positive number'
            )
    return length, pressure


def tube_pressures(
    description: RobotDescription, pressure: Pressure | None = None
) -> tuple[float, ...]:
    """
    Return the gauge pressure of each tube, in the order of the robot file.

    :param description: of the robot.
    :param pressure: gauge [Pa]: a number for all tubes, (t,) numbers in the order of the robot
        file, or a mapping from names of tubes, in which tubes may be missing; what is not given
        is as in the robot file.
    :return: (t,) [Pa].
    :raises StructureError: no such tube, another number of pressures than tubes, or a pressure
        that is not a positive number.
    """
    found = dict(description.pressures)
    if pressure is None:
        return tuple(found.values())
    if isinstance(pressure, Mapping):
        for tube in pressure:
            if tube not in found:
                raise StructureError(
                    f'pressure of tube {tube!r}: robot {description.name} has no such tube; '
                    f'its tubes are {", ".join(found)}'
                )
        found |= pressure
    else:
        # As objects: what is no number is refused below, by the name of its tube.
        each = np.asarray(pressure, dtype=object)
        if each.ndim > 0 and each.shape != (len(found),):
            raise StructureError(
                f'pressure: {each.size} values: must be one for all tubes, or one for each of '
                f'{", ".join(found)}'
            )
        found = dict(zip(found, np.broadcast_to(each, len(found)).tolist(), strict=True))
    for tube, value in found.items():
        what = f'gauge pressure of tube {tube} [Pa]'
        (found[tube],) = finite_array([value], 1, what, StructureError).tolist()
        if found[tube] <= 0.0:
            raise StructureError(f'{what}: {value!r}: must be a positive number')
    return tuple(found.values())
