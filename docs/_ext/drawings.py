# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Labelled pictures of the site: parts of a robot, forces on a held object, closure."""

from pathlib import Path

from isotruss_ros.core import analyze_grasp, ConvexObject, load_robot, settle_grasp, tangent_center
from isotruss_ros.plotting import plot_grasp, plot_robot
from isotruss_ros.plotting.grasp_drawing import FORCE_COLOR
import matplotlib as mpl
from matplotlib import patheffects
from matplotlib.axes import Axes
import matplotlib.pyplot as plt
from matplotlib.text import Text
import numpy as np

IMAGES = Path(__file__).parents[1] / 'images'
#: Colour of friction forces, and length of the largest normal force's arrow [m].
FRICTION_COLOR, LONGEST = '#1b5fb4', 0.2
#: Style of words on a drawing.
CENTRED = {
    'ha': 'center',
    'va': 'center',
    'path_effects': [patheffects.withStroke(linewidth=3.0, foreground='white')],
}
YES = {True: 'yes', False: 'no'}
INK, LINE = '#222222', '#777777'
ARROW = {'arrowstyle': '-|>', 'color': INK, 'lw': 1.4, 'shrinkA': 0.0, 'shrinkB': 0.0}


def main() -> None:
    """Draw all pictures as SVG, and the robot as PNG."""
    mpl.rcParams.update({'font.size': 10, 'svg.hashsalt': 'isotruss_ros', 'svg.fonttype': 'path'})
    robot = draw_parts()
    robot.savefig(IMAGES / 'robot.svg', metadata={'Date': None})
    robot.savefig(IMAGES / 'robot.png', dpi=110)
    draw_forces().savefig(IMAGES / 'held_object.svg', metadata={'Date': None})
    draw_closure().savefig(IMAGES / 'closure.svg', metadata={'Date': None})


def list_words() -> list[str]:
    """Return the words of the drawings that have computed numbers."""
    with mpl.rc_context():
        figures = draw_forces(), draw_closure()
    texts = [text.get_text() for figure in figures for text in figure.findobj(Text)]
    return [text for text in texts if text]


def draw_parts() -> plt.Figure:
    """Return the drawing of a triangle with the names of its parts."""
    robot = load_robot('triangle')
    config, figure = robot.home, plt.figure(figsize=(8.6, 5.6), layout='constrained')
    axes = plot_robot(config, figure.add_subplot())
    axes.set_axis_off()
    axes.set_xlim(-0.75, 2.2)
    axes.set_ylim(-0.45, 1.55)
    axes.set_aspect('equal')
    names = config.robot.node_names
    place = {name: complex(*config.nodes[i]) for i, name in enumerate(names)}
    ring = robot.description.module.guide_ring_distance
    a, b, c = (place[each] for each in ('T', 'main/T/B', 'main/T/C'))
    toward_l = (place['main/L/C'] - b) / abs(place['main/L/C'] - b)
    toward_r = (place['main/R/B'] - c) / abs(place['main/R/B'] - c)
    d, e = b + ring * toward_l, c + ring * toward_r
    for spot, along in ((d, toward_l), (e, toward_r)):
        across = 0.06j * along
        axes.plot(*_xy([spot - across, spot + across]), color=INK, lw=3.0, zorder=6)
    for spot in (b, c):
        axes.plot(*_xy([spot]), 'o', color='white', mec=INK, ms=4, zorder=7)
    _label(axes, a, a + (0.34 + 0.16j), 'A, the universal joint')
    _label(axes, 0.5 * (a + 0.5 * (b + c)), a + (0.5 + 0.02j), 'rod, of length h')
    _label(axes, c, c + (0.5 + 0.03j), 'C, a pinch point')
    _label(axes, e, e + (0.42 - 0.08j), 'E, a guide ring, g from C')
    _label(axes, b, b + (-0.5 + 0.03j), 'B, a pinch point')
    _label(axes, d, d + (-0.42 - 0.08j), 'D, a guide ring, g from B')
    middle = 0.5 * (place['main/R/B'] + c)
    _label(axes, middle, middle + (0.38 + 0.0j), 'member main/R-T:\ntube from pinch to pinch')
    passive = 0.5 * (place['main/L/B'] + place['main/L/C'])
    _label(axes, passive, passive + (-0.42 + 0.3j), 'passive module:\nno motor')
    driven = 0.5 * (place['main/R/B'] + place['main/R/C'])
    _label(axes, driven, driven + (0.36 + 0.2j), 'roller module main/R')
    _label(axes, place['L'] - 0.06j, place['L'] + (0.2 - 0.28j), 'support [x, y]')
    _label(axes, place['R'] - 0.06j, place['R'] + (0.2 - 0.28j), 'support [y]: it slides along x')
    # The sign of the travel: from the side of C to the side of B.
    axes.annotate(
        '',
        xy=(1.06, 0.42),
        xytext=(0.9, 0.18),
        arrowprops=ARROW | {'connectionstyle': 'arc3,rad=0.3'},
        zorder=8,
    )
    axes.text(0.62, 0.36, 'positive travel:\nfrom the side of C\nto the side of B', ha='center')
    origin = -0.68 - 0.36j
    for tip in (0.2, 0.2j):
        axes.annotate(
            '', xy=_xy([origin + tip]).ravel(), xytext=_xy([origin]).ravel(), arrowprops=ARROW
        )
    axes.text(-0.46, -0.36, 'x', va='center')
    axes.text(-0.68, -0.13, 'y', ha='center')
    axes.text(-0.64, -0.29, 'frame truss', fontsize=8, color=LINE)
    return figure


def draw_forces() -> plt.Figure:
    """Return the drawing of a held disc with the names of the computed quantities."""
    robot = load_robot('nine_member')
    center = tangent_center(robot.home, 'north/Z', 0.3, 0.02)
    body = ConvexObject.disc(center, 0.3)
    held = settle_grasp(robot.home, body, 0.8)
    figure = plt.figure(figsize=(8.0, 4.0), layout='constrained')
    axes = plot_grasp(held.equilibrium, figure.add_subplot())
    axes.set_axis_off()
    axes.set_xlim(center[0] - 0.72, center[0] + 0.72)
    axes.set_ylim(center[1] - 0.36, center[1] + 0.34)
    axes.set_title('')
    middle = complex(*center)
    touched = middle + 0.15 * np.exp(1j * np.deg2rad(30.0))
    _label(axes, middle, middle - 0.28j, 'object: a disc of 0.3 m')
    _label(axes, touched, middle + (0.42 + 0.02j), 'contact region\nof a member')
    _label(axes, middle + (0.28 + 0.091j), middle + (0.42 + 0.2j), 'its force on the object')
    _label(axes, middle + (-0.27 - 0.16j), middle + (-0.58 + 0.02j), 'tube, bent and flattened')
    _label(axes, middle + (-0.37 - 0.26j), middle + (-0.58 - 0.3j), 'axis without load')
    return figure


def draw_closure() -> plt.Figure:
    """Return the drawing of a fixed disc, of a held disc, and of a disc with wrinkling tubes."""
    figure, row = plt.subplots(1, 3, figsize=(9.0, 3.3), layout='constrained')
    _draw_verdict(row[0], 0.02, False)
    _draw_verdict(row[1], 0.02, True)
    _draw_verdict(row[2], 0.06, True)
    return figure


def _draw_verdict(axes: Axes, shift: float, free: bool) -> None:
    """Draw the forces of two members on a disc, and their closure in words below."""
    home = load_robot('nine_member').home
    body = ConvexObject.disc(tangent_center(home, 'south/P', 0.3, shift), 0.3)
    fast, settled = analyze_grasp(home, body, 0.8), settle_grasp(home, body, 0.8)
    plot_grasp(settled.equilibrium, axes, scale=0.0)
    axes.set_axis_off()
    axes.set_ylim(body.center.imag - 0.25, body.center.imag + 0.33)
    axes.set_xlim(body.center.real - 0.36, body.center.real + 0.36)
    members = [home.robot.member_names.index(name) for name in settled.normal_forces]
    if free:
        pressing, rubbing = settled.normal_forces.values(), settled.friction_forces.values()
        words = f'free\nforce closure: {YES[settled.force_closure]}, held: {YES[settled.held]}'
        words += ', a tube wrinkles' if not settled.held else ''
    else:
        pressing = fast.contact_forces.values()
        rubbing = [fast.friction_forces[fast.members == i].sum() for i in members]
        closed = YES[fast.closed_by_friction]
        words = f'fixed\nclosed by friction: {closed}, {fast.closure_residual:.1f} N left'
    for i, normal, along in zip(settled.equilibrium.state.normals, pressing, rubbing, strict=True):
        touched = body.center + 0.15 * i
        for force, color, name in (
            (-normal * i, FORCE_COLOR, f'{normal:.0f} N'),
            (1j * along * i, FRICTION_COLOR, f'{abs(along):.0f} N'),
        ):
            tail = touched - LONGEST / max(pressing) * force
            label = tail - 0.025 * force / abs(force)
            axes.annotate(
                '',
                xy=(touched.real, touched.imag),
                xytext=(tail.real, tail.imag),
                arrowprops=ARROW | {'color': color},
                zorder=12,
            )
            axes.text(label.real, label.imag, name, color=color, zorder=12, **CENTRED)
    axes.set_title(words, fontsize=9, y=-0.12)


def _xy(points: list[complex]) -> np.ndarray:
    """Return x and y (2, n) of points."""
    return np.array([np.real(points), np.imag(points)])


def _label(axes: Axes, spot: complex, text_at: complex, text: str) -> None:
    """Write a label with a line to the labelled point."""
    left = text_at.real < spot.real
    centred = abs(text_at.real - spot.real) < 0.05
    axes.annotate(
        text,
        xy=(spot.real, spot.imag),
        xytext=(text_at.real, text_at.imag),
        ha='center' if centred else ('right' if left else 'left'),
        va='center',
        color=INK,
        arrowprops={'arrowstyle': '-', 'color': LINE, 'lw': 0.8},
        zorder=10,
    )


if __name__ == '__main__':
    main()
