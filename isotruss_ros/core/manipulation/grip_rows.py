# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Grip Jacobian: the grasp constraint J_h(q) qdot = G^T nu, solved for the twist nu.

J_h qdot is the velocity of the tubes' material at the contacts, and G^T nu is the velocity of the
object's surface at the contacts; both are equal, because contacts roll. The tube is inextensible,
so the material of a straight member moves as a rigid body. Along the member it has the speed of
the roller at the member's start; by (12), the roller at the member's end gives the same speed. For
a cylinder between the two members of one module, the rows are (14) to (18).
"""

from __future__ import annotations

from collections.abc import Sequence
import functools

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import find_contacts, find_members, Grip, GripContact
from isotruss_ros.core.model.pose import MIN_DIAMETER
from isotruss_ros.core.numerics.arrays import Array
import numpy as np


@functools.lru_cache(maxsize=8)
def grip_jacobian(config: Configuration, grip: Grip) -> Array:
    """
    Return the Jacobian of the object's motion with respect to roller speeds, (19) with (12).

    Its first three rows yield the twist. Its other g rows yield the residual of J_h(q) qdot = G^T
    nu, which is zero if no contact opens or slips. The Jacobian is cached.

    :return: (3 + g, r) values for roller speeds of 1 m/s, read-only. The rows are vx, vy [m/s] and
        omega [rad/s] of the object in the robot frame; then the opening rate [m/s], which is the
        rate of the distance between the contacts of two members, or twice the speed of each of
        three members away from the object; then g - 1 other residuals [m/s]. The number g is 1 for
        two point contacts, 2 with one face, 3 with two faces, and 2 k - 3 for k contacts on three
        members.
    """
    contacts = find_contacts(config, grip)
    if len(grip.members) == 2:
        jacobian = rows_of_two(grip, contacts, member_rows(config, grip.members))
    else:
        points = np.array([contact.point for contact in contacts])
        _require_apart(np.abs(points - points[0]).max())
        normals = np.array([contact.normal for contact in contacts]).view(float)
        hand, rigid = contact_rows(config, grip)
        # The complement of G^T's range has an orthogonal basis of 2 k - 3 misfits. The first is a
        # motion of each member away from the object at 0.5 m/s, minus its projection on the range.
        basis, factor = np.linalg.qr(np.column_stack([rigid, 0.5 * normals]), mode='complete')
        basis[:, 3] *= factor[3, 3]
        square = np.concatenate([rigid, basis[:, 3:]], axis=1)
        jacobian = np.linalg.solve(square, hand)
    jacobian.flags.writeable = False
    return jacobian


def _require_apart(distance: float) -> None:
    if distance < MIN_DIAMETER:
        raise GraspError(
            'all members touch the object at one point; the contacts must be apart to hold it'
        )


def member_rows(config: Configuration, names: tuple[str, ...]) -> Array:
    """
    Return the Jacobian (3 m, r) of the velocities of m members with respect to roller speeds.

    Each member has three rows: vx, vy of the tube's material at the member's start in the robot
    frame [-], and the angular velocity of the member (16) [1/m].
    """
    nodes, points, count = find_members(config.robot, names), config.points, len(names)
    spans = [end - start for start, end in points.take(nodes.lines).tolist()]
    by_node = np.zeros(3 * count * len(points), dtype=np.complex128)
    # Angular velocity: Re(conj(turn) (velocity of the end - velocity of the start)).
    turns = [1j / span.conjugate() for span in spans]
    by_node[nodes.entries] = [entry for turn in turns for entry in (1.0, 1j, -turn, turn)]
    rows = config.roller_rows(by_node.view(np.float64).reshape(3 * count, -1))
    for member, roller in zip(nodes.driven.tolist(), nodes.rollers.tolist(), strict=True):
        # The roller moves the material along the member, so that the object rolls (17).
        axis = spans[member] / abs(spans[member])
        rows[3 * member, roller] += axis.real
        rows[3 * member + 1, roller] += axis.imag
    return rows


def contact_rows(config: Configuration, grip: Grip) -> tuple[Array, Array]:
    """
    Return both matrices of the grasp constraint J_h(q) qdot = G^T nu, in the robot frame.

    J_h (2 k, r) has the derivatives of each contact's velocity vx, vy by roller speeds [-], and
    G^T (2 k, 3) those by the twist vx, vy [-], omega [m].
    """
    contacts = find_contacts(config, grip)
    rates = np.zeros((2 * len(contacts), len(grip.members), 3))
    rigid: list[tuple[float, float, float]] = []
    for k, contact in enumerate(contacts):
        lever, arm = contact.point - contact.start, contact.point - grip.body.center
        rates[2 * k, contact.owner] = 1.0, 0.0, -lever.imag
        rates[2 * k + 1, contact.owner] = 0.0, 1.0, lever.real
        rigid += [(1.0, 0.0, -arm.imag), (0.0, 1.0, arm.real)]
    hand = rates.reshape(len(rates), -1) @ member_rows(config, grip.members)
    return hand, np.array(rigid)


def rows_of_two(grip: Grip, contacts: Sequence[GripContact], members: Array) -> Array:
    """
    Return the rows of `grip_jacobian` for two members with given contacts.

    They solve the constraint of `contact_rows` in closed form. The object rotates with the member
    that touches a face. Without face contacts it rotates with the line through both contact
    points. The midpoint of both points moves with their mean velocity.
    """
    first, *one = (contact for contact in contacts if contact.owner == 0)
    second, *other = (contact for contact in contacts if contact.owner == 1)
    point, other_point = _middle(first, one), _middle(second, other)
    apart = other_point - point
    distance = abs(apart)
    _require_apart(distance)
    along = apart / distance
    # (19): velocity (15) and angular velocity (18) of the object, then the rate of the distance of
    # the contacts, zero for a disc at a module if the angle (14) is constant. Each row has h1, h2,
    # k1, k2 of Re(conj(h1) v1 + conj(h2) v2) + k1 w1 + k2 w2, with material velocities v at the
    # points and angular velocities w of the members.
    across, around, k, other_k = 1j * along, 0j, 0.0, 0.0
    kept: list[tuple[complex, complex, float, float]] = [(-along, along, 0.0, 0.0)]
    if one or other:
        k, other_k = (1.0, 0.0) if one else (0.0, 1.0)
        kept.append((-across, across, -distance * k, -distance * other_k))
        if one and other:
            kept.append((0j, 0j, -grip.body.arm, grip.body.arm))
    else:
        around = across / distance
    # Vector from the midpoint of both contacts to the object's origin.
    arm = grip.body.center - 0.5 * (point + other_point)
    up, right = arm.imag, arm.real
    rates = [
        (0.5 + up * around, 0.5 - up * around, -up * k, -up * other_k),
        (0.5j - right * around, 0.5j + right * around, right * k, right * other_k),
        (-around, around, k, other_k),
        *kept,
    ]
    back, other_back = (point - first.start).conjugate(), (other_point - second.start).conjugate()
    on_members: list[float] = []
    for h, g, k, other_k in rates:
        on_members += (h.real, h.imag, (h * back).imag + k)
        on_members += (g.real, g.imag, (g * other_back).imag + other_k)
    return np.array(on_members).reshape(-1, 6).dot(members)


def _middle(first: GripContact, others: list[GripContact]) -> complex:
    return 0.5 * (first.point + others[0].point) if others else first.point
