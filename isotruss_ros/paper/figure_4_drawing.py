"""Draw Fig. 4: loads over displacements, and stiffnesses over lengths."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from isotruss_ros.core.power_law import Law
from isotruss_ros.fit.linear_range import Slope
from isotruss_ros.fit.measurements import MODES
from isotruss_ros.paper.default_tube import end_stiffnesses
from isotruss_ros.paper.parameters import LENGTHS, PRESSURES
from isotruss_ros.paper.style import BLACK, MARKERS, PAGE, STEPS
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter, NullLocator, ScalarFormatter
import numpy as np

if TYPE_CHECKING:
    from isotruss_ros.paper.figure_4 import StiffnessLaws

#: Displacements in mm or degrees, loads, stiffnesses.
LABELS = {
    'axial': ('displacement δx [mm]', 'force P [N]', 'P/δx [N/m]'),
    'transverse': ('displacement δy [mm]', 'force V [N]', 'V/δy [N/m]'),
    'rotary': ('rotation δθ [deg]', 'moment M [N m]', 'M/δθ [N m/rad]'),
}
#: The length in the upper row.
SHOWN = LENGTHS[1]


def draw(result: StiffnessLaws) -> Figure:
    """Return one column a mode: loads of one length above, stiffnesses of all below."""
    figure = Figure(figsize=(PAGE, 4.5), layout='constrained')
    panels = figure.subplots(2, 3)
    for i, mode in enumerate(MODES):
        fitted = result.analysis.laws[mode].law
        slopes = result.analysis.slopes[mode]
        _draw_loads(panels[0, i], mode, slopes, fitted)
        _draw_stiffnesses(panels[1, i], mode, slopes, fitted)
    figure.legend(handles=_handles(), loc='outside lower center', ncols=6, handlelength=2.2)
    return figure


def _draw_loads(axes: Axes, mode: str, slopes: Sequence[Slope], law: Law) -> None:
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
        k = law.stiffness(np.array(SHOWN), np.array(group.pressure))
        axes.plot(unit * ends, k * ends, '--', color=BLACK, lw=0.9)
    axes.set_title(f'{mode}, L = {100 * SHOWN:g} cm')
    axes.set_xlabel(LABELS[mode][0])
    axes.set_ylabel(LABELS[mode][1])
    axes.set_xlim(left=0.0)


def _draw_stiffnesses(axes: Axes, mode: str, slopes: Sequence[Slope], law: Law) -> None:
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
        theory = end_stiffnesses(pressure, span)[mode]
        axes.plot(100 * span, theory, '-', color=color, lw=1.0)
        k = law.stiffness(span, np.full_like(span, pressure))
        axes.plot(100 * span, k, '--', color=BLACK, lw=0.9)
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
        handle.set_label(f'synthetic, {1e-3 * pressure:g} kPa')
    return [
        *marks,
        Line2D([], [], color=BLACK, ls='--', lw=0.9, label='law fitted to them'),
        Line2D([], [], color=STEPS[1], ls='-', lw=1.0, label='theory of the tube'),
    ]
