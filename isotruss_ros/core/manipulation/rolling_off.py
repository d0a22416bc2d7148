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
    """Return the reachable twists, where ends of faces lift if a desired twist requires it."""
    contacts = find_contacts(config, grip)
    choices = rolled_corners(contacts, grip.friction)
    if not choices:
        return reach
    working, smallest_miss = reach.working, find_task(reach, twist).missed
    if smallest_miss <= ROUNDING:
        return reach
    (by_speeds, by_twist), members = contact_rows(config, grip), member_rows(config, grip.members)
    inward = as_xy(-np.array([contact.normal for contact in contacts]))
    for pressed in choices:
        rolling = Reach.of(rows_of_two(grip, pressed, members), working, reach.weights)
        task = find_task(rolling, twist)
        if task.missed >= smallest_miss * (1.0 - NEGLIGIBLE_SHARE) or task.speed == 0.0:
            continue
        speeds = working.spread(task.free)
        # Velocities of the object relative to the members at all contacts: none may penetrate.
        object_velocities = by_twist @ (rolling.motion @ speeds)
        relative = (object_velocities - by_speeds @ speeds).reshape(-1, 2)
        lifting = (relative * inward).sum(axis=1)
        if lifting.min() >= -ROUNDING * np.abs(speeds).max():
            reach, smallest_miss = rolling, task.missed
    return reach


def rolled_corners(contacts: Sequence[GripContact], friction: float) -> list[list[GripContact]]:
    """Return sets of contacts, without lifted face ends, at which two members' forces balance."""
    if contacts[-1].owner != 1 or len(contacts) == 2:
        return []
    patches = [[contact for contact in contacts if contact.owner == owner] for owner in (0, 1)]
    # All contacts of a member may remain, or one end of its face.
    options = ([patch, patch[:1], patch[1:]] if patch[1:] else [patch] for patch in patches)
    choices = list(itertools.product(*options))[1:]  # not all contacts of both members
    # Ends (choices, 2 members, 2 ends) of the remaining contacts.
    ends = np.array([[(patch[0].point, patch[-1].point) for patch in pair] for pair in choices])
    normal, other_normal = (patch[0].normal for patch in patches)
    angles = balance_angles(normal, other_normal, ends[:, 0].T, ends[:, 1].T)
    is_balanced = (angles <= math.atan(friction)).tolist()
    return [one + other for (one, other), fits in zip(choices, is_balanced, strict=True) if fits]


def balance_angles(
    normals: complex | Points, others: complex | Points, ends: Points, other_ends: Points
) -> Array:
    """
    Return the smallest friction angles (s,) at which the forces of two members balance [rad].

    The normals point to the members; each has the two ends (2, s) of its contact.
    """
    # Balanced forces act along a line from the first to the second contact. Angles are relative
    # to the first member's inward normal: of the lines between ends, and of the second's normal.
    lines = np.angle((other_ends - ends[:, None]) / -normals).reshape(4, -1)
    wedges = np.angle(-others / normals)
    # The optimum is the bisector of both normals.
    best = np.minimum(np.maximum(0.5 * wedges, lines.min(axis=0)), lines.max(axis=0))
    return np.maximum(np.abs(best), np.abs(best - wedges))
