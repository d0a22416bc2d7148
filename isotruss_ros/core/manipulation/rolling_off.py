# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Over which corners a polygon rolls for a twist that its faces on members do not admit.

As long as faces of the object lie on members they stay there. A twist that they do not admit may
be one for which the object rolls over an end of a face, while the other end lifts: where statics
has a balance with the force at that end alone. Two members balance with forces along one line, in
the friction cones of both.
"""

from __future__ import annotations

from collections.abc import Iterator
import itertools
import math

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip, touch_members
from isotruss_ros.core.manipulation.grip_contacts import contact_rows, GripContacts
from isotruss_ros.core.manipulation.grip_rows import rows_of_two
from isotruss_ros.core.manipulation.task import (
    Motion,
    Reach,
    REACH_TOLERANCE,
    Task,
    WorkingRollers,
)
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: A face's other end may come closer to the member by this share of the surface's speed.
LIFT_TOLERANCE = 1e-9
#: Rolling over a corner comes closer to the twist by at least this share of what is missed.
LEAST_GAIN = 1e-6


def roll_off_faces(
    config: Configuration, grip: Grip, working: WorkingRollers, twist: Array, motion: Motion
) -> Motion:
    """
    Return the motion with the fewer contacts with which a twist is missed by least.

    :param config: configuration of the robot.
    :param grip: the grip.
    :param working: the rollers that work.
    :param twist: (3,) of the object, not zero [m/s, rad/s].
    :param motion: with all contacts, which is returned where nothing comes closer.
    :raises ConfigurationError: the configuration is singular.
    """
    least, places = _missed(motion.reach, twist), working.places
    if least <= REACH_TOLERANCE:
        return motion
    contacts, hand, rigid = contact_rows(config, grip)
    touches = touch_members(config, grip)
    inward = np.repeat(-contacts.normals, 2).view(np.float64).reshape(-1, 2, 2)[:, 0]
    for kept in rolled_corners(contacts, grip.friction):
        tried = rows_of_two(config, grip, [touches[k] for k in kept])
        found = Reach.of(tried[:, places], grip.body.arm)
        missed = _missed(found, twist)
        task = Task(found, twist, working)
        if missed >= least * (1.0 - LEAST_GAIN) or task.speed == 0.0:
            continue
        moved = rigid @ (tried[:3, places] @ task.free) - hand[:, places] @ task.free
        lifting = (moved.reshape(-1, 2) * inward).sum(axis=1)
        if lifting.min() >= -LIFT_TOLERANCE * np.abs(task.free).max():
            motion, least = Motion(tried[:3], found), missed
    return motion


def _missed(reach: Reach, twist: Array) -> float:
    """Return the share of a twist that is not reachable."""
    unit = reach.weights * (twist / np.abs(twist).max())
    left = unit - reach.directions.T @ (reach.directions @ unit)
    return math.sqrt(left @ left) / math.sqrt(unit @ unit)


def rolled_corners(contacts: GripContacts, friction: float) -> Iterator[tuple[int, ...]]:
    """
    Return the contacts that remain where an object rolls over ends of faces.

    :param contacts: of two members; with three, faces stay on them.
    :param friction: coefficient between tubes and object.
    :return: numbers of the contacts, for each choice that statics has a balance for.
    """
    if contacts.owners[-1] != 1:
        return
    first = np.flatnonzero(contacts.owners == 0).tolist()
    second = np.flatnonzero(contacts.owners == 1).tolist()
    for one, other in itertools.product(_choices(first), _choices(second)):
        fewer = len(one) + len(other) < len(contacts.owners)
        if fewer and _balances(contacts, one, other, math.atan(friction)):
            yield (*one, *other)


def _choices(own: list[int]) -> list[list[int]]:
    """Return the contacts of a member that may remain: all, or either end of a face."""
    return [own] if len(own) == 1 else [own, own[:1], own[1:]]


def _balances(contacts: GripContacts, one: list[int], other: list[int], angle: float) -> bool:
    """
    Tell whether forces along one line, within the friction cones, meet both contacts.

    One of them is a single point, the other that or a face.
    """
    if len(one) < len(other):
        one, other = other, one
    points, normals = contacts.points, contacts.normals
    point, normal = complex(points[other[0]]), complex(normals[one[0]])
    # Directions of the force at `other`: in its own cone, and against one in the cone of `one`.
    between = float(np.angle(-normals[other[0]] / normal))
    low, high = max(-angle, between - angle), min(angle, between + angle)
    if low > high:
        return False
    ends = points[one]
    away = ((complex(ends[0]) - point) * normal.conjugate()).real
    along = (((ends - point) / (1j * normal)).real).tolist()
    reached = (away * math.tan(low), away * math.tan(high))
    return min(reached) <= max(along) and max(reached) >= min(along)
