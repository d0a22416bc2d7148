# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Last equilibrium of the held object, with the changes of pose and squeeze since then.

- `ahead` is the prediction from roller travel by (19), because computing an equilibrium in each
  cycle would take too long.
- `_beyond` is the error of (19) in the last motion, which `ahead` extrapolates, because the
  bending that (19) neglects is a tenth of the motion.
- `drift` is the rate of `_beyond`, because commands that follow from (19) must compensate it.
- `outputs` contain the linear change by corrections of the contacts, because an estimate must
  contain a measured pose at once, and the next equilibrium follows up to 20 ms later.
"""

from __future__ import annotations

from dataclasses import replace

from isotruss_ros.core.estimation.contact_walk import MODEL_ERROR
from isotruss_ros.core.estimation.grip_model import (
    OffsetRates,
    output_scale,
    Pressures,
    shift_rates,
    SHIFTS,
    state_rates,
)
from isotruss_ros.core.holding.grip_response import slip_planes
from isotruss_ros.core.holding.held_grip import HeldGrip, MAX_EXTRAPOLATION
from isotruss_ros.core.holding.roll_grip import roll_grip, with_pressures
from isotruss_ros.core.kinematics.configuration import Configuration, MAX_FIRST_ORDER_TRAVEL
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.safety.usage_limits import UsageLimits
import numpy as np


class EquilibriumCache:
    """
    Equilibrium without a load, its derivatives, and later changes of pose and squeeze.

    :ivar grasp: the equilibrium.
    :ivar grip: its contacts, from which (19) predicts the motion of the object.
    :ivar travel_rates: (4, r) derivatives of the outputs by roller travel, by (19).
    :ivar shifted: derivatives of its unknowns by the members' shifts, see `shift_rates`.
    :ivar scale: (4,) factors on the outputs in the following derivatives, see `output_scale`.
    :ivar rates: (4, n) derivatives of the outputs by the state.
    :ivar by_offsets: derivatives by roller offsets, at an equilibrium nearby.
    :ivar outputs: (4,) pose [m, m, rad] and squeeze [N] without a load, corrected by poses.
    :ivar ahead: (4,) predicted changes of the outputs by roller travel.
    :ivar moved_zeros: (r,) corrections of the roller offsets since the equilibrium [m].
    :ivar drift: error of (19) in the last motion, per time (4,) [m/s, m/s, rad/s, N/s].
    :ivar usage: limits on motion that reduces the slip margin or increases the utilisation.

    :param friction: coefficient of friction [-].
    """

    def __init__(self, grasp: HeldGrip, friction: float) -> None:
        self._friction = friction
        self.by_offsets = OffsetRates.of(grasp)
        self.take(grasp)
        self.forget_motion(grasp)

    def take(self, grasp: HeldGrip) -> None:
        """Set the equilibrium, and the derivatives at this equilibrium."""
        self.grasp, self.grip = grasp, grasp.touching(self._friction)
        self.travel_rates = grip_jacobian(grasp.config, self.grip)[:4].copy()
        self.travel_rates[3] *= grasp.squeeze_stiffness()
        self.outputs = np.append(grasp.pose, grasp.squeeze)
        self.ahead, self._anchors = np.zeros(4), grasp.anchors
        self.moved_zeros = np.zeros(len(grasp.config.roller_positions))
        self._pending_forces = np.zeros(2 * len(grasp.anchors))
        self.scale, self.shifted = output_scale(grasp), shift_rates(grasp)
        self.rates = state_rates(grasp, self.shifted)
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
        travel = config.roller_positions - self.grasp.config.roller_positions - self.moved_zeros
        before = self._motion
        share = float(travel @ before) / max(float(before @ before), MODEL_ERROR**2)
        near = abs(share) <= MAX_EXTRAPOLATION
        share = max(-MAX_EXTRAPOLATION, min(share, MAX_EXTRAPOLATION))
        self.ahead = self.travel_rates @ travel + share * self._beyond
        return travel, near

    def roll(
        self, config: Configuration, pressures: Pressures, shifts: Array | float = 0.0
    ) -> HeldGrip | None:
        """
        Return the equilibrium with all corrections in a configuration; None if none exists.

        The k contacts are shifted along their members by further `shifts` (k,) [m].
        """
        inflated = with_pressures(self.grasp, pressures)
        return roll_grip(replace(inflated, anchors=self._anchors + shifts), config)

    def shift(self, shifts: Array) -> None:
        """Shift the contacts of the members (m,) along them [m]."""
        forces = self.shifted[self.grasp.state.places.forces] @ shifts
        self._anchors = self._anchors + shifts[self.grasp.contacts.owners]
        self.outputs = self.outputs + self.rates[:, SHIFTS:] @ shifts / self.scale
        self._pending_forces = self._pending_forces + forces

    def correct_zeros(self, moved: Array, sensitivity: Array, first: int) -> None:
        """Correct the offsets by `moved` (r,) [m]; `sensitivity[first:]` (m, r) is for shifts."""
        grasp = self.grasp
        shifts = (sensitivity[first:] @ moved)[grasp.contacts.owners]
        self._anchors = self._anchors + grasp.statics.anchor_rates @ moved + shifts
        self.moved_zeros = self.moved_zeros + moved
        rates = self.by_offsets.outputs[3] + self.rates[3] @ sensitivity
        self.ahead = self.ahead + np.append(np.zeros(3), rates @ moved)

    def margin(self) -> float:
        """Return the object's slip margin with pending forces [N]."""
        planes = slip_planes(self.grasp.response, self._friction)
        return float(((planes.reserve + planes.rows @ self._pending_forces) / planes.size).min())

    def learn(self, grasp: HeldGrip, travel: Array, change: Array, elapsed: float) -> None:
        """Derive drift, and derivatives of margin and utilisation, from a rolled equilibrium."""
        if grasp.contacts is not self.grasp.contacts:  # a discontinuity
            self.forget_motion(grasp)
            return
        self._motion, self._beyond = travel, change - self.travel_rates @ travel
        self.drift = self._beyond / elapsed
        self.usage.learn(grasp, grasp.slip_margin(self._friction) - self.margin(), travel)
