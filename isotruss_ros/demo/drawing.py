"""Draw a robot and the object in its grip with matplotlib."""

from __future__ import annotations

import math

from isotruss_ros.core import Configuration, Pose
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon
import numpy as np
from numpy.typing import NDArray

TUBE_COLORS = ('#d98c5f', '#6f9fc8', '#8fb573', '#c9a13b', '#a58cc0')
SUPPORT_COLOR = '#7a5230'
MODULE_COLOR = '#3b3b3b'
OBJECT_COLOR = '#d9d9d9'
ARROW_COLOR = '#2e9e44'
PATH_COLOR = '#1f4fd8'
#: Pinched ends open to the full diameter over this many diameters.
TAPER = 0.8
#: The corner of the tube stands out beyond its pinch points by this share of the rod.
CORNER = 0.5
#: A pinched end is this share of the diameter thick.
PINCH = 0.15


def draw_robot(axes: Axes, config: Configuration) -> None:
    """Draw tubes with their pinched ends, modules and supports; axes in metres."""
    layout, points = config.robot.layout, config.points
    diameter = config.robot.description.tube_diameter
    for i in range(layout.n_modules):
        color = TUBE_COLORS[layout.tube[i] % len(TUBE_COLORS)]
        outline = _tube(points[layout.b[i]], points[layout.c[layout.following[i]]], diameter)
        axes.add_patch(Polygon(outline, facecolor=color, edgecolor='white', lw=0.5, alpha=0.85))
        joint, b, c = points[[layout.joint[i], layout.b[i], layout.c[i]]]
        corner = 0.5 * (b + c) + CORNER * (0.5 * (b + c) - joint)
        axes.add_patch(Polygon(_plane(np.array([b, corner, c])), facecolor=color, alpha=0.85))
        module = _plane(np.array([joint, b, c]))
        axes.add_patch(Polygon(module, facecolor=MODULE_COLOR, alpha=0.8, zorder=3))
    joints = _plane(points[: len(layout.joint_names)])
    axes.plot(*joints.T, 'o', color='white', mec=MODULE_COLOR, ms=4, zorder=4)
    _draw_supports(axes, config, 0.6 * diameter)


def draw_object(axes: Axes, pose: Pose, diameter: float) -> None:
    """Draw the object and, as an arrow, its orientation."""
    center = (pose.x, pose.y)
    axes.add_patch(
        Circle(center, 0.5 * diameter, facecolor=OBJECT_COLOR, edgecolor=MODULE_COLOR, zorder=5)
    )
    tip = (
        pose.x + 0.75 * diameter * math.cos(pose.angle),
        pose.y + 0.75 * diameter * math.sin(pose.angle),
    )
    axes.annotate(
        '',
        xy=tip,
        xytext=center,
        arrowprops={'arrowstyle': '-|>', 'color': ARROW_COLOR, 'lw': 2.2},
        zorder=6,
    )


def frame(axes: Axes, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
    """Show the box from `low` to `high` [m] with equal scales."""
    axes.set_aspect('equal')
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_xlabel('x [m]')
    axes.set_ylabel('y [m]')


def _plane(points: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.column_stack([points.real, points.imag])


def _tube(start: complex, end: complex, diameter: float) -> NDArray[np.float64]:
    """Return the outline of a tube that is pinched at both ends."""
    length = abs(end - start)
    axis = (end - start) / length
    taper = min(TAPER * diameter, 0.5 * length)
    along = np.array([0.0, taper, length - taper, length])
    half = 0.5 * diameter * np.array([PINCH, 1.0, 1.0, PINCH])
    side = np.concatenate([along + 1j * half, (along - 1j * half)[::-1]])
    return _plane(start + axis * side)


def _draw_supports(axes: Axes, config: Configuration, below: float) -> None:
    """Draw a triangle under a joint that is held in x and y, a wheel under one that may slide."""
    for joint, grounded in config.robot.description.supports.items():
        x, y = config.nodes[config.robot.node_names.index(joint)]
        marker = '^' if len(grounded) == 2 else 'o'
        axes.plot(x, y - below, marker, color=SUPPORT_COLOR, ms=8, zorder=4)
