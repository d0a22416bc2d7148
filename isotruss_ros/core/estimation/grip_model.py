# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Model of a held object: its equilibrium, and the linearisation of pose and squeeze.

The state is (load, unexplained pose, delay, shifts of the contacts along the members); the
parameters are the roller offsets, see `grip_belief`.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.holding.attach_grip import attach_grip, lay_faces
from isotruss_ros.core.holding.held_gradient import held_gradient, HeldGradient
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus, NotHeldError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import find_members, Grip
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Indices of load, unexplained pose and delay in the state, and first index of the contacts'
#: shifts.
LOAD, BIAS, DELAY, SHIFTS = slice(0, 3), slice(3, 6), 6, 7
#: Largest utilisation of an equilibrium that is searched near a measured or estimated pose [-].
#: There, the moment in the model exceeds that of a wrinkled tube by 5 % (Comer and Levy, see
#: `core.statics.wrinkling`); at 1.5 it exceeds it by 15 %.
MAX_UTILISATION = 1.2
#: Gauge pressure of each tube (t,) [Pa]; None: as in the robot file.
Pressures = tuple[float, ...] | None


def attach_model(
    config: Configuration, grip: Grip, pressures: Pressures = None, zero_deviation: float = 0.0
) -> HeldGrip:
    """
    Return the object's equilibrium near its measured pose, with a `response` to wrenches.

    For the deviation of the roller offsets [m] see `lay_faces`.
    """
    members = find_members(config.robot, grip.members).members
    grasp = attach_grip(config, grip.body, members, pressure=pressures, quick=True)
    grasp = lay_faces(grasp, grip.friction, zero_deviation)
    if grasp.response is None:
        raise NotHeldError(HoldStatus.UNSTABLE)
    return grasp


def shift_deviations(grasp: HeldGrip, anchored: Array, friction: float) -> Array:
    """
    Return the prior deviations (m,) of the contacts' shifts along the members [m].

    A deviation is twice the shift that causes slip, at most the object's characteristic radius.
    """
    members = np.eye(len(grasp.members))[grasp.contacts.owners]
    presses, rubs = (members.T @ f for f in np.split(grasp.state.forces, 2))
    reserve = np.maximum(friction * presses - np.abs(rubs), 0.1 * friction * grasp.squeeze)
    rates = np.diag(members.T @ anchored[grasp.state.places.friction] @ members)
    return np.minimum(2.0 * reserve / np.maximum(np.abs(rates), reserve / grasp.arm), grasp.arm)


class StateRates(NamedTuple):
    """Derivatives of pose, rotations times the characteristic radius, and squeeze by the state."""

    pose: Array  #: (3, n) derivatives of the object's pose
    squeeze: Array  #: (n,) derivatives of the squeeze

    @classmethod
    def of(cls, grasp: HeldGrip, anchored: Array) -> StateRates:
        """Return the derivatives at an equilibrium; `anchored` is from `anchor_rates`."""
        even, members = np.array([[1.0], [1.0], [grasp.arm]]), len(grasp.members)
        by_shift = anchored @ np.eye(members)[grasp.contacts.owners]
        pose, squeeze = np.zeros((3, SHIFTS + members)), np.zeros(SHIFTS + members)
        pose[:, LOAD], squeeze[LOAD] = even * grasp.response.pose, grasp.response.squeeze
        pose[:, BIAS] = np.eye(3)
        pose[:, SHIFTS:] = even * by_shift[:3]
        squeeze[SHIFTS:] = by_shift[grasp.state.places.normal].sum(axis=0) / members
        return cls(pose, squeeze)


class OffsetRates(NamedTuple):
    """Derivatives of pose and squeeze by roller offsets, for contacts at rest on the members."""

    grasp: HeldGrip  #: equilibrium of the object
    gradient: HeldGradient  #: gradient of this equilibrium
    pose: Array  #: (3, r) derivatives of the pose, see `StateRates`
    squeeze: Array  #: (r,) derivatives of the squeeze

    @classmethod
    def of(cls, grasp: HeldGrip) -> OffsetRates:
        """Return the derivatives by roller offsets at an equilibrium."""
        gradient, count = held_gradient(grasp), len(grasp.config.roller_positions)
        along = grasp.statics.anchor_rates  # contacts at rest on the members
        even = np.array([[1.0], [1.0], [grasp.arm]])
        given = np.vstack([even * gradient.pose, gradient.normal_forces.mean(axis=0)])
        by_offsets = given[:, :count] + given[:, count:] @ along
        return cls(grasp, gradient, by_offsets[:3], by_offsets[3])

    def joint_rates(self, shifts: Array) -> Array:
        """Return derivatives (2j, r) of joint positions, from those (m, r) of contact shifts."""
        joints, count = self.gradient.joints, len(self.grasp.config.roller_positions)
        along = self.grasp.statics.anchor_rates + shifts[self.grasp.contacts.owners]
        return joints[:, :count] + joints[:, count:] @ along


def anchor_rates(grasp: HeldGrip) -> Array:
    """Return the derivatives (3 + 4k, k) of `ContactForces.unknowns` by rolling invariants."""
    places = grasp.state.places
    changes = np.zeros((places.size, len(grasp.anchors)))
    changes[places.conditions] = -np.eye(len(grasp.anchors))
    return grasp.respond(changes)
