# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Last equilibrium of the held object, with the changes of pose and squeeze since then.

- `predicted` is the change by roller travel according to (19), because computing an equilibrium in
  each cycle would take too long.
- `_neglected` is the error of (19) in the last motion, which `predicted` extrapolates, because the
  bending that (19) neglects is a tenth of the motion.
- `drift` is the rate of `_neglected`, because commands that follow from (19) must compensate it.
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
from isotruss_ros.core.holding.contact_search import measure_gaps
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
    Last equilibrium of a held object without a load, its derivatives, and changes since then.

    :ivar grasp: the equilibrium.
    :ivar grip: its contacts, from which (19) predicts the motion of the object.
    :ivar travel_rates: (4, r) derivatives of the outputs by roller travel, by (19).
    :ivar by_shifts: derivatives of its unknowns by the members' shifts, see `shift_rates`.
    :ivar scale: (4,) factors on the outputs in the following derivatives, see `output_scale`.
    :ivar rates: (4, n) derivatives of the outputs by the state.
    :ivar by_offsets: derivatives by roller offsets, at an equilibrium nearby.
    :ivar outputs: (4,) pose [m, m, rad] and squeeze [N] without a load, corrected by poses.
    :ivar predicted: (4,) predicted changes of the outputs by roller travel.
    :ivar zero_corrections: (r,) corrections of the roller offsets since the equilibrium [m].
    :ivar corrections_since_search: (r,) the same since the search that created this cache [m].
    :ivar drift: error of (19) in the last motion, per time (4,) [m/s, m/s, rad/s, N/s].
    :ivar usage: limits on motion that reduces the slip margin or increases the utilisation.

    :param friction: coefficient of friction [-].
    """

    def __init__(self, grasp: HeldGrip, friction: float) -> None:
        self._friction = friction
        self.by_offsets = OffsetRates.of(grasp)
        self.corrections_since_search = np.zeros(len(grasp.config.roller_positions))
        self.take(grasp)
        self.forget_motion(grasp)

    def take(self, grasp: HeldGrip) -> None:
        """Set the equilibrium and the derivatives at it; reset the changes since then."""
        self.grasp, self.grip = grasp, measure_gaps(grasp, self._friction)
        # The fourth row is the opening rate of the grip, on which the squeeze depends.
        self.travel_rates = grip_jacobian(grasp.config, self.grip)[:4].copy()
        self.travel_rates[3] *= grasp.squeeze_stiffness()
        self.outputs = np.append(grasp.pose, grasp.squeeze)
        self.predicted = np.zeros(4)
        self.zero_corrections = np.zeros(len(grasp.config.roller_positions))
        self._anchors = grasp.anchors
        self._pending_forces = np.zeros(2 * len(grasp.anchors))
        self.scale = output_scale(grasp)
        self.by_shifts = shift_rates(grasp)
        self.rates = state_rates(grasp, self.by_shifts)
        # The derivatives by offsets take longest, so those of an equilibrium nearby are used.
        nearby = self.by_offsets.grasp
        travel = grasp.config.roller_positions - nearby.config.roller_positions
        if nearby.contacts is not grasp.contacts or np.abs(travel).max() > MAX_FIRST_ORDER_TRAVEL:
            self.by_offsets = OffsetRates.of(grasp)

    def forget_motion(self, grasp: HeldGrip) -> None:
        """Reset drift, neglected motion and usage limits, which follow from the last motion."""
        self.usage, self._neglected, self.drift = UsageLimits.of(grasp), np.zeros(4), np.zeros(4)
        self._last_travel = np.zeros(len(grasp.config.roller_positions))

    def predict(self, config: Configuration) -> tuple[Array, bool]:
        """
        Predict the change of pose and squeeze by roller travel since the equilibrium.

        :return: the travel (r,) [m], and whether it is short enough for the extrapolation of the
            motion that `travel_rates` neglect.
        """
        start = self.grasp.config.roller_positions + self.zero_corrections
        travel = config.roller_positions - start
        # The motion that `travel_rates` neglect is assumed to be proportional to the travel.
        last_travel = self._last_travel
        ratio = float(travel @ last_travel) / max(float(last_travel @ last_travel), MODEL_ERROR**2)
        bounded_ratio = max(-MAX_EXTRAPOLATION, min(ratio, MAX_EXTRAPOLATION))
        self.predicted = self.travel_rates @ travel + bounded_ratio * self._neglected
        return travel, bounded_ratio == ratio

    def roll(
        self, config: Configuration, pressures: Pressures, shifts: Array | float = 0.0
    ) -> HeldGrip | None:
        """
        Return the equilibrium, rolled to a configuration; None if none exists.

        Before that, the k contacts are shifted along their members by all corrections of this
        cache and by further `shifts` (k,) [m].
        """
        inflated = with_pressures(self.grasp, pressures)
        return roll_grip(replace(inflated, anchors=self._anchors + shifts), config)

    def shift(self, shifts: Array) -> None:
        """Shift the contacts along the members by `shifts` (m,) [m], to first order."""
        forces = self.by_shifts[self.grasp.state.places.forces] @ shifts
        self._anchors = self._anchors + shifts[self.grasp.contacts.owners]
        self.outputs = self.outputs + self.rates[:, SHIFTS:] @ shifts / self.scale
        self._pending_forces = self._pending_forces + forces

    def correct_zeros(self, correction: Array, sensitivity: Array) -> None:
        """Correct the roller offsets by (r,) [m], and the shifts by `sensitivity` times that."""
        shifts = (sensitivity[SHIFTS:] @ correction)[self.grasp.contacts.owners]
        self._anchors = self._anchors + self.grasp.statics.anchor_rates @ correction + shifts
        self.zero_corrections = self.zero_corrections + correction
        self.corrections_since_search = self.corrections_since_search + correction
        squeeze_rates = self.by_offsets.outputs[3] + self.rates[3] @ sensitivity
        self.predicted = self.predicted + np.append(np.zeros(3), squeeze_rates @ correction)

    def margin(self) -> float:
        """Return the object's slip margin, with the forces of shifts since the equilibrium [N]."""
        planes = slip_planes(self.grasp.response, self._friction)
        reserves = planes.reserve + planes.rows @ self._pending_forces
        return float((reserves / planes.size).min())

    def learn(self, grasp: HeldGrip, travel: Array, change: Array, elapsed: float) -> None:
        """Update drift and `usage` from the change (4,) of the outputs to the next equilibrium."""
        if grasp.contacts is not self.grasp.contacts:  # a discontinuity
            self.forget_motion(grasp)
            return
        self._last_travel, self._neglected = travel, change - self.travel_rates @ travel
        self.drift = self._neglected / elapsed
        margin_change = grasp.slip_margin(self._friction) - self.margin()
        self.usage = self.usage.learned(grasp, margin_change, travel)
