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

import cmath
from collections.abc import Iterator, Sequence
import itertools
import math

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import find_contacts, Grip, GripContact
from isotruss_ros.core.manipulation.grip_rows import contact_rows, member_rows, rows_of_two
from isotruss_ros.core.manipulation.task import find_task, Reach
from isotruss_ros.core.numerics.arrays import Array, as_xy
from isotruss_ros.core.numerics.tolerances import NEGLIGIBLE_SHARE, ROUNDING
import numpy as np


def roll_off_faces(config: Configuration, grip: Grip, reach: Reach, twist: Array) -> Reach:
    """Return the reachable twists closest to a twist if ends of faces may lift."""
    contacts = find_contacts(config, grip)
    choices = list(rolled_corners(contacts, grip.friction))
    least, working = find_task(reach, twist).missed if choices else 0.0, reach.working
    if least <= ROUNDING:
        return reach
    (hand, rigid), members = contact_rows(config, grip), member_rows(config, grip.members)
    inward = as_xy(-np.array([contact.normal for contact in contacts]))
    for kept in choices:
        fewer = Reach.of(rows_of_two(grip, kept, members), working, reach.weights)
        task = find_task(fewer, twist)
        if task.missed >= least * (1.0 - NEGLIGIBLE_SHARE) or task.speed == 0.0:
            continue
        speeds = working.spread(task.free)
        moved = rigid @ (fewer.motion @ speeds) - hand @ speeds
        lifting = (moved.reshape(-1, 2) * inward).sum(axis=1)
        if lifting.min() >= -ROUNDING * np.abs(speeds).max():
            reach, least = fewer, task.missed
    return reach


def rolled_corners(
    contacts: Sequence[GripContact], friction: float
) -> Iterator[list[GripContact]]:
    """Yield sets of fewer contacts of two members at which forces balance."""
    if contacts[-1].owner != 1 or len(contacts) == 2:
        return
    first, second = ([c for c in contacts if c.owner == owner] for owner in (0, 1))
    for one, other in itertools.product(_choices(first), _choices(second)):
        fewer = len(one) + len(other) < len(contacts)
        small, large = sorted((other, one), key=len)
        if fewer and _balances(small, large, math.atan(friction)):
            yield one + other


def _choices(contacts: list[GripContact]) -> list[list[GripContact]]:
    """Return the sets of contacts that may remain at a member: all, or one end of a face."""
    return [contacts] if len(contacts) == 1 else [contacts, contacts[:1], contacts[1:]]


def _balances(other: list[GripContact], one: list[GripContact], angle: float) -> bool:
    """Return whether a line from contact `other` to one of `one` is in both friction cones."""
    point, normal = other[0].point, one[0].normal
    # Directions of the force at `other`: in its own cone, and against one in the cone of `one`.
    between = cmath.phase(-other[0].normal / normal)
    low, high = max(-angle, between - angle), min(angle, between + angle)
    if low > high:
        return False
    away = ((one[0].point - point) * normal.conjugate()).real
    along = [((end.point - point) / (1j * normal)).real for end in one]
    reached = (away * math.tan(low), away * math.tan(high))
    return min(reached) <= max(along) and max(reached) >= min(along)
