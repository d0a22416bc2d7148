# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Last equilibrium of the held object, with the changes of pose and squeeze since then.

- `predicted` is the change by roller travel to first order, because computing an equilibrium in
  each cycle would take too long. The next one is due if the error of the prediction may exceed a
  bound, see `is_next_due`.
- `drift` is the rate of the part of this change that (19) neglects, because commands that follow
  from (19) must compensate it: the bending that (19) neglects is up to a tenth of the motion.
- `outputs` contain the linear change by corrections of the contacts, because an estimate must
  contain a measured pose at once, and the next equilibrium follows later.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property
import math
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
from isotruss_ros.core.numerics.frozen import replace
from isotruss_ros.core.safety.usage_limits import UsageLimits
import numpy as np

#: Largest errors of the prediction of pose [m] and squeeze [N] between two equilibria.
MAX_ERRORS = np.array([5e-5, 0.1])
#: Bounds on the errors of pose [1/m] and squeeze [N/m^2] per square of the norm of the travel. In
#: 200 random motions of 40 random discs and boxes by 3 mm they were at most 1.9 and 3,730 (median
#: 0.8 and 13 for discs, 0.7 and 32 for boxes).
CURVATURES = np.array([2.0, 4e3])
#: Error of the linear change by shifts of the contacts, relative to this change [-]. In 79 random
#: shifts of the same objects by 0.3 mm it was at most 0.028.
SHIFT_SHARE = 0.03
#: Largest change of a corner's gap per norm of the travel [-]; at most 0.57 in 48 random motions.
GAP_RATE = 0.6
#: Largest error of the gap of a corner relative to it, which bounds the speed of landing [-].
GAP_SHARE = 0.05
#: Slip margin relative to the squeeze below which each motion needs an equilibrium [-]. At 213
#: equilibria of 8 carries with faults the margin was less than predicted, by at most 0.008 of the
#: squeeze in 99 %, and by 0.15 once.
NEAR_SLIP_SHARE = 0.05


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
    :ivar by_offsets: derivatives by roller offsets and travel, also at an equilibrium nearby.
    :ivar outputs: (4,) pose [m, m, rad] and squeeze [N] without a load, corrected by poses.
    :ivar predicted: (4,) predicted changes of the outputs by roller travel.
    :ivar anchors: (k,) rolling invariants of the contacts, corrected by poses [m].
    :ivar pending_forces: (2k,) changes of the contact forces by shifts since the equilibrium [N].
    :ivar zero_corrections: (r,) corrections of the roller offsets since the equilibrium [m].
    :ivar corrections_since_search: (r,) the same since the last search for contacts [m].
    :ivar usage: limits on motion that reduces the slip margin or increases the utilisation.
    :ivar travel: (r,) roller travel since the equilibrium [m].
    :ivar drift: present rate (4,) of the changes that (19) neglects [m/s, m/s, rad/s, N/s].
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
    travel: Array
    drift: Array

    @classmethod
    def of(cls, held: HeldGrip, friction: float) -> EquilibriumCache:
        """Return an equilibrium that a search has found."""
        return cls(
            by_offsets=OffsetRates.of(held),
            corrections_since_search=np.zeros(len(held.config.roller_positions)),
            usage=UsageLimits.of(held),
            drift=np.zeros(4),
            **_at_equilibrium(held, friction),
        )

    def taken(self, held: HeldGrip) -> EquilibriumCache:
        """Return another equilibrium and the derivatives at it, without changes since then."""
        # Those by offsets take longest, so they follow in a later cycle.
        nearby = self.by_offsets.held
        travel = held.config.roller_positions - nearby.config.roller_positions
        is_near = self.has_own_rates or np.abs(travel).max() <= MAX_FIRST_ORDER_TRAVEL
        can_wait = is_near and nearby.contacts is held.contacts
        at_equilibrium = _at_equilibrium(held, self.friction)
        cache = replace(self, usage=self.usage.at(held), **at_equilibrium)
        return cache if can_wait else cache.with_own_rates()

    @property
    def has_own_rates(self) -> bool:
        """Return whether the derivatives by offsets are those at this equilibrium."""
        return self.by_offsets.held is self.held

    def with_own_rates(self) -> EquilibriumCache:
        """Return the equilibrium with the derivatives by offsets at it."""
        return replace(self, by_offsets=OffsetRates.of(self.held))

    def motion(self, travel: Array) -> Array:
        """Return the change (4,) of the outputs by roller travel (r,) [m], to first order."""
        return self.by_offsets.by_travel @ travel / self.scale

    def predict(self, config: Configuration, elapsed: float) -> tuple[EquilibriumCache, Array]:
        """
        Predict the change of pose and squeeze by roller travel since the equilibrium.

        :param elapsed: time since the last prediction [s].
        :return: the equilibrium with the prediction, and the travel (r,) in this time [m].
        """
        start = self.held.config.roller_positions + self.zero_corrections
        travel = config.roller_positions - start
        step, drift = travel - self.travel, self.drift
        if elapsed > 0.0:
            drift = (self.motion(step) - self.travel_rates @ step) / elapsed
        usage, predicted = self.usage.rolled(step), self.motion(travel)
        return replace(self, predicted=predicted, travel=travel, usage=usage, drift=drift), step

    def is_next_due(self, pressures: Pressures, margin: float) -> bool:
        """
        Return whether errors of the prediction may exceed `MAX_ERRORS`, or have no bound.

        For the slip `margin` [N] see `GripBelief.slip_margin`.
        """
        if self.zero_corrections.any() or pressures not in (None, self.held.pressures):
            return True
        travel = float(np.linalg.norm(self.travel))
        is_near_slip = margin < NEAR_SLIP_SHARE * self.held.squeeze
        width = min((gap.width for gap in self.grip.gaps), default=math.inf)
        is_gap_unknown = GAP_RATE * travel > max(MAX_ERRORS[0], GAP_SHARE * width)
        if is_gap_unknown or (travel > 0.0 and is_near_slip):
            return True
        by_shifts = self.scale * (self.outputs - np.append(self.held.pose, self.held.squeeze))
        sizes = np.array([np.linalg.norm(by_shifts[:3]), abs(by_shifts[3])])
        errors = CURVATURES * travel**2 + SHIFT_SHARE * sizes
        return bool((errors > MAX_ERRORS).any())

    def roll(
        self, config: Configuration, pressures: Pressures, shifts: Array | float = 0.0
    ) -> HeldGrip | None:
        """
        Return the equilibrium, rolled to a configuration; None if none exists.

        Before that, the k contacts are shifted along their members by all corrections since the
        equilibrium and by further `shifts` (k,) [m].
        """
        inflated = with_pressures(self.held, pressures)
        return roll_grip(dataclasses.replace(inflated, anchors=self.anchors + shifts), config)

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

    @cached_property
    def margin(self) -> float:
        """Return the slip margin, with shifts and predicted travel since the equilibrium [N]."""
        planes = slip_planes(self.held.response, self.friction)
        reserves = planes.reserve + planes.rows @ self.pending_forces
        return float((reserves / planes.size).min()) - float(self.usage.rates[1] @ self.travel)

    def learned(self, held: HeldGrip) -> EquilibriumCache:
        """Return the equilibrium with `usage` that is learned from the next one."""
        if held.contacts is not self.held.contacts:  # a discontinuity
            return replace(self, usage=UsageLimits.of(held), drift=np.zeros(4))
        margin_error = held.slip_margin(self.friction) - self.margin
        return replace(self, usage=self.usage.learned(held, margin_error, self.travel))


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
        'travel': np.zeros(len(held.config.roller_positions)),
    }
