# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Three members press harder on an object that they surround, which stays where it is.

The rollers move the tubes' material at each contact toward the object, and not along it: contacts
that stick do not drag the object along then. How hard each member is to press follows from the
balance of three forces without friction.
"""

from __future__ import annotations

import math

from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.grip_rows import contact_rows
from isotruss_ros.core.numerics.arrays import Array, as_xy, Points
from isotruss_ros.core.planning.grasp_plan import Violation
from isotruss_ros.core.planning.motion_in_place import (
    MAX_CORRECTIONS,
    MotionInPlace,
    PLACE_TOLERANCE,
    SQUEEZE_TOLERANCE,
)
import numpy as np

#: The members press as hard as wanted to this share.
SHARE_TOLERANCE = 0.02


def squeeze_around(motion: MotionInPlace, grasp: HeldGrip, force: float) -> HeldGrip | None:
    """
    Return the grip with another squeeze, the object where it lay.

    :param motion: the motion in place, with its bounds.
    :param grasp: how three members hold the object.
    :param force: mean normal force of the members, positive [N].
    :return: None where there is none; then see `MotionInPlace.closest_violation`.
    :raises StructureError: see `structure_of`.
    """
    lay = motion.closing.body.pose
    for _ in range(MAX_CORRECTIONS):
        response = grasp.response
        if response is None:
            break
        wanted = 3.0 * force * _shares(_normals(grasp))
        missing = wanted - grasp.normal_forces
        away = np.subtract(lay, grasp.pose)
        away[2] = math.remainder(away[2], 2.0 * math.pi)
        right = abs(grasp.squeeze - force) < SQUEEZE_TOLERANCE * force
        even = np.abs(missing).max() < SHARE_TOLERANCE * force
        if right and even and np.hypot(*away[:2]) < PLACE_TOLERANCE:
            return grasp
        outward = np.linalg.lstsq(response.openings, missing, rcond=1e-6)[0]
        travel = _travel(grasp, away, outward)
        if not _within_limits(motion, grasp.config, travel):
            motion.record(Violation('squeeze', grasp.squeeze, force, 5.0))
            return None
        moved = motion.move(grasp, travel)
        if moved is None:
            return None
        grasp = moved
    motion.record(Violation('squeeze', grasp.squeeze, force, 5.0))
    return None


def _normals(grasp: HeldGrip) -> Points:
    """Return the normals of the members, (3,) out of the object."""
    owners = grasp.contacts.owners
    return grasp.state.normals[np.searchsorted(owners, np.arange(owners[-1] + 1))]


def _shares(normals: Points) -> Array:
    """Return with which shares of the total three members press so that their forces balance."""
    ahead, behind = np.roll(normals, -1), np.roll(normals, -2)
    found = (ahead.conj() * behind).imag
    return found / found.sum()


def _travel(grasp: HeldGrip, twist: Array, outward: Array) -> Array:
    """
    Return the motion of the rollers, (r,) [m].

    :param twist: (3,) of the object, by which the contacts move with it [m, rad].
    :param outward: (3,) by which each member moves away from the object besides [m].
    """
    rows = contact_rows(grasp.config, Grip(grasp.member_names, grasp.body))
    owners, normals = rows.contacts.owners, rows.contacts.normals
    moved = (outward[owners, None] * as_xy(normals)).ravel()
    return np.linalg.lstsq(rows.hand, rows.rigid @ twist + moved, rcond=1e-3)[0]


def _within_limits(motion: MotionInPlace, config: Configuration, travel: Array) -> bool:
    """Tell whether a motion of the rollers keeps the limits."""
    for limit in motion.closing.limits:
        matrix, lower, upper = limit.rows(config)
        rates = matrix @ travel
        if (rates < lower).any() or (rates > upper).any():
            return False
    return True
