# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start of the model of a held object: its equilibrium, and the prior of its contact history."""

from __future__ import annotations

from isotruss_ros.core.holding.attach_grip import attach_grip, lay_faces
from isotruss_ros.core.holding.contact_statics import TubeModel
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus, NotHeldError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import find_members, Grip
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Gauge pressure of each tube (t,) [Pa]; None: as in the robot file.
Pressures = tuple[float, ...] | None


def attach_model(
    config: Configuration, grip: Grip, pressures: Pressures = None, zero_deviation: float = 0.0
) -> HeldGrip:
    """
    Return the object's equilibrium near its measured pose.

    The equilibrium is not neutral, so its `response` to wrenches is not None.

    :param config: configuration of the robot.
    :param grip: grip with the object at its measured pose.
    :param pressures: (t,) gauge pressure of each tube [Pa]; None: as in the robot file.
    :param zero_deviation: standard deviation of the roller offsets [m], see `lay_faces`.
    :raises NotHeldError: no equilibrium exists, or its Jacobian is singular.
    :raises GraspError: the robot has no such members.
    :raises StructureError: see `structure_of`.
    """
    members = find_members(config.robot, grip.members).members
    found = attach_grip(
        config, grip.body, members, tubes=TubeModel(pressure=pressures), quick=True
    )
    found = lay_faces(found, grip.friction, zero_deviation)
    if found.response is None:
        raise NotHeldError(HoldStatus.UNSTABLE)
    return found


def shift_deviations(grasp: HeldGrip, anchored: Array, friction: float) -> Array:
    """
    Return the prior deviations (m,) of the contacts' shifts along the members [m].

    A deviation is twice the shift that causes slip, but at most the object's characteristic
    radius.

    :param grasp: equilibrium of the object.
    :param anchored: derivatives of the unknowns of the equilibrium, see `anchor_rates`.
    :param friction: coefficient of friction [-].
    """
    members = np.eye(len(grasp.members))[grasp.contacts.owners]
    presses, rubs = (members.T @ f for f in np.split(grasp.state.forces, 2))
    left = np.maximum(friction * presses - np.abs(rubs), 0.1 * friction * grasp.squeeze)
    rates = np.diag(members.T @ anchored[grasp.state.places.friction] @ members)
    return np.minimum(2.0 * left / np.maximum(np.abs(rates), left / grasp.arm), grasp.arm)
