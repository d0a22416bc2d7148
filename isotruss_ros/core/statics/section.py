# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Section stiffness of tube members, and the lengths and pressures that it belongs to."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.numerics.arrays import Array
import numpy as np
from numpy.typing import ArrayLike


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
