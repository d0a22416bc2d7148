"""The picture in the manner of the paper's Fig. 9, and an animation of the same."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from isotruss_ros.core import analyze_grasp, Configuration, Cylinder, Robot
from isotruss_ros.demo.drawing import draw_object, draw_robot, frame, PATH_COLOR
from isotruss_ros.demo.grasp_drawing import draw_forces, draw_grasp
from isotruss_ros.demo.record import PhaseRecord, Snapshot
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure
import numpy as np
from numpy.typing import NDArray

MARGIN = 0.12
#: The animation shows this many pictures per second, and time this many times quicker.
FRAMES_PER_SECOND = 12
SPEED_UP = 3.0

#: Length of an arrow for its force [m/N].
ARROW_SCALE = 0.004
#: The grasp, magnified, is beside its panel: left, bottom, width, height as shares of that.
BESIDE = (1.03, 0.52, 0.48, 0.48)

Box = tuple[NDArray[np.float64], NDArray[np.float64]]


def draw_panels(robot: Robot, diameter: float, records: Sequence[PhaseRecord], path: Path) -> None:
    """Write one panel for the end of each phase; the grasp magnified where there is one."""
    stops = [record.snapshots[-1] for record in records]
    configs = [robot.configuration(stop.rollers) for stop in stops]
    box = _box(configs)
    columns = -(-len(stops) // 2)
    figure = Figure(figsize=(5.8 * columns, 7.6), layout='constrained')
    travelled: list[Snapshot] = []
    panels = figure.subplots(2, columns).ravel()
    count = len(stops)
    for axes in panels[count:]:
        axes.set_axis_off()
    for i, axes in enumerate(panels[:count]):
        draw_robot(axes, configs[i])
        travelled += records[i].snapshots
        _draw_path(axes, travelled)
        draw_object(axes, stops[i].pose, diameter)
        cylinder = Cylinder(stops[i].pose[:2], diameter)
        analysis = analyze_grasp(configs[i], cylinder)
        draw_forces(axes, cylinder, analysis, ARROW_SCALE)
        frame(axes, *box)
        if analysis.contact_lengths:
            draw_grasp(axes.inset_axes(BESIDE), configs[i], cylinder, analysis, scale=ARROW_SCALE)
        closed = ', closed by friction' if analysis.force_closure else ''
        axes.set_title(f'({"abcdefgh"[i]}) {records[i].name}{closed}', loc='left')
    figure.savefig(path, dpi=110)


def animate(robot: Robot, diameter: float, records: Sequence[PhaseRecord], path: Path) -> None:
    """Write the whole motion as an animated GIF."""
    snapshots = [snap for record in records for snap in record.snapshots]
    times = np.array([snap.time for snap in snapshots])
    ticks = np.arange(times[0], times[-1], SPEED_UP / FRAMES_PER_SECOND)
    chosen = [snapshots[i] for i in np.searchsorted(times, ticks)]
    configs = []
    for snap in chosen:
        near = configs[-1] if configs else None
        configs.append(robot.configuration(snap.rollers, near=near))
    box = _box(configs)
    figure = Figure(figsize=(5.2, 4.6), layout='constrained')
    axes = figure.subplots()

    def show(i: int) -> None:
        axes.clear()
        draw_robot(axes, configs[i])
        _draw_path(axes, chosen[: i + 1])
        draw_object(axes, chosen[i].pose, diameter)
        cylinder = Cylinder(chosen[i].pose[:2], diameter)
        draw_forces(axes, cylinder, analyze_grasp(configs[i], cylinder), ARROW_SCALE)
        frame(axes, *box)

    animation = FuncAnimation(figure, show, frames=len(chosen))
    animation.save(path, writer=PillowWriter(fps=FRAMES_PER_SECOND), dpi=70)


def _draw_path(axes: object, snapshots: Sequence[Snapshot]) -> None:
    axes.plot(
        [snap.pose.x for snap in snapshots],
        [snap.pose.y for snap in snapshots],
        color=PATH_COLOR,
        lw=1.8,
        zorder=7,
    )


def _box(configs: Sequence[Configuration]) -> Box:
    nodes = np.concatenate([config.nodes for config in configs])
    return nodes.min(axis=0) - MARGIN, nodes.max(axis=0) + MARGIN
