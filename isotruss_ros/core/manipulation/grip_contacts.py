# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The k contacts of a grip as arrays, and both sides of their constraint: J_h(q) qdot = G^T nu.

Of Murray, Li and Sastry: at every contact the tube's material moves as the object's surface does.

The tube does not stretch, so that the material of a straight member moves as a rigid body: with
the member's ends, and along it with the roller at which the member starts. The roller at its end
moves it just as much, (12): past the passive module of the tube it is the one that turns.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import find_members, Grip, MemberNodes, touch_members
from isotruss_ros.core.model.pose import MIN_DIAMETER
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np
from scipy.linalg import lapack

ONE_POINT = 'the members touch the object in one point: it cannot be held there'


class GripContacts(NamedTuple):
    """The k contacts of a grip, robot frame: one for each member, two where a face lies on it."""

    nodes: MemberNodes  #: numbers of the grip's members and of their nodes
    owners: Indices  #: (k,) which member of the grip it is
    starts: Points  #: (k,) of the members [m]
    spans: Points  #: (k,) members from start to end [m]
    axes: Points  #: (k,) their unit vectors
    normals: Points  #: (k,) unit vectors out of the object into the member
    points: Points  #: (k,) of the object's surface [m]
    sides: Array  #: (k,) +1 where the object is left of the member, -1 where it is right


def find_contacts(config: Configuration, grip: Grip) -> GripContacts:
    """
    Find where the members touch the object.

    :param config: configuration of the robot.
    :param grip: the grip.
    :raises GraspError: see `touch_members`.
    """
    owners, *places, sides = zip(*touch_members(config, grip), strict=True)
    nodes = find_members(config.robot, grip.members)
    return GripContacts(nodes, np.array(owners), *np.array(places), np.array(sides))


def hand_jacobian(config: Configuration, contacts: GripContacts) -> Array:
    """
    Return J_h: the velocity of the tubes' material at the contacts.

    :param config: configuration of the robot.
    :param contacts: of the grip.
    :return: (2 k, r) vx, vy of contact after contact in the robot frame, for 1 m/s at each
        roller [-].
    :raises ConfigurationError: the configuration is singular.
    """
    nodes, owners = contacts.nodes, contacts.owners
    # Turning rate of a member: Re(conj(turn) (velocity of its end - velocity of its start)). It
    # moves a point as i times its arm does, from the start on.
    arms, turns = contacts.points - contacts.starts, 1j / contacts.spans.conj()
    starts, ends, x = nodes.starts[owners], nodes.ends[owners], 2 * np.arange(len(owners))
    rows = np.zeros((2 * len(owners), len(config.points)), dtype=np.complex128)
    rows[x, starts], rows[x, ends] = 1.0 + arms.imag * turns, -arms.imag * turns
    rows[x + 1, starts], rows[x + 1, ends] = 1j - arms.real * turns, arms.real * turns
    velocities = config.roller_rows(rows.view(np.float64))
    for member, roller in zip(nodes.driven, nodes.rollers, strict=True):
        own = np.flatnonzero(owners == member)
        velocities[2 * own, roller] += contacts.axes[own].real
        velocities[2 * own + 1, roller] += contacts.axes[own].imag
    return velocities


def grasp_map(center: complex, contacts: GripContacts) -> Array:
    """
    Return G^T: the velocity of the object's surface at the contacts.

    :param center: of the object, to which the twist belongs, x + iy [m].
    :param contacts: of the grip.
    :return: (2 k, 3) vx, vy of contact after contact in the robot frame, for a twist vx, vy
        [m/s], omega [rad/s].
    """
    arms = (contacts.points - center).tolist()
    return np.array([row for arm in arms for row in ((1.0, 0.0, -arm.imag), (0.0, 1.0, arm.real))])


class ContactRows(NamedTuple):
    """Both sides of the constraint of a grip."""

    contacts: GripContacts  #: the k contacts
    hand: Array  #: (2 k, r) J_h, see `hand_jacobian`
    rigid: Array  #: (2 k, 3) G^T, see `grasp_map`


def contact_rows(config: Configuration, grip: Grip) -> ContactRows:
    """
    Return both sides of the constraint.

    :param config: configuration of the robot.
    :param grip: the grip.
    :raises GraspError: see `find_contacts`.
    :raises ConfigurationError: the configuration is singular.
    """
    contacts = find_contacts(config, grip)
    return ContactRows(contacts, hand_jacobian(config, contacts), grasp_map(grip.center, contacts))


def rows_of_three(config: Configuration, grip: Grip) -> Array:
    """
    Return `grip_jacobian` of three members: the least squares of what is left of the constraint.

    :param config: configuration of the robot.
    :param grip: of three members.
    :raises GraspError: see `find_contacts`; or the contacts are all in one point.
    :raises ConfigurationError: the configuration is singular.
    """
    contacts, hand, rigid = contact_rows(config, grip)
    if np.abs(contacts.points - contacts.points[0]).max() < MIN_DIAMETER:
        raise GraspError(ONE_POINT)
    square = np.concatenate([rigid, _misfits(rigid, contacts.normals)], axis=1)
    return np.asarray(lapack.dgesv(square, hand)[2])


def _misfits(rigid: Array, normals: Points) -> Array:
    """
    Return what no twist does to the contacts: (2 k, 2 k - 3), at right angles to G^T.

    The first is that each member moves away from the object by 0.5 m/s, without the part of it
    that would carry the object along.
    """
    # QR factorization, all columns of the first factor.
    tall = np.zeros((len(rigid), len(rigid)), order='F')
    tall[:, :3], tall[:, 3] = rigid, 0.5 * normals.view(float)
    factored, scales, _, _ = lapack.dgeqrf(tall[:, :4])
    size = factored[3, 3]
    tall[:, :4] = factored
    basis = lapack.dorgqr(tall, scales)[0]
    basis[:, 3] *= size
    return basis[:, 3:]
