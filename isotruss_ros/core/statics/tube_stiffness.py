# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stiffness of inflated tubes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol, TypeAlias

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
from isotruss_ros.core.model.stiffness_law import Law, read_laws
from isotruss_ros.core.model.topology import check_names
from isotruss_ros.core.numerics.arrays import Array, finite_array, MAX_MAGNITUDE
from isotruss_ros.core.numerics.tolerances import EPSILON, ROUNDING
import numpy as np
from numpy.typing import ArrayLike

# Section stiffness of the inflated tube: interface of the models, and the default model.
#
# All lengths are those of whole members, from pinch point to pinch point.

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


# Stiffness models of the inflated tube, for the block `stiffness` of robot files.
#
# A model maps lengths and gauge pressures to the section stiffness EA, EI, GA of Timoshenko beams.
# Lengths are lengths of whole members from pinch point to pinch point. Each piece has the section
# stiffness of its member, so the stiffness of a member does not depend on the points at which the
# member is cut. See docs/tube_stiffness.md.


@dataclass(frozen=True)
class Section:
    """
    Constant EA, EI and GA for all lengths, given at one pressure.

    At other pressures, EI changes by the change of P R^2 / 2, and GA by the change of P, where P =
    p pi R^2 as in `InflatableBeam`.
    """

    axial_rigidity: float  #: EA [N]
    flexural_rigidity: float  #: EI [N m^2]
    shear_rigidity: float  #: GA [N]
    radius: float  #: tube radius R [m]
    pressure: float  #: gauge pressure at which EA, EI and GA are given [Pa]
    fabric: ClassVar[None] = None

    def section_stiffness(self, length: ArrayLike, pressure: ArrayLike) -> SectionStiffness:
        """Return EA, EI and GA, equal for all lengths; see `TubeStiffness.section_stiffness`."""
        length, pressure = broadcast_members(length, pressure)
        pull = (pressure - self.pressure) * np.pi * self.radius**2
        flexural = self.flexural_rigidity + 0.5 * pull * self.radius**2
        shear = self.shear_rigidity + pull
        is_valid = (flexural > 0.0) & (shear > 0.0)
        if not is_valid.all():
            k = int(np.argmin(is_valid))
            raise StructureError(
                f'stiffness model section, given at {self.pressure:g} Pa: at '
                f'{pressure[k]:g} Pa it has EI = {flexural[k]:.4g} N m^2 and '
                f'GA = {shear[k]:.4g} N: must be positive'
            )
        return SectionStiffness(np.full_like(length, self.axial_rigidity), flexural, shear)

    @classmethod
    def of_block(cls, block: Mapping[str, Any], description: RobotDescription) -> Section:
        """Return the section of a block; without pressure it holds at that of the first tube."""
        at = {'pressure': next(iter(description.pressures.values()))}
        return cls(**as_floats(at | dict(block)), radius=0.5 * description.tube_diameter)


@dataclass(frozen=True)
class PowerLaw:
    """
    Measured stiffnesses at the ends of a member, as power laws of pressure and length.

    The other end is fixed; across the tube, so is the other motion of the loaded end.
    """

    axial: Law  #: axial force over displacement of a pinch point [N/m]
    transverse: Law  #: transverse force over displacement of a tube's end at a guide ring [N/m]
    rotary: Law  #: moment over rotation of a tube's end at a guide ring [N m/rad]
    guide_ring_distance: float  #: distance g of each guide ring from its pinch point [m]
    fabric: ClassVar[None] = None

    def _end_stiffnesses(self, length: Array, pressure: Array) -> tuple[Array, Array, Array]:
        """Return k_axial, k_transverse and k_rotary of whole members, each (k,)."""
        ring_span = length - 2.0 * self.guide_ring_distance
        if (ring_span <= 0.0).any():
            raise StructureError(
                f'a member of {length[ring_span <= 0.0][0]:.6g} m does not hold its guide rings, '
                f'{self.guide_ring_distance:g} m from its ends: no stiffness law applies'
            )
        stiffnesses = []
        for mode, span in (('axial', length), ('transverse', ring_span), ('rotary', ring_span)):
            law: Law = getattr(self, mode)
            stiffness = law.stiffness(span, pressure)
            is_valid = (stiffness >= 1.0 / MAX_MAGNITUDE) & (stiffness <= MAX_MAGNITUDE)
            if not is_valid.all():
                k = int(np.argmin(is_valid))
                raise StructureError(
                    f'stiffness law {mode}: C = {law.C:g}, a = {law.a:g}, b = {law.b:g} gives '
                    f'{stiffness[k]:g} for {_case(length[k], pressure[k])}: '
                    f'must be from {1.0 / MAX_MAGNITUDE:g} to {MAX_MAGNITUDE:g}; '
                    'laws are in SI units'
                )
            stiffnesses.append(stiffness)
        return stiffnesses[0], stiffnesses[1], stiffnesses[2]

    def section_stiffness(self, length: ArrayLike, pressure: ArrayLike) -> SectionStiffness:
        """
        Return the EA, EI and GA of beams that have the measured end stiffnesses.

        With the length L from pinch point to pinch point and l = L - 2 g from guide ring to guide
        ring, it solves k_axial = EA/L, k_transverse = 12 EI / (l^3 (1 + phi)) and k_rotary = (4 +
        phi) EI / (l (1 + phi)), where phi = 12 EI / (GA l^2).
        """
        length, pressure = broadcast_members(length, pressure)
        axial, transverse, rotary = self._end_stiffnesses(length, pressure)
        span = length - 2.0 * self.guide_ring_distance
        ratio = 12.0 * rotary / (transverse * span**2)
        is_beam = ratio >= 4.0 * (1.0 - ROUNDING)
        if not is_beam.all():
            k = int(np.argmin(is_beam))
            raise StructureError(
                f'stiffness laws: for {_case(length[k], pressure[k])} the transverse stiffness '
                f'is {transverse[k]:.6g} N/m and the rotary one {rotary[k]:.6g} N m/rad, which '
                f'no beam has: with l = {span[k]:.6g} m from ring to ring the rotary one '
                'must be at least l^2/3 times the transverse one, '
                f'{transverse[k] * span[k] ** 2 / 3.0:.6g} N m/rad'
            )
        # A ratio that exceeds 4 only by rounding means no shear deformation.
        phi = np.where(ratio > 4.0 * (1.0 + ROUNDING), ratio - 4.0, 0.0)
        flexural = transverse * span**3 * (1.0 + phi) / 12.0
        shear = np.full_like(length, np.inf)
        np.divide(12.0 * flexural, phi * span**2, out=shear, where=phi > 0.0)
        return SectionStiffness(axial * length, flexural, shear)

    @classmethod
    def of_block(cls, block: Mapping[str, Any], description: RobotDescription) -> PowerLaw:
        """Return the power laws of a robot file; see `TubeStiffness.of_block`."""
        return cls(**read_laws(block), guide_ring_distance=description.module.guide_ring_distance)


@dataclass(frozen=True)
class TubeSections:
    """Section stiffness of a tube: the stiffness of a model times a measured factor."""

    model: TubeStiffness  #: the stiffness model
    scale: float = 1.0  #: ratio of the tube's true stiffness to the modelled one [-]

    def section_stiffness(self, length: ArrayLike, pressure: ArrayLike) -> SectionStiffness:
        """Return the scaled stiffness of the model; see `TubeStiffness.section_stiffness`."""
        sections = self.model.section_stiffness(length, pressure)
        return SectionStiffness(*(self.scale * rigidity for rigidity in sections))

    def flexibility_rates(self, length: Array, pressure: Array) -> tuple[Array, Array]:
        """Return the derivatives (3, k) of 1/EA, 1/EI and 1/GA by length and by pressure."""
        # This step minimises the error, which is about step^2 + EPSILON / step.
        step = EPSILON ** (1.0 / 3.0)
        changes = step * np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]])[:, :, None]
        varied = (np.array([length, pressure])[:, None] * (1.0 + changes)).reshape(2, -1)
        flexibility = 1.0 / np.array(self.section_stiffness(*varied)).reshape(3, 4, -1)
        longer, shorter, inflated, deflated = flexibility.swapaxes(0, 1)
        by_length = (longer - shorter) / (2.0 * step * length)
        return by_length, (inflated - deflated) / (2.0 * step * pressure)


#: Stiffness models by their names in robot files.
MODELS: dict[str, type[TubeStiffness]] = {
    'inflatable_beam': InflatableBeam,
    'power_law': PowerLaw,
    'section': Section,
}


def tube_stiffness(description: RobotDescription) -> TubeSections:
    """Return the stiffness model that a robot file describes."""
    block, scale = dict(description.stiffness), description.stiffness_scale
    model = MODELS[block.pop('model')].of_block(block, description)
    return TubeSections(model, scale)


def _case(length: float, pressure: float) -> str:
    return f'a member of {length:.6g} m at {pressure:.6g} Pa'
