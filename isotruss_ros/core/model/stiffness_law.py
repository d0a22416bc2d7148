# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Measured stiffness laws k = C p^a L^b of a robot file, and where they contradict each other.

The axial law is that of a member pinched between two roller modules: L is its length from pinch to
pinch. The transverse and the rotary law are those of a tube held by guide rings: L is the length
from ring to ring (section III-A of the paper).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: What is beyond comes from constants in other units, and overflows in products.
MIN_STIFFNESS, MAX_STIFFNESS = 1e-30, 1e30
#: 12 k_rotary / (k_transverse L^2) less than 4 by no more than this is 4 but for rounding.
RATIO_TOLERANCE = 1e-9


class Law(NamedTuple):
    """An end stiffness k = C p^a L^b, all in SI units."""

    C: float  #: factor
    a: float  #: exponent of the gauge pressure
    b: float  #: exponent of the length

    def stiffness(self, length: Array, pressure: Array) -> Array:
        """
        Return k; zero or infinite where it leaves the range of numbers.

        :param length: (k,) pinch to pinch for an axial law, ring to ring for the others [m].
        :param pressure: (k,) gauge [Pa].
        :return: (k,) [N/m], rotary [N m/rad].
        """
        with np.errstate(over='ignore', under='ignore'):
            return np.exp(np.log(self.C) + self.a * np.log(pressure) + self.b * np.log(length))


def read_laws(block: Mapping[str, Any]) -> dict[str, Law]:
    """
    Return the laws of a block `stiffness` with the model power_law, by mode.

    :param block: of a robot file, checked for its form.
    """
    modes = ('axial', 'transverse', 'rotary')
    # As floats: YAML also has integers, which overflow differently.
    return {mode: Law(**{key: float(x) for key, x in block[mode].items()}) for mode in modes}


def find_contradictions(
    laws: Mapping[str, Law],
    pressures: Mapping[str, float],
    limits: tuple[float, float],
    ring: float,
) -> Iterator[str]:
    """
    Yield where laws have no stiffness, or one that no beam has.

    A beam's ratio 12 k_rotary / (k_transverse L^2) is 4 + 12 EI / (GA L^2), so at least 4. The
    ratio of two power laws is a power law: if it is 4 or more at both ends of a range of lengths
    it is so between them, and where it falls below 4 follows in closed form.

    :param laws: axial, transverse and rotary.
    :param pressures: gauge, by tube [Pa].
    :param limits: shortest and longest member, pinch to pinch [m].
    :param ring: g, from a pinch point to its guide ring [m].
    """
    if limits[0] <= 2.0 * ring:
        yield (
            f'members.min_length: {limits[0]}: must be more than twice '
            f'module.guide_ring_distance, {2.0 * ring:g} m: the transverse and rotary stiffness '
            'laws are those of the tube between guide rings'
        )
        return
    for tube, pressure in pressures.items():
        case = f'at {pressure:g} Pa in tube {tube}'
        for mode, law in laws.items():
            for limit in limits:
                length = limit if mode == 'axial' else limit - 2.0 * ring
                k = float(law.stiffness(np.array(length), np.array(pressure)))
                if not MIN_STIFFNESS <= k <= MAX_STIFFNESS:
                    yield (
                        f'tube.stiffness.{mode}: C = {law.C:g}, a = {law.a:g}, b = {law.b:g} '
                        f'gives {k:g} for a length of {length:.6g} m {case}: must be from '
                        f'{MIN_STIFFNESS:g} to {MAX_STIFFNESS:g}; laws are in SI units'
                    )
                    return
        yield from _contradiction(laws, pressure, limits, ring, case)


def _contradiction(
    laws: Mapping[str, Law], pressure: float, limits: tuple[float, float], ring: float, case: str
) -> Iterator[str]:
    """Yield from which length on, or up to which, no beam has both stiffnesses."""
    transverse, rotary = laws['transverse'], laws['rotary']
    slope = rotary.b - transverse.b - 2.0
    level = (
        np.log(12.0)
        + np.log(rotary.C)
        - np.log(transverse.C)
        + (rotary.a - transverse.a) * np.log(pressure)
    )
    between = np.array(limits) - 2.0 * ring
    least = np.log(4.0) + np.log1p(-RATIO_TOLERANCE)
    short, long = level + slope * np.log(between) < least
    if not (short or long):
        return
    if short and long:
        where = 'at every length of a member'
    else:
        length = float(np.exp((least - level) / slope))
        where = (
            f'{"below" if short else "above"} {length:.6g} m from ring to ring, '
            f'{length + 2.0 * ring:.6g} m from pinch to pinch'
        )
    yield (
        f'tube.stiffness: the transverse and rotary laws contradict each other {where}, {case}: '
        'no beam has a rotary stiffness less than L^2/3 times the transverse one; members are '
        f'from {limits[0]} to {limits[1]} m long. Fit all modes together (fit_tube_stiffness), '
        'or bring members.min_length and members.max_length to where the laws hold'
    )
