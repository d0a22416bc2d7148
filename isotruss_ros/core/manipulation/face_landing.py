# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Landing of a polygon's face on a member.

An object that touches a member at a corner may roll there; a face rotates with its member. If a
face landed at any speed, the roller speeds would jump. They would jump again each time that a
bending tube leaves the end of the face and this end lands again. So gaps decay exponentially.
"""

from __future__ import annotations

from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import find_contacts, Grip
from isotruss_ros.core.manipulation.grip_rows import contact_rows
from isotruss_ros.core.manipulation.limits import APPROACH_RATE
from isotruss_ros.core.manipulation.task import RANK_TOLERANCE, Reach
from isotruss_ros.core.numerics.arrays import Array
import numpy as np


def land_faces(config: Configuration, grip: Grip, reach: Reach, velocities: Array) -> Reach:
    """
    Return the reach with a row for each gap that roller velocities (r,) close too fast.

    It is the same reach if there is no such gap, or if the rows would depend on the others: then
    the landed face does not admit all twists, and the object rolls over it, see `roll_off_faces`.
    """
    rate = min(APPROACH_RATE, config.robot.description.braking_rate)
    rows = _gap_rows(config, grip, reach.motion)
    closing = -rate * np.array([gap.width for gap in grip.gaps])
    is_fast = rows @ velocities < closing
    if not is_fast.any():
        return reach
    all_rows = np.concatenate([reach.rows, rows[is_fast][:, reach.working.indices]])
    values = np.linalg.svd(all_rows, compute_uv=False)
    if len(all_rows) > all_rows.shape[1] or values[-1] <= RANK_TOLERANCE * values[0]:
        return reach
    return reach._replace(rows=all_rows, closing=closing[is_fast])


def _gap_rows(config: Configuration, grip: Grip, motion: Array) -> Array:
    """Return the derivatives (k, r) of a grip's gaps by roller travel, for a motion (3, r)."""
    # Contacts as if all gaps were closed.
    owners, corners = np.array(
        [(i, corner) for i, touched in enumerate(grip.corners or ()) for corner in touched]
        + [(gap.owner, gap.corner) for gap in grip.gaps]
    ).T
    closed = grip.touching(np.sort(owners), corners[owners.argsort(kind='stable')])
    contacts = find_contacts(config, closed)
    by_speeds, by_twist = contact_rows(config, closed)
    velocities = (by_speeds - by_twist @ motion).reshape(len(contacts), 2, -1)
    # Components along the normals, which point to the members.
    normals = np.array([contact.normal for contact in contacts]).view(float).reshape(-1, 2, 1)
    places = [(contact.owner, contact.corner) for contact in contacts]
    free = [places.index((gap.owner, gap.corner)) for gap in grip.gaps]
    return (velocities * normals).sum(axis=1)[free]
