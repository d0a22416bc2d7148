# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Model of a held object: its equilibrium, and the linearisation of pose and squeeze.

The state is (load, unexplained pose, delay, shifts of the contacts along the members); the
parameters are the roller offsets, see `grip_belief`. The outputs are the object's pose and the
squeeze.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.holding.attach_grip import attach_grip, lay_faces
from isotruss_ros.core.holding.held_gradient import held_gradient
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
    members = find_members(config.robot.topology, grip.members).members
    grasp = attach_grip(config, grip.body, members, pressure=pressures, quick=True)
    grasp = lay_faces(grasp, grip.friction, zero_deviation)
    if grasp.response is None:
        raise NotHeldError(HoldStatus.UNSTABLE)
    return grasp


def shift_deviations(grasp: HeldGrip, by_shifts: Array, friction: float) -> Array:
    """
    Return the prior deviations (m,) of the contacts' shifts along the members [m].

    A deviation is twice the shift that causes slip, at most the object's characteristic radius.
    For `by_shifts` see `shift_rates`.
    """
    reserve = friction * grasp.normal_forces - np.abs(grasp.friction_forces)
    reserve = np.maximum(reserve, 0.1 * friction * grasp.squeeze)
    # Derivatives (m, m) of the members' friction forces by the members' shifts.
    friction_rates = grasp.contacts.sum_by_member(by_shifts[grasp.state.places.friction])
    stiffness = np.abs(np.diag(friction_rates))
    smallest_stiffness = 2.0 * reserve / grasp.arm
    return 2.0 * reserve / np.maximum(stiffness, smallest_stiffness)


def output_scale(grasp: HeldGrip) -> Array:
    """Return the scale factors (4,) of pose and squeeze: the arm [m] for rotation, else 1."""
    return np.array([1.0, 1.0, grasp.arm, 1.0])


def shift_rates(grasp: HeldGrip) -> Array:
    """Return derivatives (3 + 4k, m) of pose, contact points and forces by the members' shifts."""
    places, owners = grasp.state.places, grasp.contacts.owners
    # A shift of a member's contacts changes the rolling condition of each of them.
    changes = np.zeros((places.size, len(grasp.members)))
    changes[places.conditions] = -np.eye(len(grasp.members))[owners]
    return grasp.respond(changes)


def state_rates(grasp: HeldGrip, by_shifts: Array) -> Array:
    """Return derivatives (4, n) of scaled pose and squeeze by the state; see `shift_rates`."""
    members = len(grasp.members)
    # Columns: derivatives of pose and contact forces by the load, and by the members' shifts.
    unknowns = np.hstack([grasp.response.change, by_shifts])
    squeeze = unknowns[grasp.state.places.normal].sum(axis=0) / members
    outputs = output_scale(grasp)[:, None] * np.vstack([unknowns[:3], squeeze])
    # Columns: derivatives by load, unexplained pose, delay, and shifts.
    return np.column_stack([outputs[:, :3], np.eye(4, 3), np.zeros(4), outputs[:, 3:]])


class OffsetRates(NamedTuple):
    """Derivatives of pose, squeeze and joints by r roller offsets; contacts rest on members."""

    grasp: HeldGrip  #: equilibrium of the object
    outputs: Array  #: (4, r) derivatives of the scaled outputs
    joints: Array  #: (2j, r) derivatives of the joint positions (x0, y0, x1, y1, ...)
    joints_by_shifts: Array  #: (2j, m) derivatives of the joint positions by the members' shifts

    @classmethod
    def of(cls, grasp: HeldGrip) -> OffsetRates:
        """Return the derivatives by roller offsets at an equilibrium."""
        gradient, rollers = held_gradient(grasp), len(grasp.config.roller_positions)
        outputs = np.vstack([gradient.pose, gradient.normal_forces.mean(axis=0)])
        rates = np.vstack([output_scale(grasp)[:, None] * outputs, gradient.joints])
        by_rollers, by_anchors = np.split(rates, [rollers], axis=1)
        by_offsets = by_rollers + by_anchors @ grasp.statics.anchor_rates
        shifts_of_contacts = np.eye(len(grasp.members))[grasp.contacts.owners]
        return cls(grasp, by_offsets[:4], by_offsets[4:], by_anchors[4:] @ shifts_of_contacts)
