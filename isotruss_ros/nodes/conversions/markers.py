# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""RViz markers of an analysed grasp and of obstacles."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
import itertools
from typing import Any

from geometry_msgs.msg import Point
from isotruss_ros.core.holding.held_shape import force_lines, region_lines
from isotruss_ros.core.kinematics.depths import member_lines
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.ellipse import Ellipse
from isotruss_ros.core.model.obstacle import Obstacle
from isotruss_ros.core.numerics.arrays import Points
from isotruss_ros.core.statics.wrinkling import MAX_UTILISATION
from isotruss_ros.nodes.conversions.messages import make_header, to_pose_message
from isotruss_ros.nodes.grasp.grasp_report import AnalyzedGrasp, GraspReport
import numpy as np
from rclpy.duration import Duration
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

#: Lifetime of markers, so that they disappear after the node has ended.
LIFETIME = Duration(seconds=1.0)
#: Length of an arrow per force [m/N], and largest length of the arrow of a normal force [m].
ARROW_SCALE, LONGEST_ARROW = 0.01, 0.5
MIN_FORCE = 1e-9
LINE_WIDTH, ARROW_WIDTH = 0.008, 0.015
#: Scale of markers whose points are in metres.
UNIT_SCALE = (1.0, 1.0, 1.0)
#: Spacing of points along curved outlines [m].
OUTLINE_SPACING = 0.01
UNDEFORMED_COLOR = ColorRGBA(r=0.18, g=0.62, b=0.27, a=0.6)
DEFORMED_COLOR = ColorRGBA(r=0.85, g=0.55, b=0.37, a=1.0)
NEARLY_WRINKLED = ColorRGBA(r=0.95, g=0.6, b=0.0, a=1.0)
WRINKLED = ColorRGBA(r=0.85, g=0.1, b=0.1, a=1.0)
FORCE = ColorRGBA(r=0.12, g=0.31, b=0.85, a=1.0)
REGION = ColorRGBA(r=0.95, g=0.75, b=0.1, a=1.0)
CLOSED = ColorRGBA(r=0.2, g=0.7, b=0.3, a=0.8)
OPEN = ColorRGBA(r=0.85, g=0.2, b=0.2, a=0.8)
OBSTACLE = ColorRGBA(r=0.35, g=0.35, b=0.4, a=0.9)


def to_marker_array(report: GraspReport, frame: str, time: float) -> MarkerArray:
    """
    Return RViz markers for a grasp report; the first marker deletes all earlier markers.

    :param time: stamp of the markers [s].
    """
    markers: list[Marker] = []
    if report.grasp is not None:
        grasp, color = report.grasp, CLOSED if report.held else OPEN
        height = grasp.config.robot.description.tube_diameter
        markers = [*_make_grasp_markers(grasp), _make_body('object', grasp.body, color, height)]
    return _replace_markers(markers, frame, time)


def to_obstacle_markers(
    obstacles: Sequence[Obstacle], height: float, frame: str, time: float
) -> MarkerArray:
    """
    Return RViz markers of obstacles, each in a namespace of its name; see `to_marker_array`.

    :param height: height of the markers, half of it above the plane of the robot [m].
    """
    markers = [_make_body(o.name, o.body, OBSTACLE, height) for o in obstacles]
    return _replace_markers(markers, frame, time)


def _replace_markers(markers: list[Marker], frame: str, time: float) -> MarkerArray:
    """Return markers with a stamp [s], after a marker that deletes all earlier ones."""
    markers = [Marker(action=Marker.DELETEALL), *markers]
    for marker in markers:
        marker.header = make_header(time, frame)
    return MarkerArray(markers=markers)


def _make_grasp_markers(grasp: AnalyzedGrasp) -> list[Marker]:
    same, strip = itertools.repeat, Marker.LINE_STRIP
    arrow, thin = (ARROW_WIDTH, 2.0 * ARROW_WIDTH, 0.0), (0.5 * LINE_WIDTH, 0.0, 0.0)
    straight, grip = member_lines(grasp.config), grasp.settled.equilibrium
    rows: list[tuple[Any, ...]] = [
        ('members', strip, same(UNDEFORMED_COLOR), thin, map(_flat, straight))
    ]
    if grip is None:
        bent = map(_flat, straight)
        rows.append(('deformed', strip, same(DEFORMED_COLOR), (LINE_WIDTH, 0.0, 0.0), bent))
        return _make_markers(rows)
    scale = min(ARROW_SCALE, LONGEST_ARROW / max(float(grip.normal_forces.max()), MIN_FORCE))
    used = map(_tube_color, grip.sections.used.tolist())
    bent = map(_flat, grip.member_lines()[1])
    strips = map(_strip, region_lines(grip), 0.5 * grip.patches.widths)
    forces = map(_flat, force_lines(grip, scale))
    rows += [
        ('deformed', strip, used, (LINE_WIDTH, 0.0, 0.0), bent),
        ('contact_regions', Marker.TRIANGLE_LIST, same(REGION), UNIT_SCALE, strips),
        ('contact_forces', Marker.ARROW, same(FORCE), arrow, forces),
    ]
    return _make_markers(rows)


def _make_markers(rows: Iterable[tuple[Any, ...]]) -> list[Marker]:
    """Return the markers of rows (namespace, type, colours, scale, lines)."""
    return [
        _make_marker(name, number, kind, color, scale, points)
        for name, kind, colors, scale, lines in rows
        for number, (color, points) in enumerate(zip(colors, lines, strict=False))
    ]


def _tube_color(utilisation: float) -> ColorRGBA:
    if utilisation > 1.0:
        return WRINKLED
    return NEARLY_WRINKLED if utilisation > MAX_UTILISATION else DEFORMED_COLOR


def _make_body(name: str, body: ConvexObject, color: ColorRGBA, height: float) -> Marker:
    """Return the prism of a convex object, half of its height [m] above the plane."""
    shape, semi_axes = body.shape, None
    if shape.is_round:
        semi_axes = shape.reach, shape.reach
    elif isinstance(shape, Ellipse):  # an outline has so many points that it delays the cycle
        semi_axes = shape.semi_axes
    if semi_axes is not None:
        scale = 2.0 * semi_axes[0], 2.0 * semi_axes[1], height
        marker = _make_marker(name, 0, Marker.CYLINDER, color, scale)
    else:
        corners = _prism(shape.outline(OUTLINE_SPACING), shape.centroid, 0.5 * height)
        marker = _make_marker(name, 0, Marker.TRIANGLE_LIST, color, UNIT_SCALE, corners)
    marker.pose = to_pose_message(body.pose)
    return marker


def _make_marker(
    name: str,
    number: int,
    kind: int,
    color: ColorRGBA,
    scale: tuple[float, float, float],
    points: Iterable[Point] = (),
) -> Marker:
    marker = Marker(ns=name, id=number, type=kind, color=color, lifetime=LIFETIME.to_msg())
    marker.scale.x, marker.scale.y, marker.scale.z = scale
    marker.points = list(points)
    return marker


def _flat(line: Points) -> Iterable[Point]:
    return (Point(x=point.real, y=point.imag) for point in line.tolist())


def _strip(line: Points, half: float) -> Iterable[Point]:
    """Yield the triangles of an upright strip, two for each segment of a line."""
    for here, following in itertools.pairwise(line.tolist()):
        low, high, last = (here, -half), (here, half), (following, half)
        for point, z in (low, high, (following, -half), (following, -half), high, last):
            yield Point(x=point.real, y=point.imag, z=z)


def _prism(outline: Points, middle: complex, half: float) -> Iterable[Point]:
    """Yield the triangles of the top face and of the sides of a prism."""
    yield from _strip(np.append(outline, outline[0]), half)
    for here, following in zip(outline.tolist(), np.roll(outline, -1).tolist(), strict=True):
        for point in (middle, here, following):
            yield Point(x=point.real, y=point.imag, z=half)
