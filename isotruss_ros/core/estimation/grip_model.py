# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Model of a held object: its equilibrium, and the linearisation of pose and squeeze.

The state is (load, unexplained pose, delay, shifts of the contacts along the members); the
parameters are the roller offsets, see `grip_belief`. The outputs are the object's pose and the
squeeze.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from isotruss_ros.core.holding.attach_grip import attach_grip, lay_faces
from isotruss_ros.core.holding.held_gradient import held_gradient
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus, NotHeldError
from isotruss_ros.core.holding.held_shape import lowest_frequency
from isotruss_ros.core.holding.newton import Accuracy
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
#: Accuracy of a tracked equilibrium. In 121 equilibria of 6 runs with discs and boxes, with loads,
#: noise and wrong offsets, poses err by at most 1.3 um (median 0.1 um), squeezes and slip margins
#: by at most 2 mN, and the squeeze's derivative by opening by at most 0.4 %.
TRACKED = Accuracy(2e-4, 1e7)
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
    held = attach_grip(config, grip.body, members, pressure=pressures, quick=True)
    held = lay_faces(held, grip.friction, zero_deviation)
    if held.response is None:
        raise NotHeldError(HoldStatus.UNSTABLE)
    return held


def shift_deviations(held: HeldGrip, by_shifts: Array, friction: float) -> Array:
    """
    Return the prior deviations (m,) of the contacts' shifts along the members [m].

    A deviation is twice the shift that causes slip, at most the object's characteristic radius.
    For `by_shifts` see `shift_rates`.
    """
    reserve = friction * held.normal_forces - np.abs(held.friction_forces)
    reserve = np.maximum(reserve, 0.1 * friction * held.squeeze)
    # Derivatives (m, m) of the members' friction forces by the members' shifts.
    friction_rates = held.contacts.sum_by_member(by_shifts[held.state.places.friction])
    stiffness = np.abs(np.diag(friction_rates))
    smallest_stiffness = 2.0 * reserve / held.arm
    return 2.0 * reserve / np.maximum(stiffness, smallest_stiffness)


def output_scale(held: HeldGrip) -> Array:
    """Return the scale factors (4,) of pose and squeeze: the arm [m] for rotation, else 1."""
    return np.array([1.0, 1.0, held.arm, 1.0])


def output_change(held: HeldGrip, unknowns: Array) -> Array:
    """Return changes (4, ...) of pose and squeeze by those of the unknowns (3 + 4k, ...)."""
    squeeze = unknowns[held.state.places.normal].sum(axis=0) / len(held.members)
    return np.concatenate([unknowns[:3], squeeze[None]])


def shift_rates(held: HeldGrip) -> Array:
    """Return derivatives (3 + 4k, m) of pose, contact points and forces by the members' shifts."""
    places, owners = held.state.places, held.contacts.owners
    # A shift of a member's contacts changes the rolling condition of each of them.
    changes = np.zeros((places.size, len(held.members)))
    changes[places.conditions] = -np.eye(len(held.members))[owners]
    return held.respond(changes)


def state_rates(held: HeldGrip, by_shifts: Array) -> Array:
    """Return derivatives (4, n) of scaled pose and squeeze by the state; see `shift_rates`."""
    # Columns: derivatives of pose and contact forces by the load, and by the members' shifts.
    unknowns = np.hstack([held.response.change, by_shifts])
    outputs = output_scale(held)[:, None] * output_change(held, unknowns)
    # Columns: derivatives by load, unexplained pose, delay, and shifts.
    return np.column_stack([outputs[:, :3], np.eye(4, 3), np.zeros(4), outputs[:, 3:]])


@dataclass(frozen=True, eq=False)
class OffsetRates:
    """Derivatives by r roller offsets, whose contacts rest on members, and natural frequency."""

    held: HeldGrip  #: equilibrium of the object
    outputs: Array  #: (4, r) derivatives of the scaled outputs
    by_travel: Array  #: (3 + 4k, r) derivatives of the unknowns by travel of rolling contacts
    joints: Array  #: (2j, r) derivatives of the joint positions (x0, y0, x1, y1, ...)
    joints_by_shifts: Array  #: (2j, m) derivatives of the joint positions by the members' shifts

    @classmethod
    def of(cls, held: HeldGrip) -> OffsetRates:
        """Return the derivatives by roller offsets at an equilibrium."""
        gradient, rollers = held_gradient(held), len(held.config.roller_positions)
        outputs = np.vstack([gradient.pose, gradient.normal_forces.mean(axis=0)])
        rates = np.vstack([output_scale(held)[:, None] * outputs, gradient.joints])
        by_rollers, by_anchors = np.split(rates, [rollers], axis=1)
        by_offsets = by_rollers + by_anchors @ held.anchor_rates
        shifts_of_contacts = np.eye(len(held.members))[held.contacts.owners]
        return cls(
            held,
            by_offsets[:4],
            gradient.unknowns[:, :rollers],
            by_offsets[4:],
            by_anchors[4:] @ shifts_of_contacts,
        )

    @cached_property
    def frequency(self) -> float | None:
        """Return the lowest natural frequency [rad/s], see `lowest_frequency`."""
        return lowest_frequency(self.held)
