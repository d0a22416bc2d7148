# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Loads on a held object and on the joints of the robot, such as the floor's friction."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.loaded_frame import held_joints
from isotruss_ros.core.numerics.arrays import Array
import numpy as np


class LoadedParts(NamedTuple):
    """
    What bears loads: the object, and joint after joint where these do. Contacts stick.

    :ivar places: (n,) x, y and arm times the angle of the object, x and y of each joint [m].
    :ivar compliance: (n, n) displacement by loads (fx, fy, m / arm), and (fx, fy) [m/N].
    :ivar by_contacts: (2j, 3k) displacement of the joints by loads on the contacts, along and
        across the members and moments [m/N], [1/N]; None where joints bear none. By Betti, the
        contacts give likewise under forces on the joints.
    """

    places: Array
    compliance: Array
    by_contacts: Array | None

    @classmethod
    def find(cls, grip: HeldGrip, with_joints: bool, loads: Array | None = None) -> LoadedParts:
        """
        Return them for a held object.

        :param grip: how it is held, in equilibrium with the loads, and with a `response`.
        :param with_joints: whether the joints bear loads.
        :param loads: (n,) [N]; none if None.
        """
        even, change = np.array([1.0, 1.0, grip.arm]), grip.response.change
        place = even * np.array(grip.pose)
        if not with_joints:
            return cls(place, even[:, None] * change[:3], None)
        own, by_contacts = joint_compliance(grip)
        size, count = len(own), len(grip.anchors)
        right = np.zeros((len(change), size))
        right[: 3 * count] = -by_contacts.T
        change = np.hstack([change, np.linalg.solve(grip.tangent, right)])
        pushed = grip.statics.load_rates(grip.state.unknowns, change)
        moved = by_contacts @ pushed.reshape(3 * count, -1)
        moved[:, 3:] += own
        compliance = np.vstack([even[:, None] * change[:3], moved])
        joints = held_joints(grip).ravel()
        if loads is not None:
            joints = joints + own @ loads[3:]
        return cls(np.append(place, joints), 0.5 * (compliance + compliance.T), by_contacts)

    def load(self, grip: HeldGrip, loads: Array) -> HeldGrip:
        """
        Return a grip that is not in equilibrium yet: loads on joints act when it rolls on.

        :param grip: how the object is held.
        :param loads: (n,) [N].
        """
        if self.by_contacts is None:
            return grip
        given = (self.by_contacts.T @ loads[3:]).reshape(-1, 3)
        return replace(grip, statics=replace(grip.statics, given=given))


def joint_compliance(grip: HeldGrip) -> tuple[Array, Array]:
    """
    Return how the j joints of a robot give, x and y of joint after joint.

    :param grip: how it holds an object.
    :return: (2j, 2j) by forces on joints where nothing is held [m/N]; and `by_contacts`.
    """
    bent, joints = grip.statics.bent, len(grip.config.robot.topology.joint_names)
    loads = np.zeros((len(bent.frame.points), 3, joints, 2))
    own = np.arange(joints)
    loads[own, 0, own, 0] = loads[own, 1, own, 1] = 1.0 / grip.tubes.stiffness_scale
    moved, _ = bent.tangent.respond(loads.reshape(-1, 2 * joints))
    size = 3 * len(grip.anchors)
    by_contacts = bent.node_changes(np.eye(size).reshape(-1, 3, size))
    return (
        moved.reshape(-1, 3, 2 * joints)[:joints, :2].reshape(2 * joints, -1),
        by_contacts[:joints, :2].reshape(2 * joints, -1),
    )
