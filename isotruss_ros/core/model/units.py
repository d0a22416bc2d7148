# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Guesses of the unit in which a value outside of its range may have been given."""

from __future__ import annotations

#: For each SI unit, other units of the same quantity, with their values in the SI unit.
UNITS = {
    'm': {'cm': 1e-2, 'mm': 1e-3},
    'm/s': {'cm/s': 1e-2, 'mm/s': 1e-3},
    'kg': {'g': 1e-3},
    'kg/m': {'g/m': 1e-3},
    'Pa': {'kPa': 1e3, 'psi': 6894.757, 'bar': 1e5},
    'N': {'kN': 1e3},
    'N m^2': {'N cm^2': 1e-4, 'N mm^2': 1e-6},
}


def likely_unit(value: float, unit: str, low: float, high: float) -> str:
    """
    Return a clause that names the units in which a value would be within its range.

    :param value: value as written, outside of its range.
    :param unit: SI unit in which the value was read.
    :param low: smallest value of the range, in the SI unit.
    :param high: largest value of the range, in the SI unit.
    :return: clause, for example `; if it is in cm, it is 0.102 m`; empty if no unit is suitable.
    """
    fitting = [
        f'if it is in {name}, it is {float(f"{value * size:.4g}"):g} {unit}'
        for name, size in UNITS.get(unit, {}).items()
        if low <= value * size <= high and value != 0.0
    ]
    return f'; {", ".join(fitting)}' if fitting else ''
