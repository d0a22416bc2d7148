# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Drawing of Fig. 5: the three triangles, and their force over displacement."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from isotruss_ros.core.kinematics.depths import member_lines
from isotruss_ros.plotting.robot_drawing import MODULE_COLOR, SUPPORT_COLOR
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
import numpy as np
from studies.paper.style import BLUE, GREEN, GREY, MARKERS, ORANGE, PAGE

if TYPE_CHECKING:
    from studies.paper.figure_5 import Shape

COLORS = (BLUE, ORANGE, GREEN)
#: Margin beside a robot [m].
MARGIN = 0.2


def draw(shapes: Mapping[str, Shape]) -> Figure:
    """Return the triangles at one scale on the left, and the curves on the right."""
    figure = Figure(figsize=(PAGE, 2.6), layout='constrained')
    left, right = figure.subfigures(1, 2, width_ratios=(1.25, 1.0))
    widths = [_base(shape) + 2.0 * MARGIN for shape in shapes.values()]
    panels = left.subplots(1, 3, width_ratios=widths, sharey=True)
    for axes, name, color in zip(panels, shapes, COLORS, strict=True):
        shape = shapes[name]
        _draw_shape(axes, shape, color)
        leg, base = (f'{100 * edge:g}' for edge in shape.edges)
        axes.set_title(f'{name}\n{leg}, {leg}, {base} cm', color=color)
    _draw_curves(right.subplots(), shapes)
    return figure


def _base(shape: Shape) -> float:
    """Return the distance of the joints on the ground: 0 for L, and that of R [m]."""
    return float(shape.config.points[1].real)


def _draw_shape(axes: Axes, shape: Shape, color: str) -> None:
    config = shape.config
    topology, points = config.robot.topology, config.points
    axes.axvline(0.5 * _base(shape), color=GREY, lw=0.8, ls=(0, (4, 3)), zorder=0)
    for line in member_lines(config):
        axes.plot(line.real, line.imag, color=color, lw=5.0, solid_capstyle='round', alpha=0.6)
    for corners in points[np.stack([topology.joint, topology.b, topology.c], axis=1)]:
        outline = np.column_stack([corners.real, corners.imag])
        axes.add_patch(Polygon(outline, facecolor=MODULE_COLOR, zorder=3))
    left, right, top = points[: len(topology.joint_names)]
    for pin in (left, right):
        axes.plot(pin.real, pin.imag - 0.07, '^', color=SUPPORT_COLOR, ms=6, mew=0.0, zorder=4)
    for joint in (left, right, top):
        axes.plot(joint.real, joint.imag, 'o', color='white', mec=MODULE_COLOR, ms=3, zorder=5)
    arrow = {'arrowstyle': '-|>', 'color': 'black', 'lw': 1.0, 'shrinkA': 0.0, 'shrinkB': 0.0}
    start, end = top.imag + 0.48, top.imag + 0.15
    axes.annotate('', (top.real, end), (top.real, start), arrowprops=arrow)
    axes.text(top.real + 0.06, start, 'F', va='top')
    axes.set_aspect('equal')
    axes.set_xlim(-MARGIN, _base(shape) + MARGIN)
    axes.set_ylim(-0.2, 2.1)
    axes.axis('off')


def _draw_curves(axes: Axes, shapes: Mapping[str, Shape]) -> None:
    for (name, shape), color, marker in zip(shapes.items(), COLORS, MARKERS, strict=True):
        x, y = 1e3 * shape.displacements, shape.forces
        wrinkles, force = shape.onset
        axes.plot(x, y, '-', color=color)
        axes.plot(1e3 * wrinkles, force, marker, color=color, ms=4.5)
        axes.plot(x[-1], y[-1], marker, color=color, mfc='white', ms=4.5)
        axes.annotate(
            name,
            (x[-1], y[-1]),
            (5, 0),
            textcoords='offset points',
            ha='left',
            va='center',
            color=color,
            fontsize=7.0,
        )
    style = {'color': 'black', 'marker': 'o', 'ms': 4.5, 'ls': ''}
    handles = [
        Line2D([], [], color='black', label='model'),
        Line2D([], [], label='a tube wrinkles', **style),
        Line2D([], [], label='largest load', **style | {'mfc': 'white'}),
    ]
    axes.legend(handles=handles, loc='lower right')
    axes.set_xlim(0.0, 1.3e3 * max(shape.displacements[-1] for shape in shapes.values()))
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel('displacement of the top y [mm]')
    axes.set_ylabel('force F [N]')
