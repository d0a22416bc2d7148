"""Draw what holds the object, in the manner of the paper's Fig. 7."""

from __future__ import annotations

from isotruss_ros.core import Configuration, Cylinder, GraspAnalysis
from isotruss_ros.core.grasp_lines import deformed_lines, force_lines, member_lines, region_lines
from isotruss_ros.demo.drawing import MODULE_COLOR, OBJECT_COLOR, TUBE_COLORS
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon
import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.complex128]

FORCE_COLOR = '#c8102e'
REGION_COLOR = '#1b1b6f'
UNDEFORMED_COLOR = '#2e9e44'
#: Length of an arrow for its force [m/N].
ARROW_SCALE = 0.015
#: The magnified view shows this much on each side of the object's centre, in diameters.
AROUND = 1.0


def draw_forces(
    axes: Axes, cylinder: Cylinder, analysis: GraspAnalysis, scale: float = ARROW_SCALE
) -> None:
    """
    Draw the forces on the object, friction included, as arrows that push at its surface.

    :param scale: length of an arrow for its force [m/N].
    """
    for tail, tip in force_lines(cylinder, analysis, scale):
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


def draw_grasp(
    axes: Axes,
    config: Configuration,
    cylinder: Cylinder,
    analysis: GraspAnalysis,
    spacing: float = 0.005,
    scale: float = ARROW_SCALE,
) -> None:
    """
    Draw the object, the bent tubes, where they were, contact regions and forces, magnified.

    :param spacing: of the points along the tubes, as in the analysis [m].
    :param scale: length of an arrow for its force [m/N].
    """
    robot = config.robot
    for tube, line in zip(robot.layout.tube, deformed_lines(config, analysis), strict=True):
        band = _band(line, robot.description.tube_diameter)
        color = TUBE_COLORS[tube % len(TUBE_COLORS)]
        axes.add_patch(Polygon(band, facecolor=color, edgecolor='white', lw=0.5, alpha=0.85))
    for line in member_lines(config):
        axes.plot(line.real, line.imag, '--', color=UNDEFORMED_COLOR, lw=1.0, zorder=6)
    axes.add_patch(
        Circle(
            cylinder.center,
            0.5 * cylinder.diameter,
            facecolor=OBJECT_COLOR,
            edgecolor=MODULE_COLOR,
            zorder=5,
        )
    )
    for line in region_lines(analysis, spacing):
        # Where skin and object meet, not on the tube's centre line.
        inward = complex(*cylinder.center) - line.mean()
        skin = line + 0.5 * robot.description.tube_diameter * inward / abs(inward)
        axes.plot(skin.real, skin.imag, color=REGION_COLOR, lw=5.0, zorder=9)
    draw_forces(axes, cylinder, analysis, scale)
    lengths = ' + '.join(f'{1e3 * length:.0f}' for length in analysis.contact_lengths.values())
    axes.set_title(f'{analysis.normal_forces.sum():.1f} N on {lengths or 0} mm', fontsize=8, pad=2)
    x, y = cylinder.center
    around = AROUND * cylinder.diameter
    axes.set_aspect('equal')
    axes.set_xlim(x - around, x + around)
    axes.set_ylim(y - around, y + around)
    axes.set_xticks([])
    axes.set_yticks([])


def _band(line: Points, width: float) -> NDArray[np.float64]:
    """Return the outline of a tube around a line."""
    steps = np.diff(line)
    along = np.concatenate([steps[:1], 0.5 * (steps[1:] + steps[:-1]), steps[-1:]])
    side = 0.5j * width * along / np.abs(along)
    outline = np.concatenate([line + side, (line - side)[::-1]])
    return np.column_stack([outline.real, outline.imag])
