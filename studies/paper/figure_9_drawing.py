# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Drawing of Fig. 9: the robot at the start and after each part of the path."""

from __future__ import annotations

from isotruss_ros.core import Pose
from isotruss_ros.plotting.robot_drawing import draw_object, frame, PATH_COLOR, plot_robot
from matplotlib.figure import Figure
import numpy as np
from studies.paper.figure_9 import Moved
from studies.paper.style import PAGE

MARGIN = 0.12
TITLES = ('start', 'moved up', 'turned in place', 'moved along an arc')


def draw(result: Moved) -> Figure:
    """Return four panels, as in the paper."""
    figure = Figure(figsize=(PAGE, 5.9), layout='constrained')
    nodes = np.concatenate([part.config.nodes for part in result.parts])
    low, high = nodes.min(axis=0) - MARGIN, nodes.max(axis=0) + MARGIN
    panels = figure.subplots(2, 2, sharex=True, sharey=True).ravel()
    for i, (axes, part) in enumerate(zip(panels, result.parts, strict=True)):
        plot_robot(part.config, axes)
        draw_object(axes, Pose(*part.poses[-1]), result.diameter)
        travelled = np.concatenate([each.poses for each in result.parts[: i + 1]])
        axes.plot(*travelled.T[:2], color=PATH_COLOR, lw=1.5, zorder=7)
        frame(axes, low, high)
        axes.label_outer()
        axes.set_title(f'({"abcd"[i]}) {TITLES[i]}', loc='left')
    return figure
