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
    Return the Jacobian (3 + g, r) of the object's motion by roller speeds, (19) with (12); cached.

    The rows are vx, vy [m/s] and omega [rad/s] of the object in the robot frame; then the residual
    of J_h(q) qdot = G^T nu, zero if no contact opens or slips. Its first row is the opening rate
    [m/s]: the rate of the distance between the contacts of two members, or twice the speed of each
    of three members away from the object. The number g is 1 for two point contacts, 2 with one
    face, 3 with two faces, and 2 k - 3 for k contacts on three members.
    """
    contacts = find_contacts(config, grip)
    if len(grip.members) == 2:
        jacobian = rows_of_two(grip, contacts, member_rows(config, grip.members))
    else:
        jacobian = _rows_of_three(config, grip, contacts)
    jacobian.flags.writeable = False
    return jacobian


def _rows_of_three(config: Configuration, grip: Grip, contacts: Sequence[GripContact]) -> Array:
    """Return `grip_jacobian` (3 + g, r) of three members, with the least-squares twist."""
    points = np.array([contact.point for contact in contacts])
    _require_apart(np.abs(points - points[0]).max())
    by_speeds, by_twist = contact_rows(config, grip)
    # Motion of all contacts away from the object, at 0.5 m/s for an opening rate of 1 m/s.
    opening = 0.5 * np.array([contact.normal for contact in contacts]).view(float)
    # Q R = [G^T, opening]: the columns of Q after the third are an orthonormal basis N of the
    # complement of the range of G^T. The opening's projection on the complement is R_44 N_1.
    basis, factor = np.linalg.qr(np.column_stack([by_twist, opening]), mode='complete')
    complement = basis[:, 3:]
    complement[:, 0] *= factor[3, 3]
    # J_h phidot = [G^T, N] (nu, residual), with 2 k equations and unknowns.
    return np.linalg.solve(np.concatenate([by_twist, complement], axis=1), by_speeds)


def _require_apart(distance: float) -> None:
    if distance < MIN_DIAMETER:
        raise GraspError(
            'all members touch the object at one point; the contacts must be apart to hold it'
        )


@functools.lru_cache(maxsize=8)
def member_rows(config: Configuration, names: tuple[str, ...]) -> Array:
    """
    Return the Jacobian (m, 3, r) of the velocities of m members by roller speeds, cached.

    Rows are vx, vy of the tube's material at the start [-], and angular velocity (16) [1/m].
    """
    nodes, points = find_members(config.robot.topology, names), config.points
    # A coefficient a + ib of a node stands for a vx + b vy of its velocity.
    by_nodes = np.zeros((len(names), 3, len(points)), dtype=np.complex128)
    axes: list[complex] = []
    for member, (start, end) in enumerate(nodes.lines.tolist()):
        span = complex(points[end] - points[start])
        axes.append(span / abs(span))
        by_nodes[member, 0, start], by_nodes[member, 1, start] = 1.0, 1j
        # Angular velocity: Re(conj(turn) (velocity of the end - velocity of the start)).
        turn = 1j / span.conjugate()
        by_nodes[member, 2, start], by_nodes[member, 2, end] = -turn, turn
    rows = config.roller_rows(by_nodes.view(np.float64).reshape(3 * len(names), -1))
    by_speeds = rows.reshape(len(names), 3, -1)
    # A roller moves the material along its member, so that the object rolls (17).
    for member, roller in zip(nodes.driven.tolist(), nodes.rollers.tolist(), strict=True):
        by_speeds[member, 0, roller] += axes[member].real
        by_speeds[member, 1, roller] += axes[member].imag
    by_speeds.flags.writeable = False
    return by_speeds


def contact_rows(config: Configuration, grip: Grip) -> tuple[Array, Array]:
    """
    Return both matrices of the grasp constraint J_h(q) qdot = G^T nu, in the robot frame.

    J_h (2 k, r) has the derivatives of the contacts' velocities by roller speeds, and G^T (2 k, 3)
    those by the twist.
    """
    contacts = find_contacts(config, grip)
    # Velocities of points of rigid bodies: vx - omega arm_y and vy + omega arm_x.
    # Axes: contact, component, member, motion (vx, vy, omega) of the member's start.
    by_members = np.zeros((len(contacts), 2, len(grip.members), 3))
    by_twist: list[tuple[float, float, float]] = []
    for k, contact in enumerate(contacts):
        member_arm, arm = contact.point - contact.start, contact.point - grip.body.center
        by_members[k, :, contact.owner] = (1.0, 0.0, -member_arm.imag), (0.0, 1.0, member_arm.real)
        by_twist += [(1.0, 0.0, -arm.imag), (0.0, 1.0, arm.real)]
    members = member_rows(config, grip.members).reshape(3 * len(grip.members), -1)
    return by_members.reshape(2 * len(contacts), -1) @ members, np.array(by_twist)


def rows_of_two(grip: Grip, contacts: Sequence[GripContact], members: Array) -> Array:
    """
    Return `grip_jacobian` (3 + g, r) of two members, from the contacts and `member_rows`.

    The object rotates with the member that touches a face, or else with the line through both
    contact points. The midpoint of both points moves with their mean velocity.
    """
    # Contact points: a face touches at the middle of its ends.
    patches = [[contact for contact in contacts if contact.owner == owner] for owner in (0, 1)]
    points = [0.5 * (patch[0].point + patch[-1].point) for patch in patches]
    distance = abs(points[1] - points[0])
    _require_apart(distance)
    # Rows Re(a v_0 + b v_1) + c omega_0 + d omega_1, with coefficients (a, b, c, d) of the
    # velocities v of the material at both points (15), and of both members' angular velocities.
    along = (points[1] - points[0]).conjugate() / distance
    across = -1j * along
    # Motion of the object (18).
    faces = [owner for owner, patch in enumerate(patches) if len(patch) > 1]
    by_line, spin_0, spin_1 = across / distance, 0.0, 0.0
    if faces:
        by_line, spin_0, spin_1 = 0j, 1.0 - faces[0], float(faces[0])
    from_midpoint = grip.body.center - 0.5 * (points[0] + points[1])
    x, y = from_midpoint.real, from_midpoint.imag
    rows = [
        (0.5 + y * by_line, 0.5 - y * by_line, -y * spin_0, -y * spin_1),
        (-0.5j - x * by_line, -0.5j + x * by_line, x * spin_0, x * spin_1),
        (-by_line, by_line, spin_0, spin_1),
        # Residuals: opening rate, zero for a disc at a module at constant angle (14); and with
        # faces, their rotations relative to the line through the points, and to each other.
        (-along, along, 0.0, 0.0),
    ]
    if faces:
        rows.append((-across, across, -distance * spin_0, -distance * spin_1))
    if len(faces) == 2:
        rows.append((0j, 0j, -grip.body.arm, grip.body.arm))
    # The velocity of a point is vx + i vy + i arm omega, by the motion of its member's start.
    arm_0, arm_1 = points[0] - patches[0][0].start, points[1] - patches[1][0].start
    by_members = [
        (a.real, -a.imag, c - (a * arm_0).imag, b.real, -b.imag, d - (b * arm_1).imag)
        for a, b, c, d in rows
    ]
    return np.array(by_members).dot(members.reshape(6, -1))
