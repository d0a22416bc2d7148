# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Rolling of a polygon over its corners, for twists that face contacts do not admit.

Contacts at both ends of a face do not admit all twists. For the other twists the object may roll
over one end of the face while its other end lifts. Then the forces must balance without a force at
the lifted end. The forces of two members balance if they act along one line that is inside both
friction cones.
"""

from __future__ import annotations

from collections.abc import Sequence
import itertools
import math

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import find_contacts, Grip, GripContact
from isotruss_ros.core.manipulation.grip_rows import contact_rows, member_rows, rows_of_two
from isotruss_ros.core.manipulation.task import find_task, Reach
from isotruss_ros.core.numerics.arrays import Array, as_xy, Points
from isotruss_ros.core.numerics.tolerances import NEGLIGIBLE_SHARE, ROUNDING
import numpy as np


def roll_off_faces(config: Configuration, grip: Grip, reach: Reach, twist: Array) -> Reach:
    """Return the reachable twists closest to a twist if ends of faces may lift."""
    contacts = find_contacts(config, grip)
    choices = rolled_corners(contacts, grip.friction)
    if not choices:
        return reach
    working, smallest_miss = reach.working, find_task(reach, twist).missed
    if smallest_miss <= ROUNDING:
        return reach
    (hand, rigid), members = contact_rows(config, grip), member_rows(config, grip.members)
    inward = as_xy(-np.array([contact.normal for contact in contacts]))
    for kept in choices:
        rolling = Reach.of(rows_of_two(grip, kept, members), working, reach.weights)
        task = find_task(rolling, twist)
        if task.missed >= smallest_miss * (1.0 - NEGLIGIBLE_SHARE) or task.speed == 0.0:
            continue
        speeds = working.spread(task.free)
        object_moves = rigid @ (rolling.motion @ speeds)
        apart = (object_moves - hand @ speeds).reshape(-1, 2)
        lifting = (apart * inward).sum(axis=1)
        if lifting.min() >= -ROUNDING * np.abs(speeds).max():
            reach, smallest_miss = rolling, task.missed
    return reach


def rolled_corners(contacts: Sequence[GripContact], friction: float) -> list[list[GripContact]]:
    """Return the sets of fewer contacts of two members at which forces balance."""
    if contacts[-1].owner != 1 or len(contacts) == 2:
        return []
    sides = [[c for c in contacts if c.owner == owner] for owner in (0, 1)]
    # All contacts of a member may remain, or one end of its face.
    remaining = ([s] if len(s) == 1 else [s, s[:1], s[1:]] for s in sides)
    choices = list(itertools.product(*remaining))[1:]  # not all contacts of both members
    ends = np.array([[(side[0].point, side[-1].point) for side in kept] for kept in choices])
    angles = balance_angles(*(side[0].normal for side in sides), *ends.transpose(1, 2, 0))
    fits = angles <= math.atan(friction)
    return [one + other for (one, other), fit in zip(choices, fits.tolist(), strict=True) if fit]


def balance_angles(
    normals: complex | Points, others: complex | Points, ends: Points, other_ends: Points
) -> Array:
    """
    Return the smallest friction angles (s,) at which the forces of two members balance [rad].

    The normals point to the members; each has the two ends (2, s) of its contact.
    """
    # Angles from the first member's inward normal to the line from its contact to the second one.
    lines = np.angle((other_ends - ends[:, None]) / -normals).reshape(4, -1)
    between = np.angle(-others / normals)
    # The optimum is the bisector of both normals.
    best = np.minimum(np.maximum(0.5 * between, lines.min(axis=0)), lines.max(axis=0))
    return np.maximum(np.abs(best), np.abs(best - between))
