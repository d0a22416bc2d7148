# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How deep an object is in members as they are without load, and where they push it."""

from __future__ import annotations

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.convex_object import ConvexObject, segment_gaps
from isotruss_ros.core.numerics.arrays import Array, Points
import numpy as np

#: The object is out of the way when no member overlaps it by more than this [m].
TOLERANCE = 1e-9
#: Two members that close push it out of their wedge bit by bit.
MAX_PUSHES = 200


def member_lines(config: Configuration) -> Points:
    """
    Return the undeformed centre lines (m, 2) of the members, pinch to pinch [m].

    :param config: configuration of the robot.
    """
    topology, points = config.robot.topology, config.points
    return np.stack([points[topology.b], points[topology.c[topology.following]]], axis=1)


def member_depths(config: Configuration, body: ConvexObject) -> Array:
    """
    Return how deep an object is in each undeformed member, negative where apart (m,) [m].

    :param config: configuration of the robot.
    :param body: the object in its place.
    """
    radius = 0.5 * config.robot.description.tube_diameter
    starts, ends = member_lines(config).T
    if body.shape.is_round:
        # The same as below, in a fifth of the time: what is nearest is nearest to the centre.
        spans = ends - starts
        shares = np.clip(((body.center - starts) / spans).real, 0.0, 1.0)
        return radius + body.shape.reach - np.abs(starts + shares * spans - body.center)
    return radius - segment_gaps(body, starts, ends).gaps


def push_out(config: Configuration, body: ConvexObject) -> ConvexObject:
    """
    Return an object where members push one that overlaps them, without turning it.

    Quasi-static, without friction: along the normal of the deepest member, until none overlaps.
    Members that enclose it can leave no such place: then it stays where the last push led.

    :param config: configuration of the robot.
    :param body: the object in its place.
    """
    begin, end = member_lines(config).T
    reach = 0.5 * config.robot.description.tube_diameter
    for _ in range(MAX_PUSHES):
        near = segment_gaps(body, begin, end)
        deepest = int(np.argmin(near.gaps))
        depth = reach - float(near.gaps[deepest])
        if depth <= TOLERANCE:
            break
        away = -depth * complex(near.normals[deepest])
        x, y, angle = body.pose
        body = body.moved_to((x + away.real, y + away.imag, angle))
    return body
