"""Draw Fig. 6: stiffness over position, and what the gas adds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from isotruss_ros.paper.clamped_tube import DEPTH
from isotruss_ros.paper.parameters import CYLINDERS
from isotruss_ros.paper.style import GREY, MARKERS, PAGE, STEPS
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

if TYPE_CHECKING:
    from isotruss_ros.paper.figure_6 import Interference

#: Thick below thin, so that curves that coincide are all to be seen.
WIDTHS = (5.0, 2.6, 0.9)


def draw(result: Interference) -> Figure:
    """Return two panels."""
    figure = Figure(figsize=(PAGE, 2.6), layout='constrained')
    left, right = figure.subplots(1, 2)
    _draw_positions(left, result)
    _draw_gains(right, result)
    return figure


def _draw_positions(axes: Axes, result: Interference) -> None:
    for k, cylinder, color, width in zip(result.stiffness, CYLINDERS, STEPS, WIDTHS, strict=True):
        label = f'd = {100 * cylinder:.3g} cm'
        axes.plot(100 * result.positions, 1e-3 * k, color=color, lw=width, label=label)
    axes.legend(title=f'without gas, {1e3 * DEPTH:g} mm deep', loc='upper center')
    axes.set_ylim(0.0, 1.05e-3 * result.stiffness.max())
    axes.set_xlabel('position along the tube [cm]')
    axes.set_ylabel('interference stiffness [kN/m]')
    axes.set_title('(a)', loc='left')


def _draw_gains(axes: Axes, result: Interference) -> None:
    rows = zip(result.gain, result.proportional, STEPS, MARKERS, strict=True)
    for gain, proportional, color, marker in rows:
        axes.plot(1e3 * result.depths, 100 * gain, '--', color=color)
        axes.plot(1e3 * result.depths, 100 * proportional, marker=marker, ms=3.0, color=color)
    wrinkling = 1e3 * result.wrinkling
    axes.axvline(wrinkling, color=GREY, lw=0.8, ls=':')
    axes.annotate(
        'the tube wrinkles',
        (wrinkling, 0.5),
        (3, 0),
        xycoords=('data', 'axes fraction'),
        textcoords='offset points',
        rotation=90,
        va='center',
        color='0.35',
        fontsize=7.0,
    )
    handles = [
        Line2D([], [], color=color, marker=marker, ms=3.0, label=f'd = {100 * cylinder:.3g} cm')
        for cylinder, color, marker in zip(CYLINDERS, STEPS, MARKERS, strict=True)
    ]
    handles.insert(0, Line2D([], [], ls='', label='stiffness ~ pressure'))
    handles.append(Line2D([], [], color=STEPS[1], ls='--', label='default theory'))
    axes.legend(handles=handles, loc='upper left')
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel('depth at the middle [mm]')
    axes.set_ylabel('stiffness gained by the gas [%]')
    axes.set_title('(b)', loc='left')
