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
import math

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import find_contacts, Grip, GripContact, lifting_choices
from isotruss_ros.core.manipulation.grip_rows import contact_rows, member_rows, rows_of_two
from isotruss_ros.core.manipulation.task import find_task, Reach
from isotruss_ros.core.numerics.arrays import Array, as_xy, Points
from isotruss_ros.core.numerics.tolerances import NEGLIGIBLE_SHARE, ROUNDING
import numpy as np


def roll_off_faces(config: Configuration, grip: Grip, reach: Reach, twist: Array) -> Reach:
    """Return the reachable twists; ends of faces lift if that brings them closer to a twist."""
    contacts = find_contacts(config, grip)
    choices = rolled_corners(contacts, grip.friction)
    if not choices:
        return reach
    working, smallest_miss = reach.working, find_task(reach, twist).missed
    if smallest_miss <= ROUNDING:
        return reach
    by_speeds, by_twist = contact_rows(config, grip)
    members = member_rows(config, grip.members)
    inward = as_xy(-np.array([contact.normal for contact in contacts]))
    for pressed in choices:
        rolling = Reach.of(rows_of_two(grip, pressed, members), working, reach.weights)
        task = find_task(rolling, twist)
        if task.missed >= smallest_miss * (1.0 - NEGLIGIBLE_SHARE) or task.speed == 0.0:
            continue
        # No contact may penetrate: velocities of the object's surface away from the members.
        speeds = working.spread(task.free)
        surface_velocities = by_twist @ (rolling.motion @ speeds)
        relative = (surface_velocities - by_speeds @ speeds).reshape(-1, 2)
        lifting = (relative * inward).sum(axis=1)
        if lifting.min() >= -ROUNDING * np.abs(speeds).max():
            reach, smallest_miss = rolling, task.missed
    return reach


def rolled_corners(contacts: Sequence[GripContact], friction: float) -> list[list[GripContact]]:
    """Return sets of contacts, without lifted face ends, at which two members' forces balance."""
    members = contacts[-1].owner + 1
    has_face = len(contacts) > members
    if members != 2 or not has_face:
        return []
    choices = lifting_choices([contact.owner for contact in contacts])
    remaining = [[contacts[k] for k in (*one, *other)] for one, other in choices]
    # Ends of the remaining contacts; axes: choice, member, end.
    points = [contact.point for contact in contacts]
    ends = np.array([[(points[k[0]], points[k[-1]]) for k in choice] for choice in choices])
    normals = contacts[0].normal, contacts[-1].normal
    angles = balance_angles(*normals, ends[:, 0].T, ends[:, 1].T)
    return [remaining[i] for i in np.flatnonzero(angles <= math.atan(friction))]


def balance_angles(
    normals: complex | Points, others: complex | Points, ends: Points, other_ends: Points
) -> Array:
    """
    Return the smallest friction angles (s,) at which the forces of two members balance [rad].

    The normals point to the members; each has the two ends (2, s) of its contact.
    """
    # The two forces act along one line, from a point of the first contact to one of the second.
    # Angles of such lines between the ends, relative to the force along the first normal.
    lines = np.angle((other_ends - ends[:, None]) / -normals).reshape(4, -1)
    # Angle of the force along the second normal.
    wedges = np.angle(-others / normals)
    # The friction angles of a line at angle a are |a| and |a - wedge|. Their maximum is smallest
    # for the bisector, or for the line nearest to it.
    best = np.minimum(np.maximum(0.5 * wedges, lines.min(axis=0)), lines.max(axis=0))
    return np.maximum(np.abs(best), np.abs(best - wedges))
