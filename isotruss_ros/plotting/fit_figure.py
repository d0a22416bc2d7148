# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Figure like the paper's Fig. 4, with measured points, the fitted beam, and power laws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from isotruss_ros.calibration.analysis import Analysis
from isotruss_ros.calibration.beam_fit import end_stiffness
from isotruss_ros.calibration.linear_range import Slope
from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.core.numerics.arrays import Array
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter
import numpy as np

#: Curve with its name, its line style, and its stiffness as a function of length [m] and pressure
#: [Pa].
Curve = tuple[str, str, Callable[[Array, Array], Array]]

MEASURED_COLOR = 'tab:blue'
#: Largest number of lengths that have their own ticks [-].
MAX_TICKS = 4
LABELS = {
    'axial': ('δx [m]', 'P [N]', 'P/δx [N/m]'),
    'transverse': ('δy [m]', 'V [N]', 'V/δy [N/m]'),
    'rotary': ('δθ [rad]', 'M [N m]', 'M/δθ [N m/rad]'),
}


def draw(analysis: Analysis, path: Path) -> None:
    """
    Draw one column of plots for each deformation mode.

    The upper plot shows the measured and fitted loads of one group of measurements, the lower plot
    the stiffnesses of all groups.

    :param analysis: results of the fits.
    :param path: path of the file, whose extension selects the format.
    :raises MeasurementError: the file cannot be written.
    """
    modes = [mode for mode, slopes in analysis.slopes.items() if slopes]
    figure = Figure(figsize=(3.6 * max(len(modes), 1), 6.4), layout='constrained')
    panels = figure.subplots(2, max(len(modes), 1), squeeze=False)
    for i in range(len(modes)):
        slopes = analysis.slopes[modes[i]]
        curves = _curves(analysis, modes[i])
        _draw_loads(panels[0, i], _middle(slopes), curves)
        _draw_stiffnesses(panels[1, i], slopes, curves)
    try:
        figure.savefig(path, dpi=130)
    except OSError as error:
        raise MeasurementError(f'{path}: cannot be written: {error.strerror}') from error
    except ValueError as error:
        raise MeasurementError(f'{path}: cannot be written: {error}') from error


def _middle(slopes: Sequence[Slope]) -> Slope:
    """Return the slope of the group that is nearest to the median pressure and length."""
    places = np.log([[slope.group.pressure, slope.group.length] for slope in slopes])
    return slopes[int(np.argmin(np.abs(places - np.median(places, axis=0)).sum(axis=1)))]


def _curves(analysis: Analysis, mode: str) -> list[Curve]:
    """Return the fitted curves of a mode, with names and line styles."""
    curves: list[Curve] = []
    if analysis.fitted:
        tube = analysis.fitted.beam
        curves.append(('beam', '-', lambda L, p: end_stiffness(tube, mode, L, p)))
    if mode in analysis.laws:
        curves.append(('power law', '--', analysis.laws[mode].law.stiffness))
    return curves


def _draw_loads(axes: Axes, slope: Slope, curves: Sequence[Curve]) -> None:
    group, used = slope.group, slope.used
    loads = group.loads - slope.offsets
    axes.plot(
        group.displacements[used], loads[used], '.', color=MEASURED_COLOR, ms=4, label='measured'
    )
    if not used.all():
        axes.plot(
            group.displacements[~used], loads[~used], '.', color='0.75', ms=4, label='not used'
        )
    ends = np.array([min(group.displacements[used].min(), 0.0), group.displacements.max()])
    for name, line, stiffness in curves:
        k = stiffness(np.array(group.length), np.array(group.pressure))
        axes.plot(ends, k * ends, line, color='black', lw=1.2, label=name)
    axes.set_title(
        f'{group.mode}\n{1e-3 * group.pressure:g} kPa, {group.length:g} m', fontsize='medium'
    )
    axes.set_xlabel(LABELS[group.mode][0])
    axes.set_ylabel(LABELS[group.mode][1])
    axes.legend(frameon=False, fontsize='small', loc='lower right')


def _draw_stiffnesses(axes: Axes, slopes: Sequence[Slope], curves: Sequence[Curve]) -> None:
    lengths = np.array([slope.group.length for slope in slopes])
    stiffnesses = np.array([slope.stiffness for slope in slopes])
    axes.plot(lengths, stiffnesses, 'o', color=MEASURED_COLOR, ms=4)
    span = np.geomspace(lengths.min(), lengths.max(), 30)
    # Curves with one end point share a label.
    rise = np.log(stiffnesses.max() / stiffnesses.min())
    ends: dict[float, list[str]] = {}
    for pressure in sorted({slope.group.pressure for slope in slopes}) if curves else []:
        for _, line, stiffness in reversed(curves):
            k = stiffness(span, np.full_like(span, pressure))
            axes.plot(span, k, line, color='black', lw=1.2)
        near = [end for end in ends if abs(np.log(k[-1] / end)) < 0.1 * rise]
        ends.setdefault(near[-1] if near else float(k[-1]), []).append(f'{1e-3 * pressure:g}')
    for end, labels in ends.items():
        axes.annotate(
            '\n'.join(labels) + ' kPa',
            (span[-1], end),
            (4, 0),
            textcoords='offset points',
            va='center',
            fontsize='small',
        )
    axes.set(xscale='log', yscale='log')
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(ScalarFormatter())
        axis.set_minor_formatter(NullFormatter())
    if len(set(lengths)) <= MAX_TICKS:
        axes.set_xticks(sorted(set(lengths)), minor=False)
    # Margin for the pressures at the right.
    low, high = lengths.min(), lengths.max()
    axes.set_xlim(low / 1.15, high * 1.15 * max((high / low) ** 0.25, 1.1))
    axes.set_xlabel('L [m]')
    axes.set_ylabel(LABELS[slopes[0].group.mode][2])
