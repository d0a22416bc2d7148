# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Guesses of the unit in which a value outside of its range may have been given."""

from __future__ import annotations

from collections.abc import Mapping

#: For each SI unit, other forms of the same quantity, with size and offset of their values in the
#: SI unit.
UNITS: dict[str, dict[str, tuple[float, float]]] = {
    '': {'in percent': (1e-2, 0.0)},
    'm': {'in cm': (1e-2, 0.0), 'in mm': (1e-3, 0.0)},
    'm/s': {'in cm/s': (1e-2, 0.0), 'in mm/s': (1e-3, 0.0)},
    'kg': {'in g': (1e-3, 0.0)},
    'kg/m': {'in g/m': (1e-3, 0.0)},
    'rad': {'in degrees': (0.017453292519943295, 0.0)},
    'Pa': {
        'in kPa': (1e3, 0.0),
        'in psi': (6894.757, 0.0),
        'in bar': (1e5, 0.0),
        'absolute': (1.0, -101325.0),
    },
    'N': {'in kN': (1e3, 0.0)},
    'N/m': {'in kN/m or N/mm': (1e3, 0.0), 'in N/cm': (1e2, 0.0)},
    'N m/rad': {'in N mm/rad': (1e-3, 0.0), 'in N m/degree': (57.29577951308232, 0.0)},
    'N m^2': {'in kN m^2': (1e3, 0.0), 'in N cm^2': (1e-4, 0.0), 'in N mm^2': (1e-6, 0.0)},
}


def likely_unit(
    value: float,
    unit: str,
    low: float,
    high: float,
    others: Mapping[str, tuple[float, float]] | None = None,
) -> str:
    """Return a clause such as `; if it is in cm, it is 0.102 m`, or none if no unit fits."""
    fitting = [
        f'if it is {form}, it is {float(f"{size * value + offset:.4g}"):g} {unit}'.rstrip()
        for form, (size, offset) in {**UNITS.get(unit, {}), **(others or {})}.items()
        if low <= size * value + offset <= high and value != 0.0
    ]
    return f'; {", ".join(fitting)}' if fitting else ''
