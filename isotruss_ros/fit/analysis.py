"""From measurements to laws: slopes of all groups, one law for each mode."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import itertools

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.power_law import PowerLaw
from isotruss_ros.core.robot_schema import MAX_MAGNITUDE
from isotruss_ros.fit.law import fit_law, FittedLaw
from isotruss_ros.fit.linear_range import fit_slope, Slope, TOLERANCE
from isotruss_ros.fit.measurements import MeasurementError, Measurements, MODES, Unused
import numpy as np


@dataclass(frozen=True)
class Analysis:
    """
    What was fitted.

    :ivar slopes: of all groups that have one, by mode.
    :ivar laws: by mode, those that could be fitted.
    :ivar refusals: by mode, why there is no law.
    :ivar unused: all rows that no law rests on.
    """

    slopes: Mapping[str, Sequence[Slope]]
    laws: Mapping[str, FittedLaw]
    refusals: Mapping[str, str]
    unused: Unused

    def points(self, mode: str) -> int:
        """Return how many measured points a law rests on."""
        return sum(int(slope.used.sum()) for slope in self.slopes[mode])

    @property
    def power_law(self) -> PowerLaw | None:
        """Return the model of the tube, if all three modes have a law."""
        if self.refusals:
            return None
        return PowerLaw(*(self.laws[mode].law for mode in MODES))


def analyse(
    measurements: Measurements,
    tolerance: float = TOLERANCE,
    max_displacements: Mapping[str, float] | None = None,
) -> Analysis:
    """
    Fit slopes and laws.

    :param tolerance: see linear_range.TOLERANCE.
    :param max_displacements: linear range of some modes, instead of the test for one.
    """
    ranges = max_displacements or {}
    slopes: dict[str, list[Slope]] = {mode: [] for mode in MODES}
    unused = Unused({reason: list(lines) for reason, lines in measurements.unused.lines.items()})
    for group in measurements.groups:
        slope = fit_slope(group, tolerance, ranges.get(group.mode))
        for reason in sorted(set(slope.reasons) - {''}):
            unused.add(reason, group.lines[np.array(slope.reasons) == reason])
        if slope.used.any():
            slopes[group.mode].append(slope)
    laws, refusals = {}, {}
    for mode, found in slopes.items():
        try:
            laws[mode] = _law(found)
        except MeasurementError as error:
            refusals[mode] = str(error)
    return Analysis(slopes, laws, refusals, unused)


def _law(slopes: Sequence[Slope]) -> FittedLaw:
    if not slopes:
        raise MeasurementError(
            'no points that can be used; a slope needs several of one trial, pressure and length'
        )
    fitted = fit_law(
        np.array([slope.group.pressure for slope in slopes]),
        np.array([slope.group.length for slope in slopes]),
        np.array([slope.stiffness for slope in slopes]),
    )
    if not 0.0 < fitted.law.C <= MAX_MAGNITUDE:
        raise MeasurementError(
            f'C = {fitted.law.C:g} is no number that a robot file takes; are the units SI?'
        )
    return fitted


def contradiction(analysis: Analysis) -> str:
    """
    Return where in the measured range no beam has the fitted stiffnesses; empty if everywhere.

    The ratio that has to be large enough is a power law too: it is least at a corner of the range.
    """
    model = analysis.power_law
    if model is None:
        return ''
    groups = [slope.group for slopes in analysis.slopes.values() for slope in slopes]
    pressures = [group.pressure for group in groups]
    lengths = [group.length for group in groups]
    corners = np.array(
        list(itertools.product((min(lengths), max(lengths)), (min(pressures), max(pressures))))
    )
    try:
        model.rigidities(*corners.T)
    except StructureError as error:
        return str(error)
    return ''
