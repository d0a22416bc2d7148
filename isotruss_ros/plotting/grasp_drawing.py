# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Drawing of the forces and contact regions of a grasp, as in the paper's Fig. 7."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from isotruss_ros.core import Configuration, ConvexObject
from isotruss_ros.core.contact.deformed_shape import deformed_lines, force_lines, region_lines
from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
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


def draw_forces(
    axes: Axes, body: ConvexObject, analysis: GraspAnalysis, scale: float = ARROW_SCALE
) -> None:
    """
    Draw the resultant force of each grasping member on the object as an arrow.

    :param axes: axes in the robot frame [m].
    :param body: the object.
    :param analysis: analysis of the grasp.
    :param scale: length of an arrow per force [m/N].
    """
    for tail, tip in _resultants(body, analysis, scale):
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


def plot_grasp(
    config: Configuration,
    body: ConvexObject,
    analysis: GraspAnalysis,
    axes: Axes | None = None,
    scale: float = ARROW_SCALE,
) -> Axes:
    """
    Draw the object, deformed and undeformed tubes, contact regions and forces.

    Tubes that wrinkle have a red outline. The title contains normal forces and contact lengths.

    :param config: configuration of the robot.
    :param body: the object.
    :param analysis: analysis of the grasp in this configuration.
    :param axes: axes in the robot frame [m]; None: axes of a new figure.
    :param scale: length of an arrow per force [m/N].
    :return: the axes.
    """
    axes = axes or new_axes()
    robot = config.robot
    lines, used = deformed_lines(analysis), analysis.utilisation.values()
    for tube, line, part in zip(robot.topology.tube, lines, used, strict=True):
        band = _band(line, robot.description.tube_diameter)
        patch = Polygon(band, facecolor=TUBE_COLORS[tube % len(TUBE_COLORS)], alpha=0.85)
        patch.set(edgecolor='white', lw=0.5)
        if part > 1.0:
            patch.set(edgecolor=WRINKLED_COLOR, lw=2.0)
        axes.add_patch(patch)
    for line in member_lines(config):
        axes.plot(line.real, line.imag, '--', color=UNDEFORMED_COLOR, lw=1.0, zorder=6)
    outline = body.outline(0.01 * body.arm)
    corners = np.column_stack([outline.real, outline.imag])
    axes.add_patch(Polygon(corners, facecolor=OBJECT_COLOR, edgecolor=MODULE_COLOR, zorder=5))
    for line in region_lines(config, body, analysis):
        axes.plot(
            line.real, line.imag, color=REGION_COLOR, lw=5.0, solid_capstyle='butt', zorder=9
        )
    draw_forces(axes, body, analysis, scale)
    axes.set_title(describe_contacts(analysis), fontsize=8, pad=2)
    x, y = body.pose[:2]
    around = 2.0 * VIEW_HALF_WIDTH * body.shape.reach
    axes.set_aspect('equal')
    axes.set_xlim(x - around, x + around)
    axes.set_ylim(y - around, y + around)
    axes.set_xticks([])
    axes.set_yticks([])
    return axes


def describe_contacts(
    analysis: GraspAnalysis, normal_forces: Mapping[str, float] | None = None
) -> str:
    """
    Return a text with the normal force and contact length of each member in contact.

    :param analysis: analysis of a grasp.
    :param normal_forces: normal force on the free object for each member [N]; None: forces of the
        analysis, in which the object is fixed.
    """
    if not analysis.contact_forces:
        return 'no contact'
    lengths = [1e3 * length for length in analysis.contact_lengths.values()]
    forces = analysis.contact_forces if normal_forces is None else normal_forces
    return f'{_list(forces.values(), "N")}, contact {_list(lengths, "mm")}'


def _list(numbers: Iterable[float], unit: str) -> str:
    """Return a text with rounded numbers and their unit; equal numbers appear once."""
    words = [f'{number:.0f}' for number in numbers]
    alike = len(words) > 1 and len(set(words)) == 1
    return f'{words[0]} {unit} each' if alike else f'{" + ".join(words)} {unit}'


def _resultants(body: ConvexObject, analysis: GraspAnalysis, scale: float) -> Points:
    """Return tail and tip (g, 2) of an arrow for each member's resultant force."""
    lines = force_lines(body, analysis, scale)
    touching = analysis.normal_forces > 0.0
    forces, member = analysis.normal_forces[touching], analysis.members[touching]
    _, group = np.unique(member, return_inverse=True)
    total = np.bincount(group, forces)
    vectors = lines[:, 1] - lines[:, 0]
    weighted = forces * lines[:, 1]  # the mean contact is weighted by the normal forces
    tips = np.bincount(group, weighted.real) + 1j * np.bincount(group, weighted.imag)
    tips /= total
    vectors = np.bincount(group, vectors.real) + 1j * np.bincount(group, vectors.imag)
    return np.stack([tips - vectors, tips], axis=1)


def _band(line: Points, width: float) -> Array:
    """Return the outline of a tube around a line."""
    steps = np.diff(line)
    along = np.concatenate([steps[:1], 0.5 * (steps[1:] + steps[:-1]), steps[-1:]])
    side = 0.5j * width * along / np.abs(along)
    outline = np.concatenate([line + side, (line - side)[::-1]])
    return np.column_stack([outline.real, outline.imag])
