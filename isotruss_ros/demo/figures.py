"""The picture of the demonstration, like the paper's Fig. 9, and its animation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from isotruss_ros.core import analyze_grasp, Configuration, Cylinder, Robot, settle_grasp
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.demo.path import Wrench
from isotruss_ros.demo.record import PhaseRecord, Snapshot
from isotruss_ros.plotting.grasp_drawing import draw_forces, draw_grasp
from isotruss_ros.plotting.robot_drawing import draw_object, draw_robot, frame, PATH_COLOR
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure
import numpy as np

MARGIN = 0.12
#: Frames of the animation per second, and by what factor it is faster than real time.
FRAMES_PER_SECOND = 12
SPEED_UP = 3.0

#: Length of an arrow for its force [m/N]; in the magnified view, too.
ARROW_SCALE = 0.004
#: Width of the magnified view of the grasp beside a panel, as a share of the panel's.
BESIDE = 0.55

#: Of what pulls at the object; its arrow is larger than those of the contacts [m/N].
PULL_COLOR, PULL_SCALE = '#d9480f', 0.05

Box = tuple[Array, Array]


def draw_panels(robot: Robot, diameter: float, records: Sequence[PhaseRecord], path: Path) -> None:
    """Write one panel for the end of each phase; the grasp magnified where there is one."""
    stops = [record.snapshots[-1] for record in records]
    configs = [robot.configuration(stop.rollers) for stop in stops]
    box = _box(configs)
    columns = -(-len(stops) // 2)
    figure = Figure(figsize=(5.4 * columns, 6.6), layout='constrained')
    grid = figure.subplots(2, 2 * columns, width_ratios=[1.0, BESIDE] * columns)
    panels, views = grid[:, ::2].ravel(), grid[:, 1::2].ravel()
    for axes in grid.flat:
        axes.set_anchor('NW')
    shown = len(stops)
    for axes in (*panels[shown:], *views):
        axes.set_axis_off()
    travelled: list[Snapshot] = []
    for i, stop in enumerate(stops):
        axes = panels[i]
        draw_robot(axes, configs[i])
        travelled += records[i].snapshots
        _draw_path(axes, travelled)
        _draw_pull(axes, records[i])
        draw_object(axes, stop.pose, diameter)
        cylinder = Cylinder(stop.pose[:2], diameter)
        analysis = analyze_grasp(configs[i], cylinder)
        draw_forces(axes, cylinder, analysis, ARROW_SCALE)
        frame(axes, *box)
        held = ''
        if analysis.contact_lengths:
            views[i].set_axis_on()
            draw_grasp(views[i], configs[i], cylinder, analysis, scale=ARROW_SCALE)
            grasped = len(analysis.contact_lengths) > 1
            held = ', held' if grasped and settle_grasp(configs[i], cylinder).held else ''
        axes.set_title(f'({"abcdefgh"[i]}) {records[i].name}{held}', loc='left')
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
        for record in records:
            if record.pulled[0] <= chosen[i].time <= record.pulled[1]:
                _draw_arrow(axes, chosen[i], record.pull)
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


def _draw_pull(axes: object, record: PhaseRecord) -> None:
    """Mark where an external wrench pulled at the object, with an arrow in the middle."""
    begin, end = record.pulled
    snapshots = [snap for snap in record.snapshots if begin <= snap.time <= end]
    if not snapshots:
        return
    places = np.array([snap.pose[:2] for snap in snapshots])
    axes.plot(*places.T, color=PULL_COLOR, lw=2.4, zorder=8)
    _draw_arrow(axes, snapshots[len(snapshots) // 2], record.pull)


def _draw_arrow(axes: object, snapshot: Snapshot, pull: Wrench) -> None:
    """Draw what pulls at the object, as an arrow with its size."""
    place = np.array(snapshot.pose[:2])
    tip = place + PULL_SCALE * np.array(pull[:2])
    arrow = {'arrowstyle': '-|>', 'color': PULL_COLOR, 'lw': 2.0}
    axes.annotate('', tip, place, arrowprops=arrow, zorder=12)
    axes.annotate(
        f'{np.hypot(*pull[:2]):g} N', tip, (4, -2), textcoords='offset points', color=PULL_COLOR
    )


def _box(configs: Sequence[Configuration]) -> Box:
    nodes = np.concatenate([config.nodes for config in configs])
    return nodes.min(axis=0) - MARGIN, nodes.max(axis=0) + MARGIN
