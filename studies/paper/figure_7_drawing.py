# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Drawing of Fig. 7: the three configurations, and their grasps magnified."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from isotruss_ros.plotting.grasp_drawing import describe_contacts, FORCE_COLOR, plot_grasp
from isotruss_ros.plotting.robot_drawing import frame, MODULE_COLOR, OBJECT_COLOR, plot_robot
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
import numpy as np
from studies.paper.style import PAGE

if TYPE_CHECKING:
    from studies.paper.figure_7 import Held

MARGIN = 0.12
#: Half of the side length of the magnified views [m].
AROUND = 0.31
#: Length of a force's arrow [m/N], and force of the arrow in the legend [N].
SCALE, UNIT = 0.01, 10.0

ARROW = {'arrowstyle': '-|>', 'color': FORCE_COLOR, 'lw': 1.6, 'shrinkA': 0.0, 'shrinkB': 0.0}


def draw(held: Sequence[Held]) -> Figure:
    """Return the robots above and the grasps below."""
    figure = Figure(figsize=(PAGE, 4.9), layout='constrained')
    nodes = np.concatenate([each.plan.config.nodes for each in held])
    low, high = nodes.min(axis=0) - MARGIN, nodes.max(axis=0) + MARGIN
    above, below = figure.subplots(2, 3)
    for i, each in enumerate(held):
        _draw_robot(above[i], each)
        frame(above[i], low, high)
        above[i].set_title(f'({"abc"[i]}) held at {each.plan.module}', loc='left')
        _draw_grasp(below[i], each)
    for axes in above[1:]:
        axes.set_ylabel('')
        axes.tick_params(labelleft=False)
    return figure


def _draw_robot(axes: Axes, each: Held) -> None:
    plot_robot(each.plan.config, axes)
    body = each.plan.grip.body
    center = body.pose[:2]
    disc = Circle(center, body.arm, zorder=5)
    disc.set(facecolor=OBJECT_COLOR, edgecolor=MODULE_COLOR)
    axes.add_patch(disc)
    corner = np.array(center) - AROUND
    view = Rectangle(corner, 2 * AROUND, 2 * AROUND, fill=False, lw=0.7, ls=':', zorder=9)
    axes.add_patch(view)


def _draw_grasp(axes: Axes, each: Held) -> None:
    body = each.plan.grip.body
    plot_grasp(each.plan.equilibrium, axes, SCALE)
    words = (
        f'{describe_contacts(each.plan.equilibrium)},\n{each.plan.utilisation:.2f} of wrinkling'
    )
    axes.set_title(words, fontsize=7.0, pad=2)
    x, y = body.pose[:2]
    left, low = x - 0.92 * AROUND, y - 0.88 * AROUND
    axes.annotate(
        '',
        (left + SCALE * UNIT, low),
        (left, low),
        arrowprops={
            'arrowstyle': '-|>',
            'color': FORCE_COLOR,
            'lw': 1.6,
            'shrinkA': 0,
            'shrinkB': 0,
        },
        zorder=10,
    )
    axes.text(left, low + 0.02, f'{UNIT:g} N', fontsize=7.0, zorder=10)
    axes.set_xlim(x - AROUND, x + AROUND)
    axes.set_ylim(y - AROUND, y + AROUND)
    for spine in axes.spines.values():
        spine.set(visible=True, linestyle=':')
