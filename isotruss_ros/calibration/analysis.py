# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""From measurements to a tube: slopes of all groups, one beam, its local stiffness, power laws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from isotruss_ros.calibration.beam_fit import fit_beam, FittedBeam
from isotruss_ros.calibration.law import fit_law, FittedLaw
from isotruss_ros.calibration.linear_range import fit_slope, Slope, TOLERANCE
from isotruss_ros.calibration.local_fit import fit_local_stiffness, FittedLocalStiffness
from isotruss_ros.calibration.measurements import (
    MeasurementError,
    Measurements,
    MODES,
    Presses,
)
import numpy as np

#: Of the tube of the paper and of the presets [m].
DIAMETER = 0.102


@dataclass(frozen=True)
class Analysis:
    """What was fitted."""

    slopes: Mapping[str, Sequence[Slope]]  #: of all groups that have one, by mode
    fitted: FittedBeam | None  #: nearest to the slopes of all modes; None if there is none
    refusal: str  #: why there is no beam; empty if there is one
    local: FittedLocalStiffness | None  #: None without such points, or if undetermined
    local_refusal: str  #: why there is none; empty if there is one, or no such points
    laws: Mapping[str, FittedLaw]  #: Table I: power laws by mode, each on its own
    missing: Mapping[str, str]  #: by mode, why there is no power law
    unused: Mapping[str, Sequence[int]]  #: lines of the rows that no slope rests on, by why

    def points(self, mode: str) -> int:
        """
        Return how many measured points the slopes of a mode rest on.

        :param mode: axial, transverse or rotary.
        """
        return sum(int(slope.used.sum()) for slope in self.slopes[mode])


def analyse(
    measurements: Measurements,
    diameter: float = DIAMETER,
    tolerance: float = TOLERANCE,
    max_displacements: Mapping[str, float] | None = None,
) -> Analysis:
    """
    Fit slopes, the beam, and power laws beside it.

    :param measurements: groups of points; lengths are pinch to pinch in the axial mode, and guide
        ring to guide ring in the others [m].
    :param diameter: of the tube [m].
    :param tolerance: see linear_range.TOLERANCE.
    :param max_displacements: linear range of some modes, instead of the test for one [m or rad].
    """
    ranges = max_displacements or {}
    slopes: dict[str, list[Slope]] = {mode: [] for mode in MODES}
    unused = {reason: list(lines) for reason, lines in measurements.unused.items()}
    for group in measurements.groups:
        slope = fit_slope(group, tolerance, ranges.get(group.mode))
        for reason in sorted(set(slope.reasons) - {''}):
            lines = group.lines[np.array(slope.reasons) == reason]
            unused.setdefault(reason, []).extend(lines.tolist())
        if slope.used.any():
            slopes[group.mode].append(slope)
    fitted, refusal = None, ''
    try:
        fitted = _beam(slopes, 0.5 * diameter)
    except MeasurementError as error:
        refusal = str(error)
    local, local_refusal = None, ''
    if len(measurements.presses.loads):
        try:
            local = _local(measurements.presses, fitted)
        except MeasurementError as error:
            local_refusal = str(error)
    laws, missing = {}, {}
    for mode, found in slopes.items():
        try:
            laws[mode] = _law(found)
        except MeasurementError as error:
            missing[mode] = str(error)
    return Analysis(slopes, fitted, refusal, local, local_refusal, laws, missing, unused)


def _beam(slopes: Mapping[str, Sequence[Slope]], radius: float) -> FittedBeam:
    found = [slope for mode in MODES for slope in slopes[mode]]
    return fit_beam(
        np.array([MODES.index(slope.group.mode) for slope in found], dtype=np.intp),
        np.array([slope.group.length for slope in found]),
        np.array([slope.group.pressure for slope in found]),
        np.array([slope.stiffness for slope in found]),
        radius,
    )


def _local(presses: Presses, fitted: FittedBeam | None) -> FittedLocalStiffness:
    if fitted is None:
        raise MeasurementError('no beam was fitted, and interference bends the tube as well')
    return fit_local_stiffness(presses, fitted.beam)


def _law(slopes: Sequence[Slope]) -> FittedLaw:
    if not slopes:
        raise MeasurementError(
            'no points that can be used; a slope needs several of one trial, pressure and length'
        )
    return fit_law(
        np.array([slope.group.pressure for slope in slopes]),
        np.array([slope.group.length for slope in slopes]),
        np.array([slope.stiffness for slope in slopes]),
    )
