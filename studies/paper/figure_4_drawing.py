# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Drawing of Fig. 4: loads over displacements, and stiffnesses over lengths."""

from __future__ import annotations

from collections.abc import Sequence

from isotruss_ros.calibration.beam_fit import end_stiffness
from isotruss_ros.calibration.linear_range import Slope
from isotruss_ros.calibration.measurements import MODES
from isotruss_ros.core.model.stiffness_law import Law
from isotruss_ros.core.statics.tube_stiffness import InflatableBeam
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter, NullLocator, ScalarFormatter
import numpy as np
from studies.paper.figure_4 import TubeFit
from studies.paper.parameters import LENGTHS, PRESSURES
from studies.paper.style import BLACK, MARKERS, PAGE, STEPS

#: Labels of displacements [mm, degrees], loads and stiffnesses.
LABELS = {
    'axial': ('displacement δx [mm]', 'force P [N]', 'P/δx [N/m]'),
    'transverse': ('displacement δy [mm]', 'force V [N]', 'V/δy [N/m]'),
    'rotary': ('rotation δθ [deg]', 'moment M [N m]', 'M/δθ [N m/rad]'),
}
#: Length that the upper row shows [m].
SHOWN = LENGTHS[1]


def draw(result: TubeFit) -> Figure:
    """
    Return one column for each mode: loads of one length above, stiffnesses of all below.

    :param result: result of `figure_4.compute`.
    """
    figure = Figure(figsize=(PAGE, 4.5), layout='constrained')
    panels = figure.subplots(2, 3)
    for i, mode in enumerate(MODES):
        beam, law = result.analysis.fitted.beam, result.analysis.laws[mode].law
        slopes = result.analysis.slopes[mode]
        _draw_loads(panels[0, i], mode, slopes, beam)
        _draw_stiffnesses(panels[1, i], mode, slopes, beam, law)
    # Room for the legend; Matplotlib 3.6 places none outside by itself.
    figure.get_layout_engine().set(rect=(0.0, 0.07, 1.0, 0.93))
    figure.legend(
        handles=_handles(),
        loc='lower center',
        ncols=5,
        handlelength=1.6,
        columnspacing=1.2,
    )
    return figure


def _draw_loads(axes: Axes, mode: str, slopes: Sequence[Slope], beam: InflatableBeam) -> None:
    unit = np.rad2deg(1.0) if mode == 'rotary' else 1e3
    shown = [slope for slope in slopes if slope.group.length == SHOWN]
    for slope, color, marker in zip(shown, STEPS, MARKERS, strict=True):
        group = slope.group
        axes.plot(
            unit * group.displacements,
            group.loads - slope.offsets,
            marker,
            color=color,
            ms=2.2,
            mew=0.0,
        )
        ends = np.array([0.0, group.displacements.max()])
        k = end_stiffness(beam, mode, SHOWN, group.pressure)
        axes.plot(unit * ends, k * ends, '-', color=BLACK, lw=0.9)
    axes.set_title(f'{mode}, L = {100 * SHOWN:g} cm')
    axes.set_xlabel(LABELS[mode][0])
    axes.set_ylabel(LABELS[mode][1])
    axes.set_xlim(left=0.0)


def _draw_stiffnesses(
    axes: Axes, mode: str, slopes: Sequence[Slope], beam: InflatableBeam, law: Law
) -> None:
    span = np.geomspace(LENGTHS[0], LENGTHS[-1], 50)
    for pressure, color, marker in zip(PRESSURES, STEPS, MARKERS, strict=True):
        found = [slope for slope in slopes if slope.group.pressure == pressure]
        axes.plot(
            [100 * slope.group.length for slope in found],
            [slope.stiffness for slope in found],
            marker,
            color=color,
            ms=4.0,
            mew=0.0,
        )
        axes.plot(100 * span, end_stiffness(beam, mode, span, pressure), '-', color=BLACK, lw=0.9)
        k = law.stiffness(span, np.full_like(span, pressure))
        axes.plot(100 * span, k, '--', color=color, lw=0.9)
    axes.set(xscale='log', yscale='log')
    axes.set_xticks([100 * length for length in LENGTHS])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
    axes.yaxis.set_minor_locator(NullLocator())
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(ScalarFormatter())
        axis.set_minor_formatter(NullFormatter())
    axes.set_xlabel('member length L [cm]')
    axes.set_ylabel(LABELS[mode][2])


def _handles() -> list[Line2D]:
    """Return the legend of all panels."""
    marks = [
        Line2D([], [], color=color, marker=marker, ls='', ms=4.0, mew=0.0)
        for color, marker in zip(STEPS, MARKERS, strict=True)
    ]
    for handle, pressure in zip(marks, PRESSURES, strict=True):
        handle.set_label(f'{1e-3 * pressure:g} kPa')
    return [
        *marks,
        Line2D([], [], color=BLACK, ls='-', lw=0.9, label='beam fitted to all modes'),
        Line2D([], [], color=STEPS[1], ls='--', lw=0.9, label='power law of each mode'),
    ]
