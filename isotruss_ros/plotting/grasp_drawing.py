# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Drawing of the forces and contact regions of a grasp, as in the paper's Fig. 7."""

from __future__ import annotations

from collections.abc import Iterable

from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.held_shape import force_lines, region_lines
from isotruss_ros.core.kinematics.depths import member_lines
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.plotting.robot_drawing import MODULE_COLOR, new_axes, OBJECT_COLOR, TUBE_COLORS
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
import numpy as np

FORCE_COLOR = '#c8102e'
REGION_COLOR = '#1b1b6f'
WRINKLED_COLOR = '#c8102e'
UNDEFORMED_COLOR = '#222222'
#: Length of a force's arrow [m/N].
ARROW_SCALE = 0.015
#: Half width of the magnified view of a grasp, in object diameters [-].
VIEW_HALF_WIDTH = 1.0


def draw_forces(axes: Axes, grip: HeldGrip, scale: float = ARROW_SCALE) -> None:
    """Draw the force of each grasping member on the object, with a length per force [m/N]."""
    for tail, tip in force_lines(grip, scale):
        axes.annotate(
            '',
            xy=(tip.real, tip.imag),
            xytext=(tail.real, tail.imag),
            arrowprops={
                'arrowstyle': '-|>',
                'color': FORCE_COLOR,
                'lw': 1.6,
                'shrinkA': 0.0,
                'shrinkB': 0.0,
            },
            zorder=8,
        )


def plot_grasp(grip: HeldGrip, axes: Axes | None = None, scale: float = ARROW_SCALE) -> Axes:
    """
    Draw a held object, deformed and undeformed tubes, contact regions and forces.

    Tubes that wrinkle have a red outline. The title contains normal forces and contact lengths.

    :param grip: equilibrium of the object, `SettledGrasp.equilibrium`.
    :param axes: axes in the robot frame [m]; None: axes of a new figure.
    :param scale: length of an arrow per force [m/N].
    :return: the axes.
    """
    axes = axes or new_axes()
    robot, body = grip.config.robot, grip.body
    used = grip.sections.used.tolist()
    for tube, line, part in zip(robot.topology.tube, grip.member_lines()[1], used, strict=True):
        band = _band(line, robot.description.tube_diameter)
        patch = Polygon(band, facecolor=TUBE_COLORS[tube % len(TUBE_COLORS)], alpha=0.85)
        patch.set(edgecolor='white', lw=0.5)
        if part > 1.0:
            patch.set(edgecolor=WRINKLED_COLOR, lw=2.0)
        axes.add_patch(patch)
    for line in member_lines(grip.config):
        axes.plot(line.real, line.imag, '--', color=UNDEFORMED_COLOR, lw=1.0, zorder=6)
    outline = body.outline(0.01 * body.arm)
    corners = np.column_stack([outline.real, outline.imag])
    axes.add_patch(Polygon(corners, facecolor=OBJECT_COLOR, edgecolor=MODULE_COLOR, zorder=5))
    for line in region_lines(grip):
        axes.plot(
            line.real, line.imag, color=REGION_COLOR, lw=5.0, solid_capstyle='butt', zorder=9
        )
    draw_forces(axes, grip, scale)
    axes.set_title(describe_contacts(grip), fontsize=8, pad=2)
    x, y = grip.pose[:2]
    around = 2.0 * VIEW_HALF_WIDTH * body.shape.reach
    axes.set_aspect('equal')
    axes.set_xlim(x - around, x + around)
    axes.set_ylim(y - around, y + around)
    axes.set_xticks([])
    axes.set_yticks([])
    return axes


def describe_contacts(grip: HeldGrip) -> str:
    """Return a text with the normal force and contact length of each grasping member."""
    lengths = (1e3 * grip.patches.lengths).tolist()
    forces = _list(grip.normal_forces.tolist(), 'N')
    return f'{forces}, contact {_list(lengths, "mm")}' if lengths else forces


def _list(numbers: Iterable[float], unit: str) -> str:
    """Return a text with rounded numbers and their unit; equal numbers appear once."""
    words = [f'{number:.0f}' for number in numbers]
    alike = len(words) > 1 and len(set(words)) == 1
    return f'{words[0]} {unit} each' if alike else f'{" + ".join(words)} {unit}'


def _band(line: Points, width: float) -> Array:
    """Return the outline of a tube around a line."""
    steps = np.diff(line)
    along = np.concatenate([steps[:1], 0.5 * (steps[1:] + steps[:-1]), steps[-1:]])
    side = 0.5j * width * along / np.abs(along)
    outline = np.concatenate([line + side, (line - side)[::-1]])
    return np.column_stack([outline.real, outline.imag])
