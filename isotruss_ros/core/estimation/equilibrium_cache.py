# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Last equilibrium of the held object, with the changes of pose and squeeze since then.

- `ahead` is the prediction from roller travel by (19), because computing an equilibrium in each
  cycle would take too long.
- `_beyond` is the error of (19) in the last motion, which `ahead` extrapolates, because the
  bending that (19) neglects is a tenth of the motion.
- `drift` is the rate of `_beyond`, because commands that follow from (19) must compensate it.
- `_pending` is the linear change by corrections of the contacts, because an estimate must contain
  a measured pose at once, and the next equilibrium follows up to 20 ms later.
"""

from __future__ import annotations

from dataclasses import replace

from isotruss_ros.core.estimation.contact_walk import MODEL_ERROR
from isotruss_ros.core.estimation.grip_model import (
    anchor_rates,
    OffsetRates,
    Pressures,
    StateRates,
)
from isotruss_ros.core.holding.grip_response import slip_planes
from isotruss_ros.core.holding.held_grip import HeldGrip, MAX_EXTRAPOLATION
from isotruss_ros.core.holding.roll_grip import roll_grip, with_pressures
from isotruss_ros.core.kinematics.configuration import Configuration, MAX_FIRST_ORDER_TRAVEL
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.model.pose import pose_difference
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.safety.usage_limits import UsageLimits
import numpy as np


class EquilibriumCache:
    """
    Equilibrium without a load, its derivatives, and later changes of pose and squeeze.

    :ivar grasp: the equilibrium.
    :ivar grip: its contacts, from which (19) predicts the motion of the object.
    :ivar anchored: derivatives of its unknowns by the rolling invariants, see `anchor_rates`.
    :ivar rates: derivatives of pose and squeeze by the state.
    :ivar by_offsets: derivatives by roller offsets, at an equilibrium nearby.
    :ivar ahead: (4,) predicted changes of pose [m, m, rad] and squeeze [N] by roller travel.
    :ivar drift: error of (19) in the last motion, per time (4,) [m/s, rad/s, N/s].
    :ivar usage: limits on motion that reduces the slip margin or increases the utilisation.

    :param friction: coefficient of friction [-].
    """

    # Corrections since the equilibrium, see `take`.
    ahead: Array
    _anchors: Array
    _pending: Array  # (4,) changes of pose [m, m, rad] and squeeze [N]
    _pending_forces: Array
    _moved_zeros: Array

    def __init__(self, grasp: HeldGrip, friction: float) -> None:
        self._friction = friction
        self.by_offsets = OffsetRates.of(grasp)
        self.take(grasp)
        self.forget_motion(grasp)

    @property
    def pose(self) -> Array:
        """Return the predicted pose of the equilibrium without a load, (3,) [m, rad]."""
        return np.array(self.grasp.pose) + self.ahead[:3] + self._pending[:3]

    @property
    def squeeze(self) -> float:
        """Return the mean normal force of the members without load [N]."""
        return self.grasp.squeeze + float(self.ahead[3] + self._pending[3])

    @property
    def has_new_offsets(self) -> bool:
        """Return whether the roller offsets were corrected since the equilibrium."""
        return bool(self._moved_zeros.any())

    def take(self, grasp: HeldGrip) -> None:
        """Set the equilibrium, and the derivatives at this equilibrium."""
        self.grasp, self.grip = grasp, grasp.touching(self._friction)
        self.contact_rates = grip_jacobian(grasp.config, self.grip)
        self.ahead, self._pending, self._anchors = np.zeros(4), np.zeros(4), grasp.anchors
        self._moved_zeros = np.zeros(len(grasp.config.roller_positions))
        self._pending_forces = np.zeros(2 * len(grasp.anchors))
        self.anchored = anchor_rates(grasp)
        self.rates = StateRates.of(grasp, self.anchored)
        differentiated = self.by_offsets.grasp
        travel = grasp.config.roller_positions - differentiated.config.roller_positions
        far = differentiated.contacts is not grasp.contacts
        if far or np.abs(travel).max() > MAX_FIRST_ORDER_TRAVEL:
            self.by_offsets = OffsetRates.of(grasp)

    def forget_motion(self, grasp: HeldGrip) -> None:
        """Reset the quantities that are derived from the last motion, at a new equilibrium."""
        self.usage, self._beyond, self.drift = UsageLimits(grasp), np.zeros(4), np.zeros(4)
        self._motion = np.zeros(len(grasp.config.roller_positions))

    def predict(self, config: Configuration) -> tuple[Array, bool]:
        """Update `ahead`; return the travel (r,) [m], and whether extrapolation is valid."""
        travel = config.roller_positions - self.grasp.config.roller_positions - self._moved_zeros
        moved, before = self.contact_rates @ travel, self._motion
        share = float(travel @ before) / max(float(before @ before), MODEL_ERROR**2)
        near = abs(share) <= MAX_EXTRAPOLATION
        share = max(-MAX_EXTRAPOLATION, min(share, MAX_EXTRAPOLATION))
        slope = self.grasp.squeeze_stiffness()
        self.ahead = np.append(moved[:3], slope * moved[3]) + share * self._beyond
        return travel, near

    def roll(self, config: Configuration, pressures: Pressures) -> HeldGrip | None:
        """Return the equilibrium with all corrections in a configuration; None if none exists."""
        inflated = with_pressures(self.grasp, pressures)
        return roll_grip(replace(inflated, anchors=self._anchors), config)

    def placed(self, shifts: Array) -> HeldGrip | None:
        """Return the equilibrium after shifts (m,) [m] of the members' contacts, or None."""
        anchors = self.grasp.anchors + shifts[self.grasp.contacts.owners]
        return roll_grip(replace(self.grasp, anchors=anchors), self.grasp.config)

    def shift(self, shifts: Array) -> None:
        """Shift the contacts (k,) along the members [m]."""
        moved = self.anchored @ shifts
        squeeze = moved[self.grasp.state.places.normal].sum() / len(self.grasp.members)
        self._anchors = self._anchors + shifts
        self._pending = self._pending + np.append(moved[:3], squeeze)
        self._pending_forces = self._pending_forces + moved[-2 * len(shifts) :]  # noqa: E203

    def correct_zeros(self, moved: Array, sensitivity: Array, first: int) -> None:
        """Correct the offsets by `moved` (r,) [m]; `sensitivity[first:]` (m, r) is for shifts."""
        grasp = self.grasp
        shifts = (sensitivity[first:] @ moved)[grasp.contacts.owners]
        self._anchors = self._anchors + grasp.statics.anchor_rates @ moved + shifts
        self._moved_zeros = self._moved_zeros + moved
        rates = self.by_offsets.squeeze + self.rates.squeeze @ sensitivity
        self.ahead = self.ahead + np.append(np.zeros(3), rates @ moved)

    def margin(self) -> float:
        """Return the object's slip margin with pending forces [N]."""
        planes = slip_planes(self.grasp.response, self._friction)
        return float(((planes.reserve + planes.rows @ self._pending_forces) / planes.size).min())

    def pose_change(self, grasp: HeldGrip) -> Array:
        """Return the pose (3,) of a rolled equilibrium minus the pose predicted by this cache."""
        return pose_difference(grasp.pose, np.array(self.grasp.pose) + self._pending[:3])

    def learn(self, grasp: HeldGrip, travel: Array, change: Array, elapsed: float) -> None:
        """Derive drift, and derivatives of margin and utilisation, from a rolled equilibrium."""
        before = self.grasp
        if grasp.contacts is not before.contacts:  # a discontinuity
            self.forget_motion(grasp)
            return
        moved = self.contact_rates @ travel
        pressed = grasp.squeeze - before.squeeze - self._pending[3]
        pressed -= before.squeeze_stiffness() * moved[3]
        self._motion, self._beyond = travel, np.append(change - moved[:3], pressed)
        self.drift = self._beyond / elapsed
        self.usage.learn(grasp, grasp.slip_margin(self._friction) - self.margin(), travel)
