# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Drawings of a robot and its grasped object with Matplotlib."""

from __future__ import annotations

import math

from isotruss_ros.core import Configuration, Pose
from isotruss_ros.core.numerics.arrays import Array, Points
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon
import matplotlib.pyplot as plt
import numpy as np

#: Colours of the tubes (orange, blue, grey, yellow, violet), which differ for colour-blind readers
#: and in greyscale.
TUBE_COLORS = ('#e08a3c', '#3f78b5', '#c4c4c4', '#ecd06f', '#6b4f8f')
SUPPORT_COLOR = '#7a5230'
MODULE_COLOR = '#3b3b3b'
OBJECT_COLOR = '#d9d9d9'
ARROW_COLOR = '#2e9e44'
PATH_COLOR = '#1f4fd8'
#: Length of the taper of a pinched end, in tube diameters [-].
TAPER_LENGTH = 0.8
#: Distance of the tube's corner from the line of the pinch points toward the joint, relative to
#: the rod length [-].
CORNER_POSITION = 0.5
#: Width of rod and pinch bar, in tube diameters [-].
ROD_WIDTH = 0.3
#: Thickness of a pinched end, in tube diameters [-].
PINCH_THICKNESS = 0.15


def plot_robot(config: Configuration, axes: Axes | None = None) -> Axes:
    """
    Draw tubes, modules and supports; return the axes in the robot frame [m].

    :param config: configuration of the robot.
    :param axes: axes for the drawing; None: axes of a new figure, centred on the robot.
    """
    given, axes = axes is not None, axes or new_axes()
    topology, points = config.robot.topology, config.points
    diameter = config.robot.description.tube_diameter
    for i in range(topology.n_modules):
        color = TUBE_COLORS[topology.tube[i] % len(TUBE_COLORS)]
        outline = _tube(points[topology.b[i]], points[topology.c[topology.following[i]]], diameter)
        axes.add_patch(Polygon(outline, facecolor=color, edgecolor='white', lw=0.5, alpha=0.85))
        joint, b, c = points[[topology.joint[i], topology.b[i], topology.c[i]]]
        middle = 0.5 * (b + c)
        corner = middle + CORNER_POSITION * (joint - middle)
        axes.add_patch(Polygon(_plane(np.array([b, corner, c])), facecolor=color, alpha=0.85))
        for start, end in ((b, c), (middle, joint)):
            bar = _bar(start, end, ROD_WIDTH * diameter)
            axes.add_patch(Polygon(bar, facecolor=MODULE_COLOR, zorder=3))
    joints = _plane(points[: len(topology.joint_names)])
    axes.plot(*joints.T, 'o', color='white', mec=MODULE_COLOR, ms=4, zorder=4)
    _draw_supports(axes, config, 0.6 * diameter)
    if not given:
        nodes, margin = config.nodes, 2.0 * diameter
        frame(axes, nodes.min(axis=0) - margin, nodes.max(axis=0) + margin)
    return axes


def draw_object(axes: Axes, pose: Pose, diameter: float) -> None:
    """
    Draw the object, and its orientation as an arrow.

    :param axes: axes for the drawing.
    :param pose: pose of the object in the robot frame.
    :param diameter: diameter of the object [m].
    """
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


def new_axes() -> Axes:
    """Return the Matplotlib axes of a new figure."""
    return plt.figure(layout='constrained').add_subplot()


def frame(axes: Axes, low: Array, high: Array) -> None:
    """
    Set the limits of axes so that a box is visible, with equal scales of x and y.

    :param axes: the axes.
    :param low: (2,) smallest x and y of the box [m].
    :param high: (2,) largest x and y of the box [m].
    """
    axes.set_aspect('equal')
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_xlabel('x [m]')
    axes.set_ylabel('y [m]')


def _plane(points: Points) -> Array:
    return np.column_stack([points.real, points.imag])


def _tube(start: complex, end: complex, diameter: float) -> Array:
    """Return the outline of a tube with pinched ends."""
    length = abs(end - start)
    axis = (end - start) / length
    taper = min(TAPER_LENGTH * diameter, 0.5 * length)
    along = np.array([0.0, taper, length - taper, length])
    half = 0.5 * diameter * np.array([PINCH_THICKNESS, 1.0, 1.0, PINCH_THICKNESS])
    side = np.concatenate([along + 1j * half, (along - 1j * half)[::-1]])
    return _plane(start + axis * side)


def _bar(start: complex, end: complex, width: float) -> Array:
    """Return the outline of a straight bar."""
    side = 0.5j * width * (end - start) / abs(end - start)
    return _plane(np.array([start + side, end + side, end - side, start - side]))


def _draw_supports(axes: Axes, config: Configuration, below: float) -> None:
    """Draw a triangle under each joint fixed in x and y, and a wheel under each sliding joint."""
    for joint, grounded in config.robot.description.supports.items():
        x, y = config.nodes[config.robot.node_names.index(joint)]
        marker = '^' if len(grounded) == 2 else 'o'
        axes.plot(x, y - below, marker, color=SUPPORT_COLOR, ms=8, zorder=4)
