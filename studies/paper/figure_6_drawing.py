# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Drawing of Fig. 6: stiffness over position and over pressure, by both models."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D
from studies.paper.membrane import STIFFNESS
from studies.paper.parameters import CYLINDERS, DEPTH, PRESSURES
from studies.paper.style import GREY, MARKERS, PAGE, STEPS

if TYPE_CHECKING:
    from studies.paper.figure_6 import Interference


def draw(result: Interference) -> Figure:
    """Return the figure with two panels."""
    figure = Figure(figsize=(PAGE, 2.8), layout='constrained')
    left, right = figure.subplots(1, 2)
    _draw_positions(left, result)
    _draw_pressures(right, result)
    return figure


def _draw_positions(axes: Axes, result: Interference) -> None:
    for k, flat, cylinder, color in zip(
        result.stiffness, result.round, CYLINDERS, STEPS, strict=True
    ):
        label = f'd = {100 * cylinder:.3g} cm'
        axes.plot(100 * result.positions, 1e-3 * k, color=color, label=label)
        axes.plot(100 * result.positions, 1e-3 * flat, ':', color=color)
    handles, _ = axes.get_legend_handles_labels()
    handles.append(Line2D([], [], ls=':', color=GREY, label="paper's model"))
    axes.legend(handles=handles, title=f'{1e3 * DEPTH:g} mm deep', loc='upper center')
    axes.set_ylim(0.0, 1.05e-3 * result.round.max())
    axes.set_xlabel('position along the tube [cm]')
    axes.set_ylabel('interference stiffness [kN/m]')
    axes.set_title('(a)', loc='left')


def _draw_pressures(axes: Axes, result: Interference) -> None:
    pressures = [1e-3 * pressure for pressure in PRESSURES]
    for i, (cylinder, color, marker) in enumerate(zip(CYLINDERS, STEPS, MARKERS, strict=True)):
        own = [1e-3 * row[i].stiffness for row in result.middle]
        flat = [1e-3 * row[i].stiffness for row in result.middle_round]
        label = f'd = {100 * cylinder:.3g} cm'
        axes.plot(pressures, own, color=color, label=label)
        axes.plot(pressures, 1e-3 * STIFFNESS[:, i], marker, ms=3.5, mfc='none', color=color)
        axes.plot(pressures, flat, ':', color=color)
    handles, _ = axes.get_legend_handles_labels()
    handles.append(Line2D([], [], ls=':', color=GREY, label="paper's model"))
    labels = [handle.get_label() for handle in handles]
    marks = tuple(
        Line2D([], [], ls='', marker=marker, ms=3.5, mfc='none', color=color)
        for marker, color in zip(MARKERS, STEPS, strict=True)
    )
    axes.legend(
        [*handles, marks],
        [*labels, 'membrane elements'],
        handler_map={tuple: HandlerTuple(ndivide=None)},
        loc='upper left',
        ncols=2,
        fontsize=6.5,
    )
    axes.set_xlim(left=0.0)
    axes.set_ylim(0.0, 8.5)
    axes.set_xlabel('gauge pressure [kPa], at the middle')
    axes.set_ylabel('interference stiffness [kN/m]')
    axes.set_title('(b)', loc='left')
