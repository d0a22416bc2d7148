"""An analysed grasp as markers for RViz."""

from __future__ import annotations

from collections.abc import Iterable

from geometry_msgs.msg import Point
from isotruss_ros.core import AnalyzedGrasp, GraspReport
from isotruss_ros.core.grasp_lines import (
    deformed_lines,
    force_lines,
    member_lines,
    region_lines,
)
from isotruss_ros.nodes.messages import stamp
import numpy as np
from numpy.typing import NDArray
from rclpy.duration import Duration
from rclpy.time import Time
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

Points = NDArray[np.complex128]

#: Nothing old stays in the picture when the node has gone.
LIFETIME = Duration(seconds=1.0)
#: Length of an arrow for its force [m/N]; but a normal force is not drawn longer than this [m].
ARROW_SCALE, LONGEST_ARROW = 0.01, 0.5
TINY = 1e-9
LINE_WIDTH, REGION_WIDTH, ARROW_WIDTH = 0.008, 0.025, 0.015
UNDEFORMED = ColorRGBA(r=0.18, g=0.62, b=0.27, a=0.6)
DEFORMED = ColorRGBA(r=0.85, g=0.55, b=0.37, a=1.0)
FORCE = ColorRGBA(r=0.12, g=0.31, b=0.85, a=1.0)
REGION = ColorRGBA(r=0.95, g=0.75, b=0.1, a=1.0)
CLOSED = ColorRGBA(r=0.2, g=0.7, b=0.3, a=0.8)
OPEN = ColorRGBA(r=0.85, g=0.2, b=0.2, a=0.8)


class GraspMarkers:
    """
    Makes markers with lasting ids: a new one replaces the old, and what vanished is deleted.

    :param frame: the robot's frame.
    """

    def __init__(self, frame: str) -> None:
        self._frame = frame
        self._shown: set[tuple[str, int]] = set()

    def update(self, report: GraspReport, time: Time) -> MarkerArray:
        """Return what is to be shown now, and deleted of what was shown before."""
        markers = []
        if report.grasp is not None:
            color = CLOSED if report.force_closure else OPEN
            markers = [*_grasp_markers(report.grasp), _object(report.grasp, color)]
        shown = {(marker.ns, marker.id) for marker in markers}
        for name, number in sorted(self._shown - shown):
            markers.append(Marker(ns=name, id=number, action=Marker.DELETE))
        for marker in markers:
            stamp(marker.header, time, self._frame)
        self._shown = shown
        return MarkerArray(markers=markers)


def _grasp_markers(grasp: AnalyzedGrasp) -> list[Marker]:
    lines = member_lines(grasp.config)
    bent = deformed_lines(grasp.config, grasp.analysis)
    strip = Marker.LINE_STRIP
    markers = [_lines('members', i, strip, 0.5, UNDEFORMED, line) for i, line in enumerate(lines)]
    markers += [_lines('deformed', i, strip, 1.0, DEFORMED, line) for i, line in enumerate(bent)]
    regions = region_lines(grasp.analysis, grasp.spacing)
    if len(regions):
        wide = REGION_WIDTH / LINE_WIDTH
        pieces = _lines('contact_regions', 0, Marker.LINE_LIST, wide, REGION, regions.ravel())
        markers.append(pieces)
    strongest = float(grasp.analysis.normal_forces.max(initial=0.0))
    scale = min(ARROW_SCALE, LONGEST_ARROW / max(strongest, TINY))
    arrows = force_lines(grasp.cylinder, grasp.analysis, scale)
    markers += [_arrow(i, ends) for i, ends in enumerate(arrows)]
    return markers


def _marker(name: str, number: int, kind: int, color: ColorRGBA) -> Marker:
    marker = Marker(ns=name, id=number, type=kind, color=color, lifetime=LIFETIME.to_msg())
    marker.pose.orientation.w = 1.0
    return marker


def _lines(
    name: str, number: int, kind: int, width: float, color: ColorRGBA, points: Points
) -> Marker:
    marker = _marker(name, number, kind, color)
    marker.scale.x = width * LINE_WIDTH
    marker.points = list(_points(points))
    return marker


def _arrow(number: int, ends: Points) -> Marker:
    marker = _marker('contact_forces', number, Marker.ARROW, FORCE)
    marker.scale.x, marker.scale.y = ARROW_WIDTH, 2.0 * ARROW_WIDTH
    marker.points = list(_points(ends))
    return marker


def _object(grasp: AnalyzedGrasp, color: ColorRGBA) -> Marker:
    marker = _marker('object', 0, Marker.CYLINDER, color)
    marker.pose.position.x, marker.pose.position.y = grasp.cylinder.center
    marker.scale.x = marker.scale.y = grasp.cylinder.diameter
    # As high as the tubes are.
    marker.scale.z = grasp.config.robot.description.tube_diameter
    return marker


def _points(points: Points) -> Iterable[Point]:
    return (Point(x=point.real, y=point.imag) for point in points.tolist())
