# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Measured stiffness laws k = C p^a L^b of a robot file, and a check whether a beam has such laws.

In the axial law, L is the length of a member from pinch point to pinch point. In the transverse
and the rotary laws, L is the length of tube from guide ring to guide ring (section III-A of the
paper).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from isotruss_ros.core.model.description import RobotDescription
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.tolerances import ROUNDING
import numpy as np


class Law(NamedTuple):
    """Power law k = C p^a L^b of the stiffness at a member's end, in SI units."""

    C: float  #: factor C
    a: float  #: exponent of the gauge pressure
    b: float  #: exponent of the length

    def stiffness(self, length: Array, pressure: Array) -> Array:
        """Return the stiffness [N/m or N m/rad]; zero after underflow, infinite after overflow."""
        with np.errstate(over='ignore', under='ignore'):
            return np.exp(np.log(self.C) + self.a * np.log(pressure) + self.b * np.log(length))


def read_laws(block: Mapping[str, Any]) -> dict[str, Law]:
    """Return the axial, transverse and rotary power laws from a checked block `stiffness`."""
    modes = ('axial', 'transverse', 'rotary')
    # As floats: YAML also has integers, which overflow differently.
    return {mode: Law(**{key: float(x) for key, x in block[mode].items()}) for mode in modes}


def find_contradictions(file: RobotDescription) -> Iterator[str]:
    """
    Yield a fault for lengths and pressures at which no beam has the stiffnesses of the laws.

    For a beam, the ratio 12 k_rotary / (k_transverse L^2) is 4 + 12 EI / (GA L^2), so at least 4.
    This ratio of power laws is itself a power law of the length, so its logarithm is linear in
    the logarithm of the length. If it is at least 4 at both ends of a range of lengths, it is at
    least 4 in between, and the length at which it is 4 follows in closed form.
    """
    limits, both_rings = (file.min_length, file.max_length), 2.0 * file.module.guide_ring_distance
    if limits[0] <= both_rings:
        yield (
            f'members.min_length: {limits[0]}: must be more than twice '
            f'module.guide_ring_distance, {both_rings:g} m: the transverse and rotary stiffness '
            'laws are those of the tube between guide rings'
        )
        return

    # log(ratio) = log_factor + pressure_exponent log(p) + length_exponent log(L).
    laws = read_laws(file.stiffness)
    transverse, rotary = laws['transverse'], laws['rotary']
    pressure_exponent, length_exponent = rotary.a - transverse.a, rotary.b - transverse.b - 2.0
    log_factor = np.log(12.0) + np.log(rotary.C) - np.log(transverse.C)
    log_lengths = np.log(np.array(limits) - both_rings)
    log_bound = np.log(4.0) + np.log1p(-ROUNDING)
    for tube, pressure in file.pressures.items():
        log_ratio = log_factor + pressure_exponent * np.log(pressure)  # at 1 m
        short_fails, long_fails = log_ratio + length_exponent * log_lengths < log_bound
        if not (short_fails or long_fails):
            continue

        where = 'at every length of a member'
        if not (short_fails and long_fails):
            length = float(np.exp((log_bound - log_ratio) / length_exponent))
            where = (
                f'{"below" if short_fails else "above"} {length:.6g} m from ring to ring, '
                f'{length + both_rings:.6g} m from pinch to pinch'
            )
        yield (
            f'tube.stiffness: the transverse and rotary laws contradict each other {where}, '
            f'at {pressure:g} Pa in tube {tube}: no beam has a rotary stiffness less than L^2/3 '
            f'times the transverse one; members are from {limits[0]} to {limits[1]} m long. Fit '
            'all modes together (fit_tube_stiffness), or bring members.min_length and '
            'members.max_length to where the laws hold'
        )
