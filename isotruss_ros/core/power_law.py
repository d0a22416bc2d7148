"""The measured end stiffnesses of tube members, and the beams that have them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.rigidities import Array, members, Rigidities
import numpy as np

#: 12 k_rotary / (k_transverse L^2) less than 4 by no more than this is 4 but for rounding.
TOLERANCE = 1e-9
#: What is beyond comes from constants in other units, and overflows in products.
MIN_STIFFNESS, MAX_STIFFNESS = 1e-30, 1e30


class Law(NamedTuple):
    """An end stiffness k = C p^a L^b, all in SI units."""

    C: float
    a: float
    b: float

    def stiffness(self, length: Array, pressure: Array) -> Array:
        """Return k for each; zero or infinite where it leaves the range of numbers."""
        with np.errstate(over='ignore', under='ignore'):
            return np.exp(np.log(self.C) + self.a * np.log(pressure) + self.b * np.log(length))


@dataclass(frozen=True)
class PowerLaw:
    """
    Measured end stiffnesses of a member, each a law of pressure and length.

    :param axial: P / delta x, the other end held [N/m].
    :param transverse: V / delta y of one end, the rotations of both ends held [N/m].
    :param rotary: M / delta theta of one end, its translations and the other end held [N m/rad].
    """

    axial: Law
    transverse: Law
    rotary: Law

    def end_stiffnesses(self, length: Array, pressure: Array) -> tuple[Array, Array, Array]:
        """
        Return k_axial, k_transverse and k_rotary, each (k,).

        :raises StructureError: a law gives no stiffness of a tube; names length and pressure.
        """
        stiffnesses = []
        for mode in ('axial', 'transverse', 'rotary'):
            law: Law = getattr(self, mode)
            k = law.stiffness(length, pressure)
            wrong = ~((k >= MIN_STIFFNESS) & (k <= MAX_STIFFNESS))
            if wrong.any():
                at = int(np.argmax(wrong))
                raise StructureError(
                    f'stiffness law {mode}: C = {law.C:g}, a = {law.a:g}, b = {law.b:g} gives '
                    f'{k[at]:g} for {_case(length[at], pressure[at])}: '
                    f'must be from {MIN_STIFFNESS:g} to {MAX_STIFFNESS:g}; laws are in SI units'
                )
            stiffnesses.append(k)
        return stiffnesses[0], stiffnesses[1], stiffnesses[2]

    def rigidities(self, length: Array, pressure: Array | float) -> Rigidities:
        """
        Return what gives a Timoshenko beam of each length the measured end stiffnesses.

        The inverse of k_axial = EA/L, k_transverse = 12 EI / (L^3 (1 + phi)) and
        k_rotary = (4 + phi) EI / (L (1 + phi)), where phi = 12 EI / (GA L^2).

        :param length: (k,) of whole members [m].
        :param pressure: (k,) or one for all, gauge [Pa].
        :raises StructureError: no beam has such stiffnesses; names length and pressure.
        """
        length, pressure = members(length, pressure)
        axial, transverse, rotary = self.end_stiffnesses(length, pressure)
        ratio = 12.0 * rotary / (transverse * length**2)
        wrong = ratio < 4.0 * (1.0 - TOLERANCE)
        if wrong.any():
            at = int(np.argmax(wrong))
            raise StructureError(
                f'stiffness laws: for {_case(length[at], pressure[at])} the transverse stiffness '
                f'is {transverse[at]:.6g} N/m and the rotary one {rotary[at]:.6g} N m/rad, which '
                'no beam has: the rotary one must be at least L^2/3 times the transverse one, '
                f'{transverse[at] * length[at] ** 2 / 3.0:.6g} N m/rad'
            )
        # Within rounding of 4 there is no shear, not a rigidity of whatever the rounding leaves.
        phi = np.where(ratio > 4.0 * (1.0 + TOLERANCE), ratio - 4.0, 0.0)
        flexural = transverse * length**3 * (1.0 + phi) / 12.0
        shear = np.full_like(length, np.inf)
        np.divide(12.0 * flexural, phi * length**2, out=shear, where=phi > 0.0)
        return Rigidities(axial * length, flexural, shear)


def _case(length: float, pressure: float) -> str:
    return f'a member of {length:.6g} m at {pressure:.6g} Pa'
