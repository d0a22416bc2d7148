# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""An analysed grasp as markers for RViz."""

from __future__ import annotations

from collections.abc import Iterable

from geometry_msgs.msg import Point
from isotruss_ros.core.contact.deformed_shape import deformed_lines, force_lines, region_lines
from isotruss_ros.core.control.grasp_report import AnalyzedGrasp, GraspReport
from isotruss_ros.core.kinematics.depths import member_lines
from isotruss_ros.core.numerics.arrays import Points
from isotruss_ros.core.statics.wrinkling import MAX_UTILISATION
from isotruss_ros.nodes.conversions.messages import stamp_header
import numpy as np
from rclpy.duration import Duration
from rclpy.time import Time
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

#: Markers expire when the node has ended.
LIFETIME = Duration(seconds=1.0)
#: Length of an arrow for its force [m/N]; a normal force is not drawn longer than this [m].
ARROW_SCALE, LONGEST_ARROW = 0.01, 0.5
TINY = 1e-9
LINE_WIDTH, ARROW_WIDTH = 0.008, 0.015
#: Of a region of contact in the paper's model, which has none [m].
REGION_WIDTH = 0.01
#: Of the points along the curved parts of an object [m].
OUTLINE_SPACING = 0.01
UNDEFORMED = ColorRGBA(r=0.18, g=0.62, b=0.27, a=0.6)
DEFORMED = ColorRGBA(r=0.85, g=0.55, b=0.37, a=1.0)
NEARLY_WRINKLED = ColorRGBA(r=0.95, g=0.6, b=0.0, a=1.0)
WRINKLED = ColorRGBA(r=0.85, g=0.1, b=0.1, a=1.0)
FORCE = ColorRGBA(r=0.12, g=0.31, b=0.85, a=1.0)
REGION = ColorRGBA(r=0.95, g=0.75, b=0.1, a=1.0)
CLOSED = ColorRGBA(r=0.2, g=0.7, b=0.3, a=0.8)
OPEN = ColorRGBA(r=0.85, g=0.2, b=0.2, a=0.8)


class GraspMarkers:
    """
    Create markers with lasting ids: a new one replaces the old one, others are deleted.

    :param frame: the robot's frame.
    """

    def __init__(self, frame: str) -> None:
        self._frame = frame
        self._shown: set[tuple[str, int]] = set()

    def update(self, report: GraspReport, time: Time) -> MarkerArray:
        """
        Return the markers to be shown, and those to be deleted.

        :param report: of the grasp monitor.
        :param time: stamp of the markers.
        """
        markers = []
        if report.grasp is not None:
            color = CLOSED if report.held else OPEN
            markers = [*_make_grasp_markers(report.grasp), _make_object(report.grasp, color)]
        shown = {(marker.ns, marker.id) for marker in markers}
        for name, number in sorted(self._shown - shown):
            markers.append(Marker(ns=name, id=number, action=Marker.DELETE))
        for marker in markers:
            stamp_header(marker.header, time, self._frame)
        self._shown = shown
        return MarkerArray(markers=markers)


def _make_grasp_markers(grasp: AnalyzedGrasp) -> list[Marker]:
    lines = member_lines(grasp.config)
    bent = deformed_lines(grasp.config, grasp.analysis)
    strip = Marker.LINE_STRIP
    markers = [
        _make_lines('members', i, strip, 0.5, UNDEFORMED, line) for i, line in enumerate(lines)
    ]
    used = grasp.utilisation.values()
    markers += [
        _make_lines('deformed', i, strip, 1.0, _tube_color(part), line)
        for i, (line, (part, _)) in enumerate(zip(bent, used, strict=True))
    ]
    regions = region_lines(grasp.config, grasp.body, grasp.analysis)
    widths = grasp.analysis.contact_widths
    markers += [
        _make_region(i, line, widths.get(member, REGION_WIDTH))
        for i, (member, line) in enumerate(zip(grasp.analysis.contact_spans, regions, strict=True))
    ]
    strongest = float(grasp.analysis.normal_forces.max(initial=0.0))
    scale = min(ARROW_SCALE, LONGEST_ARROW / max(strongest, TINY))
    arrows = force_lines(grasp.body, grasp.analysis, scale)
    markers += [_make_arrow(i, ends) for i, ends in enumerate(arrows)]
    return markers


def _tube_color(utilisation: float) -> ColorRGBA:
    if utilisation > 1.0:
        return WRINKLED
    return NEARLY_WRINKLED if utilisation > MAX_UTILISATION else DEFORMED


def _make_marker(name: str, number: int, kind: int, color: ColorRGBA) -> Marker:
    marker = Marker(ns=name, id=number, type=kind, color=color, lifetime=LIFETIME.to_msg())
    marker.pose.orientation.w = 1.0
    return marker


def _make_lines(
    name: str, number: int, kind: int, width: float, color: ColorRGBA, points: Points
) -> Marker:
    marker = _make_marker(name, number, kind, color)
    marker.scale.x = width * LINE_WIDTH
    marker.points = list(_to_points(points))
    return marker


def _make_region(number: int, line: Points, width: float) -> Marker:
    """Return the part of the object's surface that is touched: two triangles for each step."""
    marker = _make_marker('contact_regions', number, Marker.TRIANGLE_LIST, REGION)
    marker.scale.x = marker.scale.y = marker.scale.z = 1.0
    low, high = (
        [Point(x=point.real, y=point.imag, z=z) for point in line.tolist()]
        for z in (-0.5 * width, 0.5 * width)
    )
    for i in range(len(line) - 1):
        marker.points += [low[i], high[i], low[i + 1], low[i + 1], high[i], high[i + 1]]
    return marker


def _make_arrow(number: int, ends: Points) -> Marker:
    marker = _make_marker('contact_forces', number, Marker.ARROW, FORCE)
    marker.scale.x, marker.scale.y = ARROW_WIDTH, 2.0 * ARROW_WIDTH
    marker.points = list(_to_points(ends))
    return marker


def _make_object(grasp: AnalyzedGrasp, color: ColorRGBA) -> Marker:
    body = grasp.body
    # As high as the tubes are.
    height = grasp.config.robot.description.tube_diameter
    if body.shape.is_round:
        marker = _make_marker('object', 0, Marker.CYLINDER, color)
        marker.pose.position.x, marker.pose.position.y = body.pose[:2]
        marker.scale.x = marker.scale.y = 2.0 * body.shape.reach
        marker.scale.z = height
        return marker
    marker = _make_marker('object', 0, Marker.TRIANGLE_LIST, color)
    marker.scale.x = marker.scale.y = marker.scale.z = 1.0
    marker.points = list(_prism(body.outline(OUTLINE_SPACING), body.middle, 0.5 * height))
    return marker


def _prism(outline: Points, middle: complex, half: float) -> Iterable[Point]:
    """Yield the corners of triangles on the top and the sides of a prism."""
    for here, following in zip(outline.tolist(), np.roll(outline, -1).tolist(), strict=True):
        top = [(middle, half), (here, half), (following, half)]
        side = [(here, half), (here, -half), (following, half)]
        rest = [(following, half), (here, -half), (following, -half)]
        for point, z in (*top, *side, *rest):
            yield Point(x=point.real, y=point.imag, z=z)


def _to_points(points: Points) -> Iterable[Point]:
    return (Point(x=point.real, y=point.imag) for point in points.tolist())
