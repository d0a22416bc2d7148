"""Draw Fig. 7: the three configurations, and their grasps magnified."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from isotruss_ros.core import Cylinder
from isotruss_ros.demo.drawing import draw_robot, frame, MODULE_COLOR, OBJECT_COLOR
from isotruss_ros.demo.grasp_drawing import draw_grasp
from isotruss_ros.paper.style import PAGE
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
import numpy as np

if TYPE_CHECKING:
    from isotruss_ros.paper.figure_7 import Held

MARGIN = 0.12
#: Half of the side of the magnified views [m].
AROUND = 0.42


def draw(held: Sequence[Held]) -> Figure:
    """Return robots above, grasps below."""
    figure = Figure(figsize=(PAGE, 4.9), layout='constrained')
    nodes = np.concatenate([each.plan.config.nodes for each in held])
    low, high = nodes.min(axis=0) - MARGIN, nodes.max(axis=0) + MARGIN
    above, below = figure.subplots(2, 3)
    for i, each in enumerate(held):
        grasp = each.plan.grasp
        cylinder = Cylinder(grasp.center, grasp.diameter)
        _draw_robot(above[i], each, cylinder)
        frame(above[i], low, high)
        above[i].set_title(f'({"abc"[i]}) held at {grasp.module}', loc='left')
        _draw_grasp(below[i], each, cylinder)
    for axes in above[1:]:
        axes.set_ylabel('')
        axes.tick_params(labelleft=False)
    return figure


def _draw_robot(axes: Axes, each: Held, cylinder: Cylinder) -> None:
    draw_robot(axes, each.plan.config)
    disc = Circle(cylinder.center, 0.5 * cylinder.diameter, zorder=5)
    disc.set(facecolor=OBJECT_COLOR, edgecolor=MODULE_COLOR)
    axes.add_patch(disc)
    corner = np.array(cylinder.center) - AROUND
    view = Rectangle(corner, 2 * AROUND, 2 * AROUND, fill=False, lw=0.7, ls=':', zorder=9)
    axes.add_patch(view)


def _draw_grasp(axes: Axes, each: Held, cylinder: Cylinder) -> None:
    draw_grasp(axes, each.plan.config, cylinder, each.analysis, each.spacing)
    x, y = cylinder.center
    axes.set_xlim(x - AROUND, x + AROUND)
    axes.set_ylim(y - AROUND, y + AROUND)
    for spine in axes.spines.values():
        spine.set(visible=True, linestyle=':')
