# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Section stiffness of the inflated tube: interface of the models, and the default model.

All lengths are those of whole members, from pinch point to pinch point.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, TypeAlias

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.model.description import RobotDescription
from isotruss_ros.core.model.inflated_section import (
    END_SOFTENING,
    inflated_section,
    MEMBRANE_MODULUS,
    MEMBRANE_SHEAR_MODULUS,
    SectionStiffness,
)
from isotruss_ros.core.model.robot_schema import plausible_range
from isotruss_ros.core.model.topology import check_names
from isotruss_ros.core.numerics.arrays import Array, finite_array
import numpy as np
from numpy.typing import ArrayLike

#: Gauge pressure [Pa], given as one number for all tubes, as one number for each tube in the order
#: of the robot file, or as a mapping from tube names to pressures.
Pressure: TypeAlias = 'ArrayLike | Mapping[str, float]'


class Fabric(NamedTuple):
    """Elastic constants E t and G t of the tube's wall of thickness t."""

    membrane_modulus: float  #: E t [N/m]
    membrane_shear_modulus: float  #: G t [N/m]


class TubeStiffness(Protocol):
    """Protocol of the stiffness models of a tube."""

    @property
    def fabric(self) -> Fabric | None:
        """Return the elastic constants of the wall; None if the model has none."""

    def section_stiffness(self, length: ArrayLike, pressure: ArrayLike) -> SectionStiffness:
        """
        Return the section stiffness of whole members.

        :param length: (k,) lengths from pinch point to pinch point [m].
        :param pressure: (k,) gauge pressures, or one pressure for all [Pa].
        :raises StructureError: no stiffness exists at this length and pressure.
        """

    @classmethod
    def of_block(cls, block: Mapping[str, Any], description: RobotDescription) -> TubeStiffness:
        """
        Return the stiffness model that the block `stiffness` of a robot file describes.

        :param block: checked block `stiffness` of the robot file without the name of the model.
        :param description: description of the robot.
        """


@dataclass(frozen=True)
class InflatableBeam:
    """
    Theoretical inflatable beam of Le Van and Wielgosz, with pinched ends.

    EI and GA are those of their theory (Thin-Walled Structures 43 (2005) 1166-1187 and 45 (2007)
    221-236). With the axial force P = p pi R^2 of the pressure, EI = (E + P/S0) I0 and GA = P +
    kappa G S0, where S0 = 2 pi R t and I0 = pi R^3 t.

    For EA, it is assumed that the wall and both ends act in series, 1/k_axial = L/(E t 2 pi R) +
    2/(c p R). A pinched end changes its shape without stretching the fabric, so only the pressure
    resists. The default c is computed for a pillow: two inextensible sheets of length pi R/2 run
    from the pinch line to the tube, which they meet tangentially at the distance R from the axis.
    Under an axial force F both sheets are arcs of radius rho = R + F/(pi R p) and angle alpha with
    cos alpha = 1 - R/rho. The length of the end is rho (sin alpha - alpha) + const.; its
    derivative at F = 0 gives c = 2 pi/(4 - pi).
    """

    radius: float  #: tube radius R [m]
    membrane_modulus: float = MEMBRANE_MODULUS  #: E t [N/m]
    membrane_shear_modulus: float = MEMBRANE_SHEAR_MODULUS  #: G t [N/m]
    end_softening: float = END_SOFTENING  #: factor c of the stiffness c p R of a pinched end [-]

    @property
    def fabric(self) -> Fabric:
        """Return the elastic constants E t and G t of the tube's wall."""
        return Fabric(self.membrane_modulus, self.membrane_shear_modulus)

    def section_stiffness(self, length: ArrayLike, pressure: ArrayLike) -> SectionStiffness:
        """Return EA, EI and GA for each length; see `TubeStiffness.section_stiffness`."""
        length, pressure = broadcast_members(length, pressure)
        constants = (self.membrane_modulus, self.membrane_shear_modulus, self.end_softening)
        return inflated_section(self.radius, *constants, length, pressure)

    @classmethod
    def of_block(cls, block: Mapping[str, Any], description: RobotDescription) -> InflatableBeam:
        """Return the beam that a robot file describes; see `TubeStiffness.of_block`."""
        return cls(0.5 * description.tube_diameter, **as_floats(block))


def broadcast_members(length: ArrayLike, pressure: ArrayLike) -> tuple[Array, Array]:
    """Return lengths (k,) [m] and pressures, of each member or of all [Pa], as arrays (k,)."""
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
    """Return the gauge pressures (t,) of the tubes [Pa]; None: those of the robot file."""
    pressures = dict(description.pressures)
    if pressure is None:
        return tuple(pressures.values())
    if isinstance(pressure, Mapping):
        check_names('pressure of tube', pressure, pressures, description.name, StructureError)
        pressures |= pressure
    else:
        # As an array of objects; values that are not numbers are refused below for each tube.
        value = np.asarray(pressure, dtype=object)
        if value.ndim > 0 and value.shape != (len(pressures),):
            raise StructureError(
                f'pressure: {value.size} values: must be one for all tubes, or one for each of '
                f'{", ".join(pressures)}'
            )
        values = np.broadcast_to(value, len(pressures)).tolist()
        pressures = dict(zip(pressures, values, strict=True))
    lowest, highest = plausible_range('tube.pressure')
    for tube, value in pressures.items():
        what = f'gauge pressure of tube {tube} [Pa]'
        (pressures[tube],) = finite_array([value], 1, what, StructureError).tolist()
        if not lowest <= pressures[tube] <= highest:
            raise StructureError(f'{what}: {value!r}: must be from {lowest:g} to {highest:g}')
    return tuple(pressures.values())


def as_floats(block: Mapping[str, Any]) -> dict[str, float]:
    """Return a block of a robot file with floats, which unlike integers overflow to infinity."""
    return {key: float(value) for key, value in block.items()}
