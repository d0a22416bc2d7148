# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Last equilibrium of the held object, with the changes of pose and squeeze since then.

- `predicted` is the change by roller travel according to (19), because computing an equilibrium in
  each cycle would take too long.
- `drift` is the rate of the error of (19) in the last motion, because commands that follow from
  (19) must compensate it: the bending that (19) neglects is a tenth of the motion.
- `outputs` contain the linear change by corrections of the contacts, because an estimate must
  contain a measured pose at once, and the next equilibrium follows up to 20 ms later.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

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
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.roll_grip import roll_grip, with_pressures
from isotruss_ros.core.kinematics.configuration import Configuration, MAX_FIRST_ORDER_TRAVEL
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.safety.usage_limits import UsageLimits
import numpy as np


@dataclass(frozen=True, eq=False)
class EquilibriumCache:
    """
    Last equilibrium of a held object without a load, its derivatives, and changes since then.

    :ivar friction: coefficient of friction [-].
    :ivar held: the equilibrium.
    :ivar grip: its contacts, from which (19) predicts the motion of the object.
    :ivar travel_rates: (4, r) derivatives of the outputs by roller travel, by (19).
    :ivar by_shifts: derivatives of its unknowns by the members' shifts, see `shift_rates`.
    :ivar scale: (4,) factors on the outputs in the following derivatives, see `output_scale`.
    :ivar rates: (4, n) derivatives of the outputs by the state.
    :ivar by_offsets: derivatives by roller offsets, at an equilibrium nearby.
    :ivar outputs: (4,) pose [m, m, rad] and squeeze [N] without a load, corrected by poses.
    :ivar predicted: (4,) predicted changes of the outputs by roller travel.
    :ivar anchors: (k,) rolling invariants of the contacts, corrected by poses [m].
    :ivar pending_forces: (2k,) changes of the contact forces by shifts since the equilibrium [N].
    :ivar zero_corrections: (r,) corrections of the roller offsets since the equilibrium [m].
    :ivar corrections_since_search: (r,) the same since the last search for contacts [m].
    :ivar usage: limits on motion that reduces the slip margin or increases the utilisation.
    :ivar drift: error of (19) in the last motion, per time (4,) [m/s, m/s, rad/s, N/s].
    """

    friction: float
    held: HeldGrip
    grip: Grip
    travel_rates: Array
    by_shifts: Array
    scale: Array
    rates: Array
    by_offsets: OffsetRates
    outputs: Array
    predicted: Array
    anchors: Array
    pending_forces: Array
    zero_corrections: Array
    corrections_since_search: Array
    usage: UsageLimits
    drift: Array

    @classmethod
    def of(cls, held: HeldGrip, friction: float) -> EquilibriumCache:
        """Return an equilibrium that a search has found."""
        return cls(
            by_offsets=OffsetRates.of(held),
            corrections_since_search=np.zeros(len(held.config.roller_positions)),
            **_at_equilibrium(held, friction),
            **_at_rest(held),
        )

    def taken(self, held: HeldGrip) -> EquilibriumCache:
        """Return another equilibrium and the derivatives at it, without changes since then."""
        # The derivatives by offsets take longest, so those of an equilibrium nearby are used.
        by_offsets = self.by_offsets
        nearby = by_offsets.held
        travel = held.config.roller_positions - nearby.config.roller_positions
        if nearby.contacts is not held.contacts or np.abs(travel).max() > MAX_FIRST_ORDER_TRAVEL:
            by_offsets = OffsetRates.of(held)
        return replace(self, by_offsets=by_offsets, **_at_equilibrium(held, self.friction))

    def predict(self, config: Configuration) -> tuple[EquilibriumCache, Array]:
        """
        Predict the change of pose and squeeze by roller travel since the equilibrium.

        :return: the equilibrium with the prediction, and the travel (r,) [m].
        """
        start = self.held.config.roller_positions + self.zero_corrections
        travel = config.roller_positions - start
        return replace(self, predicted=self.travel_rates @ travel), travel

    def roll(
        self, config: Configuration, pressures: Pressures, shifts: Array | float = 0.0
    ) -> HeldGrip | None:
        """
        Return the equilibrium, rolled to a configuration; None if none exists.

        Before that, the k contacts are shifted along their members by all corrections since the
        equilibrium and by further `shifts` (k,) [m].
        """
        inflated = with_pressures(self.held, pressures)
        return roll_grip(replace(inflated, anchors=self.anchors + shifts), config)

    def shifted(self, shifts: Array) -> EquilibriumCache:
        """Return the equilibrium with contacts shifted along members (m,) [m], to first order."""
        forces = self.by_shifts[self.held.state.places.forces] @ shifts
        return replace(
            self,
            anchors=self.anchors + shifts[self.held.contacts.owners],
            outputs=self.outputs + self.rates[:, SHIFTS:] @ shifts / self.scale,
            pending_forces=self.pending_forces + forces,
        )

    def corrected(self, correction: Array, sensitivity: Array) -> EquilibriumCache:
        """Return the equilibrium after a correction (r,) of offsets, which shifts contacts [m]."""
        shifts = (sensitivity[SHIFTS:] @ correction)[self.held.contacts.owners]
        by_statics = self.held.statics.anchor_rates @ correction
        squeeze_rates = self.by_offsets.outputs[3] + self.rates[3] @ sensitivity
        return replace(
            self,
            anchors=self.anchors + by_statics + shifts,
            zero_corrections=self.zero_corrections + correction,
            corrections_since_search=self.corrections_since_search + correction,
            predicted=self.predicted + np.append(np.zeros(3), squeeze_rates @ correction),
        )

    def margin(self) -> float:
        """Return the object's slip margin, with the forces of shifts since the equilibrium [N]."""
        planes = slip_planes(self.held.response, self.friction)
        reserves = planes.reserve + planes.rows @ self.pending_forces
        return float((reserves / planes.size).min())

    def learned(
        self, held: HeldGrip, travel: Array, change: Array, elapsed: float
    ) -> EquilibriumCache:
        """Return drift and `usage` learned from the change (4,) of the outputs to the next one."""
        if held.contacts is not self.held.contacts:  # a discontinuity
            return replace(self, **_at_rest(held))
        neglected = change - self.travel_rates @ travel
        margin_change = held.slip_margin(self.friction) - self.margin()
        return replace(
            self,
            drift=neglected / elapsed,
            usage=self.usage.learned(held, margin_change, travel),
        )


def _at_equilibrium(held: HeldGrip, friction: float) -> dict[str, Any]:
    """Return the fields that an equilibrium determines, without changes since then."""
    # The fourth row is the opening rate of the grip, on which the squeeze depends.
    grip, by_shifts = measure_gaps(held, friction), shift_rates(held)
    travel_rates = grip_jacobian(held.config, grip)[:4].copy()
    travel_rates[3] *= held.squeeze_stiffness()
    return {
        'friction': friction,
        'held': held,
        'grip': grip,
        'travel_rates': travel_rates,
        'by_shifts': by_shifts,
        'scale': output_scale(held),
        'rates': state_rates(held, by_shifts),
        'outputs': np.append(held.pose, held.squeeze),
        'predicted': np.zeros(4),
        'anchors': held.anchors,
        'pending_forces': np.zeros(2 * len(held.anchors)),
        'zero_corrections': np.zeros(len(held.config.roller_positions)),
    }


def _at_rest(held: HeldGrip) -> dict[str, Any]:
    """Return the fields that follow from the last motion, without a motion."""
    return {
        'usage': UsageLimits.of(held),
        'drift': np.zeros(4),
    }
