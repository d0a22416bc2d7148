# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fits to measurements of a tube: stiffnesses, beam constants, local stiffness, power laws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import contextlib
from dataclasses import dataclass

from isotruss_ros.calibration.beam_fit import fit_beam, FittedBeam, outlying_ratios
from isotruss_ros.calibration.law import fit_law, FittedLaw
from isotruss_ros.calibration.linear_range import fit_slope, Slope, TOLERANCE
from isotruss_ros.calibration.local_fit import fit_local_stiffness, FittedLocalStiffness
from isotruss_ros.calibration.measurements import (
    DEFAULT_DIAMETER,
    Group,
    MeasurementError,
    Measurements,
    MODES,
    Presses,
)
from isotruss_ros.calibration.outliers import outlying_points
from isotruss_ros.core.model.robot_schema import plausible_range
from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np

#: Largest misfit of the beam in a mode, root mean square of ln(measured / fitted stiffness) [-].
#: Groups that scatter by the usual 0.1 give at most 0.13, by 0.2 up to 0.27. A mode with loads or
#: displacements in another unit gives 0.29 to 2.2; with a third of this limit, usual points are
#: refused, and with three times of it, loads in pounds are accepted.
MAX_MISFIT = 0.25


@dataclass(frozen=True)
class Analysis:
    """Results of all fits to the measurements of a tube."""

    slopes: Mapping[str, Sequence[Slope]]  #: slope of each group of points, by mode
    fitted: FittedBeam | None  #: beam fitted to the slopes of all modes; None without a fit
    refusal: str  #: reason why a robot file cannot have the beam; empty if it can
    local: FittedLocalStiffness | None  #: local stiffness; None without a fit
    local_refusal: str  #: reason why no local stiffness was fitted; else empty
    laws: Mapping[str, FittedLaw]  #: power laws by mode, as in Table I
    missing: Mapping[str, str]  #: reasons why power laws were not fitted, by mode
    unused: Mapping[str, Sequence[int]]  #: line numbers of unused rows, by reason

    def points(self, mode: str) -> int:
        """
        Return the number of measured points in all groups of one mode.

        :param mode: mode of the load, which is axial, transverse or rotary.
        """
        return sum(int(slope.used.sum()) for slope in self.slopes[mode])


def analyse(
    measurements: Measurements,
    diameter: float = DEFAULT_DIAMETER,
    tolerance: float = TOLERANCE,
    max_displacements: Mapping[str, float] | None = None,
) -> Analysis:
    """
    Fit stiffnesses, an inflatable beam, the local stiffness and power laws to measurements.

    :param measurements: groups of points; lengths are measured between pinch points in the axial
        mode, and between guide rings in the other modes [m].
    :param diameter: diameter of the tube [m].
    :param tolerance: tolerance of the linear range, see `linear_range.TOLERANCE` [-].
    :param max_displacements: largest displacement of the linear range for the name of each mode
        [m, rad]; it replaces the statistical test of linearity.
    """
    ranges = max_displacements or {}
    slopes: dict[str, list[Slope]] = {mode: [] for mode in MODES}
    unused = {reason: list(lines) for reason, lines in measurements.unused.items()}
    for whole in measurements.groups:
        group = _without_outliers(whole, unused)
        slope = fit_slope(group, tolerance, ranges.get(group.mode))
        for reason in sorted(set(slope.reasons) - {''}):
            lines = group.lines[np.array(slope.reasons) == reason]
            unused.setdefault(reason, []).extend(lines.tolist())
        if slope.used.any():
            slopes[group.mode].append(slope)
    fitted, refusal = None, ''
    try:
        slopes = _without_outlying_groups(slopes, 0.5 * diameter, unused)
        fitted = _beam(slopes, 0.5 * diameter)
        _require_plausible(fitted)
        refusal = _find_misfit(fitted, slopes)
    except MeasurementError as error:
        fitted, refusal = None, str(error)
    refusal = '; '.join(measurements.wrong_units.values()) or refusal
    local, local_refusal = None, ''
    if len(measurements.presses.loads):
        try:
            local = _local(measurements.presses, None if refusal else fitted)
        except MeasurementError as error:
            local_refusal = str(error)
    laws, missing = {}, {}
    for mode, found in slopes.items():
        try:
            laws[mode] = _law(found)
        except MeasurementError as error:
            missing[mode] = str(error)
    return Analysis(slopes, fitted, refusal, local, local_refusal, laws, missing, unused)


def _without_outliers(group: Group, unused: dict[str, list[int]]) -> Group:
    """Return a group without its outliers; add the rows of the outliers to `unused`."""
    out, off = outlying_points(group)
    unit = 'N m' if group.mode == 'rotary' else 'N'
    for i in np.flatnonzero(out):
        reason = f'{group.name}: {off[i]:+.3g} {unit} off the line of the others'
        unused.setdefault(reason, []).append(int(group.lines[i]))
    return group.only(~out) if out.any() else group


def _without_outlying_groups(
    slopes: Mapping[str, list[Slope]], radius: float, unused: dict[str, list[int]]
) -> dict[str, list[Slope]]:
    """Return the slopes close to the fitted beam; add the rows of other slopes to `unused`."""
    found = [slope for mode in MODES for slope in slopes[mode]]
    ratios = outlying_ratios(*_measured(found), radius)
    for slope, ratio in zip(found, ratios, strict=True):
        if ratio != 1.0:
            reason = f'{slope.group.name}: {ratio:.3g} times as stiff as the beam of the others'
            unused.setdefault(reason, []).extend(slope.group.lines[slope.used].tolist())
    left = [slope for slope, ratio in zip(found, ratios, strict=True) if ratio == 1.0]
    return {mode: [slope for slope in left if slope.group.mode == mode] for mode in MODES}


def _require_plausible(fitted: FittedBeam) -> None:
    """Raise MeasurementError if a robot file would refuse a constant."""
    for name, value in fitted.constants._asdict().items():
        low, high = plausible_range(f'tube.stiffness.{name}')
        if not low <= value <= high:
            raise MeasurementError(
                f'{name} = {value:.3g}: must be from {low:g} to {high:g} in a tube of cloth; are '
                'lengths in m, displacements in m and rad, loads in N and N m, pressures in Pa?'
            )


def _find_misfit(fitted: FittedBeam, slopes: Mapping[str, Sequence[Slope]]) -> str:
    """Return the reason why a beam is too far from the points; empty if it is near."""
    if max(fitted.misfits.values()) <= MAX_MISFIT:
        return ''
    misses = ', '.join(f'{mode} {100.0 * misfit:.0f} %' for mode, misfit in fitted.misfits.items())
    refusal = f'the beam misses the points by {misses}: must be at most {100.0 * MAX_MISFIT:.0f} %'
    modes, lengths, pressures, stiffnesses = _measured(
        [slope for mode in MODES for slope in slopes[mode]]
    )
    rotary = modes == MODES.index('rotary')
    in_radians = np.where(rotary, np.degrees(stiffnesses), stiffnesses)
    with contextlib.suppress(MeasurementError):
        other = fit_beam(modes, lengths, pressures, in_radians, fitted.radius)
        if max(other.misfits.values()) <= MAX_MISFIT:
            refusal += '; with the rotations read as degrees it fits, so they must be in rad'
    return refusal


def _measured(slopes: Sequence[Slope]) -> tuple[Indices, Array, Array, Array]:
    """Return arrays (n,) of the modes, lengths, pressures and stiffnesses of slopes."""
    return (
        np.array([MODES.index(slope.group.mode) for slope in slopes], dtype=np.intp),
        np.array([slope.group.length for slope in slopes]),
        np.array([slope.group.pressure for slope in slopes]),
        np.array([slope.stiffness for slope in slopes]),
    )


def _beam(slopes: Mapping[str, Sequence[Slope]], radius: float) -> FittedBeam:
    found = [slope for mode in MODES for slope in slopes[mode]]
    return fit_beam(*_measured(found), radius)


def _local(presses: Presses, fitted: FittedBeam | None) -> FittedLocalStiffness:
    if fitted is None:
        raise MeasurementError(
            'no beam was fitted; interference bends the tube as well, so its fit needs the beam'
        )
    local = fit_local_stiffness(presses, fitted.beam)
    low, high = plausible_range('tube.local_stiffness')
    if not low <= local.value <= high:
        raise MeasurementError(
            f'local_stiffness = {local.value:.3g}: must be from {low:g} to {high:g}; are '
            'displacements and diameters in m, loads in N?'
        )
    return local


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
