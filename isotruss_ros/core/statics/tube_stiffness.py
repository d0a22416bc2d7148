# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
How stiff the inflated tube is: the models of the block `stiffness` of robot files.

Each turns lengths and gauge pressures into the section stiffness EA, EI, GA of Timoshenko beams. A
length is that of a whole member, pinch to pinch: its pieces inherit the section stiffness of the
member, so that cutting it changes nothing at its ends. See docs/tube_stiffness.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.model.description import RobotDescription
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.power_law import PowerLaw
from isotruss_ros.core.statics.section import (
    broadcast_members,
    SectionStiffness,
)
import numpy as np
from numpy.typing import ArrayLike

#: E t and G t of the fabric [N/m]: the order of thin coated cloth, an assumption.
MEMBRANE_MODULUS = 6.0e4
MEMBRANE_SHEAR_MODULUS = 1.0e4
#: c of k_end = c p R, from the pillow of `InflatableBeam`: theory.
END_SOFTENING = 2.0 * np.pi / (4.0 - np.pi)
#: Shear coefficient of a thin circular tube.
KAPPA = 0.5


class Fabric(NamedTuple):
    """
    The elastic constants of the tube's wall; its thickness is part of them.

    :ivar membrane_modulus: E t [N/m].
    :ivar membrane_shear_modulus: G t [N/m].
    """

    membrane_modulus: float
    membrane_shear_modulus: float


class TubeStiffness(Protocol):
    """What the models have in common."""

    @property
    def fabric(self) -> Fabric | None:
        """Return the constants of the wall; None where the model has beam stiffnesses only."""

    def section_stiffness(self, length: ArrayLike, pressure: ArrayLike) -> SectionStiffness:
        """
        Return the section stiffness of whole members.

        :param length: (k,) pinch to pinch [m].
        :param pressure: (k,) or one for all, gauge [Pa].
        :raises StructureError: no stiffness belongs to this length and pressure.
        """

    def flexibility_rates(self, length: Array, pressure: Array) -> tuple[Array, Array]:
        """
        Return the derivatives of 1 / EA, 1 / EI and 1 / GA of whole members, (3, k) each.

        :param length: (k,) pinch to pinch [m].
        :param pressure: (k,) gauge [Pa].
        :return: per length [1/m], and per gauge pressure [1/Pa].
        """

    @classmethod
    def of_block(cls, block: Mapping[str, Any], description: RobotDescription) -> TubeStiffness:
        """
        Return the model that a robot file describes.

        :param block: `stiffness` of the file without the name of the model; of checked form.
        :param description: all that the file says.
        """


@dataclass(frozen=True)
class Section:
    """
    EA, EI and GA as given, for any length, at one pressure.

    At another pressure EI and GA differ by what its pull P = p pi R^2 adds to them in the theory
    of `InflatableBeam`: P R^2 / 2 and P.

    :param axial_rigidity: EA [N].
    :param flexural_rigidity: EI [N m^2].
    :param shear_rigidity: GA [N].
    :param radius: R [m].
    :param pressure: at which the three numbers hold, gauge [Pa].
    """

    axial_rigidity: float
    flexural_rigidity: float
    shear_rigidity: float
    radius: float
    pressure: float
    fabric: ClassVar[None] = None

    def section_stiffness(self, length: ArrayLike, pressure: ArrayLike) -> SectionStiffness:
        """
        Return the three numbers for each length; see `TubeStiffness.section_stiffness`.

        :raises StructureError: at so low a pressure the three numbers leave nothing.
        """
        length, pressure = broadcast_members(length, pressure)
        pull = (pressure - self.pressure) * np.pi * self.radius**2
        flexural = self.flexural_rigidity + 0.5 * pull * self.radius**2
        shear = self.shear_rigidity + pull
        wrong = (flexural <= 0.0) | (shear <= 0.0)
        if wrong.any():
            at = int(np.argmax(wrong))
            raise StructureError(
                f'stiffness model section: its numbers hold at {self.pressure:g} Pa; at '
                f'{pressure[at]:g} Pa they leave EI = {flexural[at]:.4g} N m^2 and '
                f'GA = {shear[at]:.4g} N: must be positive'
            )
        return SectionStiffness(np.full_like(length, self.axial_rigidity), flexural, shear)

    def flexibility_rates(self, length: Array, pressure: Array) -> tuple[Array, Array]:
        """Return how 1 / EA, 1 / EI, 1 / GA change; see `TubeStiffness.flexibility_rates`."""
        _, flexural, shear = self.section_stiffness(length, pressure)
        none, area = np.zeros_like(length), np.pi * self.radius**2
        bending = -0.5 * area * self.radius**2 / flexural**2
        return np.array([none, none, none]), np.array([none, bending, -area / shear**2])

    @classmethod
    def of_block(cls, block: Mapping[str, Any], description: RobotDescription) -> Section:
        """
        Return the three numbers of a robot file; see `TubeStiffness.of_block`.

        Without a pressure of their own they hold at that of the file, one for all tubes.
        """
        at = {'pressure': next(iter(description.pressures.values()))}
        return cls(**_as_floats(at | dict(block)), radius=0.5 * description.tube_diameter)


@dataclass(frozen=True)
class InflatableBeam:
    """
    Theory, not a measurement: the inflatable beam of Le Van and Wielgosz, with pinched ends.

    EI and GA are theirs (Thin-Walled Structures 43 (2005) 1166-1187 and 45 (2007) 221-236). The
    pressure pulls with P = p pi R^2, EI = (E + P/S0) I0 and GA = P + kappa G S0, S0 = 2 pi R t,
    I0 = pi R^3 t.

    EA is an assumption: the wall and both ends in series, k_axial^-1 = L/(E t 2 pi R) + 2/(c p R).
    A pinched end changes its shape and stretches no fabric, so that only the pressure makes it
    stiff. The default c is that of a pillow: two inextensible sheets pi R/2 wide that leave the
    pinch line and run into the tube tangentially, R from the axis. Under an end force F (pull)
    both are arcs of radius rho = R + F/(pi R p) over an angle alpha, cos alpha = 1 - R/rho. The
    end lengthens by rho (sin alpha - alpha) + const.; its slope at F = 0 gives c = 2 pi/(4 - pi).

    :param radius: R [m].
    :param membrane_modulus: E t [N/m].
    :param membrane_shear_modulus: G t [N/m].
    :param end_softening: c.
    """

    radius: float
    membrane_modulus: float = MEMBRANE_MODULUS
    membrane_shear_modulus: float = MEMBRANE_SHEAR_MODULUS
    end_softening: float = END_SOFTENING

    @property
    def fabric(self) -> Fabric:
        """Return E t and G t."""
        return Fabric(self.membrane_modulus, self.membrane_shear_modulus)

    def section_stiffness(self, length: ArrayLike, pressure: ArrayLike) -> SectionStiffness:
        """Return EA, by the length, and EI and GA; see `TubeStiffness.section_stiffness`."""
        length, pressure = broadcast_members(length, pressure)
        R = self.radius
        force = pressure * np.pi * R**2
        circumference = 2.0 * np.pi * R
        wall = self.membrane_modulus * circumference
        end = self.end_softening * pressure * R
        return SectionStiffness(
            axial=1.0 / (1.0 / wall + 2.0 / (end * length)),
            # The thickness cancels; fabrics do not state it.
            flexural=self.membrane_modulus * np.pi * R**3 + force * R**2 / 2.0,
            shear=force + KAPPA * self.membrane_shear_modulus * circumference,
        )

    def flexibility_rates(self, length: Array, pressure: Array) -> tuple[Array, Array]:
        """Return how 1 / EA, 1 / EI, 1 / GA change; see `TubeStiffness.flexibility_rates`."""
        _, flexural, shear = self.section_stiffness(length, pressure)
        none, area = np.zeros_like(length), np.pi * self.radius**2
        ends = -2.0 / (self.end_softening * pressure * self.radius * length)
        bending = -0.5 * area * self.radius**2 / flexural**2
        by_pressure = np.array([ends / pressure, bending, -area / shear**2])
        return np.array([ends / length, none, none]), by_pressure

    @classmethod
    def of_block(cls, block: Mapping[str, Any], description: RobotDescription) -> InflatableBeam:
        """Return the beam of a robot file, or as assumed above; see `TubeStiffness.of_block`."""
        return cls(0.5 * description.tube_diameter, **_as_floats(block))


@dataclass(frozen=True)
class ScaledStiffness:
    """
    Sections that are stiffer than a model by a measured factor.

    :ivar model: the model.
    :ivar scale: stiffness against that of the model, positive [-].
    """

    model: TubeStiffness
    scale: float

    @property
    def fabric(self) -> Fabric | None:
        """Return the constants of the model's wall."""
        return self.model.fabric

    def section_stiffness(self, length: ArrayLike, pressure: ArrayLike) -> SectionStiffness:
        """Return those of the model, scaled; see `TubeStiffness.section_stiffness`."""
        sections = self.model.section_stiffness(length, pressure)
        return SectionStiffness(*(self.scale * each for each in sections))

    def flexibility_rates(self, length: Array, pressure: Array) -> tuple[Array, Array]:
        """Return how 1 / EA, 1 / EI, 1 / GA change; see `TubeStiffness.flexibility_rates`."""
        rates = self.model.flexibility_rates(length, pressure)
        return rates[0] / self.scale, rates[1] / self.scale


#: The models by their names in robot files.
MODELS: dict[str, type[TubeStiffness]] = {
    'inflatable_beam': InflatableBeam,
    'power_law': PowerLaw,
    'section': Section,
}


def tube_stiffness(description: RobotDescription) -> TubeStiffness:
    """
    Return the model that a robot file asks for.

    :param description: of the robot; its block `stiffness` was checked when the file was read.
    """
    block, scale = dict(description.stiffness), description.stiffness_scale
    model = MODELS[block.pop('model')].of_block(block, description)
    return model if scale == 1.0 else ScaledStiffness(model, scale)


def _as_floats(block: Mapping[str, Any]) -> dict[str, float]:
    """Return numbers of a block as floats: YAML also has integers, which overflow differently."""
    return {key: float(value) for key, value in block.items()}
