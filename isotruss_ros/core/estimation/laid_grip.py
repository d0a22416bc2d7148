# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Grip whose rows tell how a held object moves with the rollers."""

from __future__ import annotations

import math

from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.manipulation.grip import find_members, Grip
import numpy as np


def laid_grip(held: HeldGrip, friction: float) -> Grip:
    """
    Return the grip whose rows, see `grip_jacobian`, tell how a held object moves with the rollers.

    Members bend under a face that they press, so that the object is turned against the straight
    ones. On these its face is to lie as well: an object on a corner moves otherwise.

    :param held: how it is held.
    :param friction: coefficient between tubes and object.
    """
    body, contacts = held.body, held.contacts
    for ends in contacts.ends:
        if len(ends) == 1:
            continue
        robot, points = held.config.robot, held.config.points
        nodes = find_members(robot, (robot.member_names[contacts.members[ends[0]]],))
        axis = complex(np.diff(points[nodes.lines[0]])[0])
        normals = np.full(2, 1j * axis / (abs(axis) * body.turn))
        first, last = body.shape.surface_at(contacts.corners[ends], normals)[0] * body.turn
        # The shorter way to where both are parallel, either way around.
        turn = 0.5 * np.angle((axis / (last - first)) ** 2)
        x, y, angle = held.pose
        body = body.moved_to((x, y, math.remainder(angle + turn, 2.0 * math.pi)))
        break
    return Grip(held.member_names, body, friction)
