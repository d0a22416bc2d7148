# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Penetration depths of an object in the undeformed members, and removal of overlaps."""

from __future__ import annotations

from typing import Any

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject, segment_gaps
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.numerics.samples import column
from isotruss_ros.core.numerics.tolerances import ROUNDING
import numpy as np


def member_lines(config: Any) -> Points:
    """Return the end points (..., m, 2) of the members' undeformed centre lines [m]."""
    topology, points = config.robot.topology, config.points
    return np.stack([points[..., topology.b], points[..., topology.end]], axis=-1)


def member_depths(config: Any, body: Any) -> Array:
    """
    Return the depth (..., m) of an object in each undeformed member, negative for a gap [m].

    Configuration and object are one, or those of several samples.
    """
    if body.shape.is_round:
        return circle_depths(config, body)  # in a fifth of the time
    radius, lines = 0.5 * config.robot.description.tube_diameter, member_lines(config)
    return radius - segment_gaps(body, lines[..., 0], lines[..., 1]).gaps


def circle_depths(config: Any, body: Any) -> Array:
    """Return the depths (..., m) of an object's circumscribed circle, see `member_depths`."""
    topology, points = config.robot.topology, config.points
    starts, radius = points[..., topology.b], 0.5 * config.robot.description.tube_diameter
    center, reach = column(body.center), column(body.shape.reach)
    spans = points[..., topology.end] - starts
    shares = np.clip(((center - starts) / spans).real, 0.0, 1.0)
    return radius + reach - np.abs(starts + shares * spans - center)


def push_out(config: Configuration, body: ConvexObject) -> ConvexObject:
    """Return an object translated along normals, out of the members that it overlaps."""
    starts, ends = member_lines(config).T
    radius = 0.5 * config.robot.description.tube_diameter
    for _ in range(200):  # a closing wedge needs many small pushes
        nearest = segment_gaps(body, starts, ends)
        deepest = int(np.argmin(nearest.gaps))
        depth = radius - float(nearest.gaps[deepest])
        if depth <= ROUNDING:
            break
        push = -depth * complex(nearest.normals[deepest])
        x, y, angle = body.pose
        body = body.moved_to((x + push.real, y + push.imag, angle))
    return body
