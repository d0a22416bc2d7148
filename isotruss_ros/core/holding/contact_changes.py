# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""How contacts change as an object rolls: ends of faces lift and lie down, a member joins."""

from __future__ import annotations

from dataclasses import replace

from isotruss_ros.core.contact.depths import member_depths
from isotruss_ros.core.holding.grip_equilibrium import GripEquilibrium, GripT
from isotruss_ros.core.holding.pressed_contacts import (
    contact_statics,
    find_pressed,
    LEAST_FACE,
    PressedContacts,
)
from isotruss_ros.core.model.polygon import Polygon
from isotruss_ros.core.model.segment_gaps import segment_gaps
from isotruss_ros.core.statics.member_compliance import MemberCompliance
from isotruss_ros.core.statics.structure import structure_of
import numpy as np

#: Most members that hold an object.
MOST = 3
#: Members farther off than this share of a tube's diameter do not touch, however tubes bend.
NEAR = 0.25
#: Corners may change so often in one motion.
MAX_CHANGES = 4


def lift_ends(grip: GripT) -> GripT | None:
    """
    Return the grip without the ends of faces, or the third member, that pull.

    :param grip: in equilibrium.
    :return: None where there is no equilibrium without them.
    """
    found: GripT | None = grip
    for _ in range(MAX_CHANGES):
        if found is None:
            return None
        lifted = found.pulling
        if lifted is None:
            break
        kept = np.delete(np.arange(len(found.anchors)), lifted)
        contacts = found.contacts.without(lifted)
        found = found.rolled(
            found.config, contacts, found.anchors[kept], found.angles[kept], found.wrench
        )
    return found


def lay_down(grip: GripT, changes: int = MAX_CHANGES) -> GripT:
    """
    Return the grip with the other end of a face where a corner has rolled beyond it.

    Of a short face the other end takes the place of this one.

    :param grip: in equilibrium.
    :param changes: that many short faces may follow each other.
    """
    shape = grip.body.shape
    if not isinstance(shape, Polygon):
        return grip
    owners, corners = grip.contacts.owners, grip.contacts.corners
    alone = np.flatnonzero(np.bincount(owners)[owners] == 1)
    own = grip.state.normals * np.exp(-1j * grip.state.unknowns[2])
    for k in alone.tolist():
        corner = int(corners[k])
        beyond = (own[k] * shape.normals[corner].conjugate()).imag > 0.0
        before = (own[k] * shape.normals[corner - 1].conjugate()).imag < 0.0
        if not (beyond or before):
            continue
        step = 1 if beyond else -1
        other = (corner + step) % len(shape.vertices)
        face = abs(shape.arc_centers[other] - shape.arc_centers[corner])
        short = face < LEAST_FACE * grip.statics.tube_radius
        laid = _with_corner(grip, k, other) if short else _with_face(grip, k, step)
        if laid is not None and laid.presses:
            return lay_down(laid, changes - 1) if short and changes > 0 else laid
    return grip


def join(grip: GripT) -> GripT:
    """
    Return the grip with a third member where that has come to touch the object.

    :param grip: in equilibrium.
    """
    if len(grip.members) >= MOST:
        return grip
    depths = member_depths(grip.config, grip.body)
    depths[grip.members] = -np.inf
    number = int(depths.argmax())
    near = NEAR * grip.config.robot.description.tube_diameter
    if depths[number] <= -near or _depth_in(grip, number, float(depths[number])) <= 0.0:
        return grip
    others = find_pressed(grip.config, grip.body, np.array([number]))
    contacts, order = grip.contacts.with_others(others)
    fresh = np.flatnonzero(order >= len(grip.anchors))
    count = len(others.members)
    statics = contact_statics(grip.config, grip.body, others, flattening=False)
    facing = statics.straight_normals * grip.body.turn.conjugate()
    anchors = np.append(grip.anchors, np.zeros(count))[order]
    angles = np.append(grip.angles, np.angle(facing))[order]
    found = grip.rolled(grip.config, contacts, anchors, angles, grip.wrench, fresh)
    if found is None or found.state.normal_forces[fresh].min() <= 0.0:
        return grip
    return found


def _with_corner(grip: GripT, k: int, corner: int) -> GripT | None:
    """Return the equilibrium with another corner at a contact, to which the object rolled."""
    corners = grip.contacts.corners.copy()
    corners[k] = corner
    contacts = replace(grip.contacts, corners=corners)
    return grip.rolled(grip.config, contacts, grip.anchors, grip.angles, grip.wrench)


def _with_face(grip: GripT, k: int, step: int) -> GripT | None:
    """Return the equilibrium with the next corner (step 1) or the one before (-1) as well."""
    shape = grip.body.shape
    assert isinstance(shape, Polygon)
    corner = int(grip.contacts.corners[k])
    other = (corner + step) % len(shape.vertices)
    half = 0.5 * abs(shape.arc_centers[other] - shape.arc_centers[corner])
    place = k + (step > 0)
    cuts = grip.contacts.cuts.copy()
    cuts[k] = (np.inf, half) if step > 0 else (half, np.inf)
    cuts = np.insert(cuts, place, (half, np.inf) if step > 0 else (np.inf, half), axis=0)
    contacts = PressedContacts(
        np.insert(grip.contacts.members, place, grip.contacts.members[k]),
        np.insert(grip.contacts.owners, place, grip.contacts.owners[k]),
        np.insert(grip.contacts.corners, place, other),
        cuts,
    )
    anchors = np.insert(grip.anchors, place, 0.0)
    angles = np.insert(grip.angles, place, grip.angles[k])
    return grip.rolled(grip.config, contacts, anchors, angles, grip.wrench, np.array([place]))


def _depth_in(grip: GripEquilibrium, number: int, depth: float) -> float:
    """
    Return how deep the object is in a member that does not hold it [m].

    The tubes that hold it bend, and with them the structure.

    :param depth: in the undeformed member [m].
    """
    topology, points = grip.config.robot.topology, grip.config.points
    start, end = points[topology.b[number]], points[topology.c[topology.following[number]]]
    share = segment_gaps(grip.body, np.array([start]), np.array([end])).shares[0]
    compliance = MemberCompliance(
        structure_of(grip.config, grip.pressure),
        [*grip.contacts.members.tolist(), number],
        grip.stiffness_scale,
    )
    loads = np.vstack([grip.statics.loads(grip.state.unknowns), np.zeros(3)])
    feet = np.append(grip.state.feet, share * abs(end - start))
    give = compliance.at(feet).respond(loads)[-1, 1]
    aside = ((grip.body.middle - start) / (end - start)).imag
    # A member with the object on its left is deeper in it where it moves left.
    return depth + float(give if aside > 0.0 else -give)
