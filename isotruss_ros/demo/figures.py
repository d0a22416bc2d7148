# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Picture of the demonstration, like the paper's Fig. 9, and animation as a GIF."""

from __future__ import annotations

from collections.abc import Sequence
import json
from pathlib import Path
from typing import Any

from isotruss_ros.core import Configuration, ConvexObject, Pose, Robot, settle_grasp
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.kinematics.depths import member_lines
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.demo.path import Wrench
from isotruss_ros.demo.record import PhaseRecord, Snapshot
from isotruss_ros.plotting.grasp_drawing import describe_contacts, draw_forces, plot_grasp
from isotruss_ros.plotting.robot_drawing import draw_object, frame, PATH_COLOR, plot_robot
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure
import numpy as np

MARGIN = 0.12
#: Number of frames of the animation per second [Hz].
FRAMES_PER_SECOND = 12
SPEED_UP = 5.0

#: Ratio of an arrow's length to its force [m/N], also in the magnified view.
ARROW_SCALE = 0.004
#: Width and height of the magnified view of a grasp, and its distance from the robot, relative to
#: the size of the panel [-].
VIEW, VIEW_ROOM = 0.33, 0.04

#: Colour of the external force's arrow, and its length over the force [m/N], which is larger than
#: `ARROW_SCALE`.
PULL_COLOR, PULL_SCALE = '#d9480f', 0.08

Box = tuple[Array, Array]


def draw_panels(
    robot: Robot,
    diameter: float,
    records: Sequence[PhaseRecord],
    path: Path,
) -> None:
    """
    Write a picture with a panel for each phase, each with a magnified grasp in a corner.

    The file's metadata contain a text about the state in each panel; `tools/pictures.py` compares
    these texts.

    :param diameter: diameter of the object [m].
    """
    stops: list[tuple[str, Snapshot, Wrench | None]] = []
    for record in records:
        if record.pull is not None:
            begin, end = record.pulled
            pulled = [snap for snap in record.snapshots if begin <= snap.time <= end]
            title = f'{record.name}, pulled with {np.hypot(*record.pull[:2]):g} N'
            # One for the middle of the pull, before that for the end of the phase.
            if pulled:
                stops.append((title, pulled[len(pulled) // 2], record.pull))
        stops.append((record.name, record.snapshots[-1], None))
    travelled = [snap for record in records for snap in record.snapshots]
    configs = [robot.configuration(snapshot.rollers) for _, snapshot, _ in stops]
    box = _box(configs)
    count = len(stops)
    columns = -(-count // 2)
    figure = Figure(figsize=(3.4 * columns, 8.2), layout='constrained')
    figure.get_layout_engine().set(h_pad=0.12)  # type: ignore[union-attr]
    panels = figure.subplots(2, columns, sharex=True, sharey=True).ravel()
    shown: list[dict[str, Any]] = []
    for axes in panels[count:]:
        axes.set_axis_off()
    for i, (title, snapshot, pull) in enumerate(stops):
        axes, pose = panels[i], snapshot.pose
        plot_robot(configs[i], axes)
        _draw_path(axes, [snap for snap in travelled if snap.time <= snapshot.time])
        draw_object(axes, pose, diameter)
        cylinder = ConvexObject.disc(pose[:2], diameter)
        grip, words = settle(configs[i], cylinder, pull)
        if pull is not None:
            _draw_pull(axes, pose, pull)
        frame(axes, *box)
        axes.label_outer()
        if grip is not None:
            draw_forces(axes, grip, ARROW_SCALE)
            inset = axes.inset_axes(_free_corner(configs[i], box))
            plot_grasp(grip, inset, ARROW_SCALE).set_title('')
        axes.set_title(f'({"abcdefgh"[i]}) {title}{words}', loc='left')
        rollers = np.asarray(snapshot.rollers).tolist()
        shown.append({'rollers': rollers, 'pose': [*pose], 'pull': pull})
    text = json.dumps({'robot': robot.name, 'diameter': diameter, 'panels': shown})
    figure.savefig(path, dpi=110, bbox_inches='tight', metadata={'Description': text})


def settle(
    config: Configuration, body: ConvexObject, pull: Wrench | None
) -> tuple[HeldGrip | None, str]:
    """
    Return the equilibrium of the object, and a text that describes how the object is held.

    :param pull: external wrench on the object [N, N, N m]; None: zero.
    """
    wrench = pull or (0.0, 0.0, 0.0)
    settled = settle_grasp(config, body, external_wrench=wrench)
    grip = settled.equilibrium
    if grip is None:
        return None, '\nno contact'
    return grip, f'{", held" if settled.held else ""}\n{describe_contacts(grip)}'


def _free_corner(config: Configuration, box: Box) -> tuple[float, ...]:
    """Return the box (x, y, width, height) in a corner that hides the least of the robot."""
    share = np.linspace(0.0, 1.0, 20)
    begin, end = member_lines(config).T[..., None]
    line = (begin + share * (end - begin)).ravel()
    parts = np.concatenate([np.column_stack([line.real, line.imag]), config.nodes])
    places = (parts - box[0]) / (box[1] - box[0])
    corners = [(x, y) for y in (1.0 - VIEW, 0.0) for x in (1.0 - VIEW, 0.0)]
    hidden = [
        np.all(np.abs(places - low - 0.5 * VIEW) < 0.5 * VIEW + VIEW_ROOM, axis=1).sum()
        for low in corners
    ]
    return (*corners[int(np.argmin(hidden))], VIEW, VIEW)


def animate(robot: Robot, diameter: float, records: Sequence[PhaseRecord], path: Path) -> None:
    """
    Write the whole motion as an animated GIF, drawn with Matplotlib.

    :param diameter: diameter of the object [m].
    """
    snapshots = [snap for record in records for snap in record.snapshots]
    times = np.array([snap.time for snap in snapshots])
    ticks = np.arange(times[0], times[-1], SPEED_UP / FRAMES_PER_SECOND)
    places: Any = np.searchsorted(times, ticks)
    chosen = [snapshots[i] for i in places]
    configs: list[Configuration] = []
    for snap in chosen:
        near = configs[-1] if configs else None
        configs.append(robot.configuration(snap.rollers, near=near))
    box = _box(configs)
    figure = Figure(figsize=(5.2, 4.6), layout='constrained')
    axes = figure.subplots()

    def show(i: int) -> None:
        axes.clear()
        plot_robot(configs[i], axes)
        _draw_path(axes, chosen[: i + 1])
        for record in records:
            if record.pulled[0] <= chosen[i].time <= record.pulled[1]:
                _draw_pull(axes, chosen[i].pose, record.pull)
        draw_object(axes, chosen[i].pose, diameter)
        cylinder = ConvexObject.disc(chosen[i].pose[:2], diameter)
        grip = settle_grasp(configs[i], cylinder).equilibrium
        if grip is not None:
            draw_forces(axes, grip, ARROW_SCALE)
        frame(axes, *box)

    animation = FuncAnimation(figure, show, frames=len(chosen))
    animation.save(path, writer=PillowWriter(fps=FRAMES_PER_SECOND), dpi=70)


def _draw_path(axes: Any, snapshots: Sequence[Snapshot]) -> None:
    axes.plot(
        [snap.pose.x for snap in snapshots],
        [snap.pose.y for snap in snapshots],
        color=PATH_COLOR,
        lw=1.8,
        zorder=7,
    )


def _draw_pull(axes: Any, pose: Pose, pull: Wrench) -> None:
    """Draw the external force as an arrow, with its magnitude."""
    place = np.array(pose[:2])
    tip = place + PULL_SCALE * np.array(pull[:2])
    arrow = {'arrowstyle': '-|>', 'color': PULL_COLOR, 'lw': 2.5, 'shrinkA': 0.0}
    axes.annotate('', tip, place, arrowprops=arrow, zorder=12)
    label = f'{np.hypot(*pull[:2]):g} N'
    axes.annotate(
        label, tip, (5, 0), textcoords='offset points', color=PULL_COLOR, weight='bold', zorder=12
    )


def _box(configs: Sequence[Configuration]) -> Box:
    nodes = np.concatenate([config.nodes for config in configs])
    return nodes.min(axis=0) - MARGIN, nodes.max(axis=0) + MARGIN
