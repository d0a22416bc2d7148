# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Section stiffness of an inflated tube, and checks of a robot file's stiffness.

Every plausible tube has a wall between rubber film and metal foil, and stretches its wall by a
few percent. The theory of the inflatable beam turns these limits into ranges of EA, EI and GA for
a diameter, a pressure and a length.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from isotruss_ros.core.model.description import RobotDescription
from isotruss_ros.core.model.robot_schema import plausible_range
from isotruss_ros.core.model.stiffness_law import find_contradictions, read_laws
from isotruss_ros.core.model.units import likely_unit
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.tolerances import SMALLEST_NORMAL
import numpy as np

#: Assumed E t and G t of the fabric [N/m], typical of thin coated cloth.
MEMBRANE_MODULUS = 6.0e4
MEMBRANE_SHEAR_MODULUS = 1.0e4
#: Theoretical factor c of the stiffness c p R of a pinched end, see `InflatableBeam` [-].
END_SOFTENING = 2.0 * np.pi / (4.0 - np.pi)
#: Largest strain p R / (E t) of the wall around the tube under the pressure [-]. Cloth breaks at
#: strains of 0.15 to 0.35 and is used below a third of its strength. With three times of this
#: bound, an absolute pressure passes as a gauge pressure; with a third of it, soft cloth at 50 kPa
#: is refused.
MAX_WALL_STRAIN = 0.1


class SectionStiffness(NamedTuple):
    """Axial, bending and shear stiffness EA, EI and GA of k Timoshenko beams."""

    axial: Array  #: (k,) EA [N]
    flexural: Array  #: (k,) EI [N m^2]
    shear: Array  #: (k,) GA [N]; infinite without shear deformation


def inflated_section(
    radius: float,
    membrane_modulus: float,
    membrane_shear_modulus: float,
    end_softening: float,
    length: Array,
    pressure: Array,
) -> SectionStiffness:
    """Return EA, EI and GA of inflated tubes of given lengths and gauge pressures."""
    pressure_force = pressure * np.pi * radius**2
    circumference = 2.0 * np.pi * radius
    wall_axial = membrane_modulus * circumference
    end_stiffness = end_softening * pressure * radius
    return SectionStiffness(
        # The wall in series with two pinched ends.
        axial=1.0 / (1.0 / wall_axial + 2.0 / (end_stiffness * length)),
        # The thickness t cancels.
        flexural=membrane_modulus * np.pi * radius**3 + pressure_force * radius**2 / 2.0,
        # The shear coefficient of a thin circular tube is 1/2.
        shear=pressure_force + 0.5 * membrane_shear_modulus * circumference,
    )


def find_stiffness_faults(file: RobotDescription) -> Iterator[str]:
    """Yield the faults of a robot file's stiffness at the file's lengths and pressures."""
    block, radius = file.stiffness, 0.5 * file.tube_diameter
    if block['model'] == 'inflatable_beam':
        modulus = float(block.get('membrane_modulus', MEMBRANE_MODULUS))
        yield from _overstretched('tube.pressure', max(file.pressures.values()), radius, modulus)
    elif block['model'] == 'section':
        yield from _implausible_section(block, radius, file.pressures, file.min_length)
        if 'pressure' not in block and len(set(file.pressures.values())) > 1:
            yield (
                "tube.stiffness: key 'pressure' is missing; where tubes have different pressures "
                'it is the gauge pressure at which the three numbers hold [Pa]'
            )
    elif block['model'] == 'power_law':
        has_spans = file.min_length > 2.0 * file.module.guide_ring_distance
        implausible = list(_implausible_laws(file, radius)) if has_spans else []
        yield from implausible or find_contradictions(file)


def _overstretched(key: str, pressure: float, radius: float, modulus: float) -> Iterator[str]:
    """Yield a fault if a pressure p [Pa] stretches the wall of modulus E t [N/m] too far."""
    highest = MAX_WALL_STRAIN * modulus / radius
    if pressure > highest:
        lowest, _ = plausible_range('tube.pressure')
        yield (
            f'{key}: {pressure:g}: must be at most {highest:.6g} Pa gauge, because the wall of '
            f'the block stiffness, E t = {modulus:.6g} N/m, is strained around by p R / (E t) = '
            f'{pressure * radius / modulus:.2g}, beyond {MAX_WALL_STRAIN:g}'
            f'{likely_unit(pressure, "Pa", lowest, highest)}'
        )


def _plausible_sections(
    radius: float, pressure: float, length: float, softening: float
) -> tuple[SectionStiffness, SectionStiffness]:
    """Return the smallest and the largest plausible EA, EI and GA of a member."""
    min_modulus, max_modulus = plausible_range('tube.stiffness.membrane_modulus')
    _, max_shear = plausible_range('tube.stiffness.membrane_shear_modulus')
    min_scale, _ = plausible_range('tube.stiffness_scale')
    min_modulus = max(min_modulus, pressure * radius / MAX_WALL_STRAIN)
    smallest = inflated_section(radius, min_modulus, 0.0, END_SOFTENING, length, pressure)
    largest = inflated_section(radius, max_modulus, max_shear, softening, length, pressure)
    return SectionStiffness(*(min_scale * stiffness for stiffness in smallest)), largest


def _implausible_section(
    block: Mapping[str, Any], radius: float, pressures: Mapping[str, float], length: float
) -> Iterator[str]:
    """Yield a fault for each of EA, EI and GA of the model `section` out of its range."""
    reference = float(block.get('pressure', next(iter(pressures.values()))))
    smallest, largest = _plausible_sections(radius, reference, length, np.inf)
    keys, units = ('axial_rigidity', 'flexural_rigidity', 'shear_rigidity'), ('N', 'N m^2', 'N')
    is_plausible = True
    for key, unit, low, high in zip(keys, units, smallest, largest, strict=True):
        value = float(block[key])
        if not low <= value <= high:
            is_plausible = False
            yield (
                f'tube.stiffness.{key}: {value:g}: must be from {low:.4g} to {high:.4g} '
                f'{unit} in a tube of {2.0 * radius:g} m at {reference:g} Pa'
                f'{likely_unit(value, unit, low, high)}'
            )

    if is_plausible:
        # The modulus of the wall from EI without the pressure's share, see `inflated_section`.
        with_pressure = float(block['flexural_rigidity']) / (np.pi * radius**3)
        modulus = max(with_pressure - 0.5 * reference * radius, SMALLEST_NORMAL)
        yield from _overstretched('tube.pressure', max(pressures.values()), radius, modulus)
        if 'pressure' in block:
            yield from _overstretched('tube.stiffness.pressure', reference, radius, modulus)


def _implausible_laws(file: RobotDescription, radius: float) -> Iterator[str]:
    """Yield a fault for the first law that gives an end stiffness out of its range."""
    laws = read_laws(file.stiffness)
    _, max_softening = plausible_range('tube.stiffness.end_softening')
    for tube, pressure in file.pressures.items():
        for member_length in (file.min_length, file.max_length):
            small, large = _plausible_sections(radius, pressure, member_length, max_softening)
            # Plausible end stiffnesses. Bending and shear act on the span between guide rings.
            span = member_length - 2.0 * file.module.guide_ring_distance
            axial_range = small.axial / member_length, large.axial / member_length
            # Timoshenko beam clamped at both ends.
            transverse_range = tuple(
                1.0 / (span**3 / (12.0 * beam.flexural) + span / beam.shear)
                for beam in (small, large)
            )
            # A beam with shear has a rotary stiffness from EI / l to 4 EI / l.
            rotary_range = small.flexural / span, 4.0 * large.flexural / span

            for mode, unit, length, (low, high) in (
                ('axial', 'N/m', member_length, axial_range),
                ('transverse', 'N/m', span, transverse_range),
                ('rotary', 'N m/rad', span, rotary_range),
            ):
                law = laws[mode]
                k = float(law.stiffness(np.array(length), np.array(pressure)))
                if not low <= k <= high:
                    in_kpa = float(law.stiffness(np.array(length), np.array(1e-3 * pressure)))
                    yield (
                        f'tube.stiffness.{mode}: C = {law.C:g}, a = {law.a:g}, b = {law.b:g} '
                        f'gives {k:g} {unit} for a length of {length:.6g} m at {pressure:g} Pa in '
                        f'tube {tube}: must be from {low:.4g} to {high:.4g}; laws are in SI units'
                        f'{likely_unit(k, unit, low, high, {"with p in kPa": (0.0, in_kpa)})}'
                    )
                    return
