# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracking of a grip: belief of the held object, and the measurements that it has used."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from isotruss_ros.core.errors import ConfigurationError, GraspError, StructureError
from isotruss_ros.core.estimation.grip_belief import GripBelief, Readings
from isotruss_ros.core.estimation.grip_model import Pressures
from isotruss_ros.core.holding.grip_record import GripEstimate
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus
from isotruss_ros.core.inputs import StampedInput, steady_pressures, UsedReadings
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.numerics.arrays import Array
import numpy as np


@dataclass(frozen=True, eq=False)
class GripTracker:
    """
    Belief of a grip, which rolls with the robot and is corrected by measured poses.

    :ivar belief: belief of the grip; None without a held object.
    :ivar lost: hold status with which the previous belief ended; None if it was discarded.
    :ivar pressures: gauge pressures of the tubes in the model.
    :ivar offsets: (r,) roller offsets in the equilibrium [m]; None before the first ones.
    :ivar offset_covariance: (r, r) covariance of the offsets [m^2]; None: that of the settings.
    :ivar readings: used poses and estimates of the offsets.
    """

    belief: GripBelief | None = None
    lost: HoldStatus | None = None
    pressures: Pressures = None
    offsets: Array | float | None = None
    offset_covariance: Array | None = None
    readings: UsedReadings = field(default_factory=UsedReadings)

    def discarded(self) -> GripTracker:
        """Return the tracker without a belief; a new measured pose starts the next one."""
        return replace(self, belief=None, lost=None)

    def started(self, belief: GripBelief) -> GripTracker:
        """Return the tracker with a belief that starts."""
        return replace(self, belief=belief, lost=None)

    def with_pressures(self, pressures: Pressures) -> GripTracker:
        """Return the tracker with measured gauge pressures [Pa], see `steady_pressures`."""
        return replace(self, pressures=steady_pressures(self.pressures, pressures))

    def with_offsets(
        self, offsets: Array | float, covariance: Array | None, stamp: float
    ) -> GripTracker:
        """Return the tracker with roller offsets (r,) [m]; their covariance has a `stamp` [s]."""
        readings, belief = self.readings, self.belief
        if belief is not None and covariance is not None:
            readings, is_new = readings.use('estimate', stamp, covariance)
            if is_new:
                belief = belief.with_offset_covariance(covariance)
        before = offsets if self.offsets is None else self.offsets
        if belief is not None and not np.array_equal(offsets, before):
            belief = belief.with_zeros_corrected(offsets - before)
        return replace(
            self,
            belief=belief,
            offsets=offsets,
            offset_covariance=covariance,
            readings=readings,
        )

    def followed(
        self, config: Configuration, elapsed: float, rollers: Readings = None
    ) -> tuple[GripTracker, HoldStatus]:
        """Return the tracker in a configuration, and the hold status; see `GripBelief`."""
        belief, hold = self.belief.followed(config, elapsed, self.pressures, rollers)
        if hold is not HoldStatus.HELD:
            return replace(self, belief=None, lost=hold), hold
        return replace(self, belief=belief), hold

    @property
    def held(self) -> HeldGrip:
        """Return the equilibrium in the current configuration."""
        return self.belief.held

    @property
    def estimate(self) -> GripEstimate:
        """Return the estimates of pose, squeeze and delay."""
        return self.belief.estimate

    def rolled(self, travel: Array, elapsed: float, pressures: Pressures) -> GripTracker:
        """Return the tracker at measured travel (r,) [m]; it has no belief of a lost object."""
        tracker = self.with_pressures(pressures)
        if self.belief is None or elapsed == 0.0:
            return tracker
        try:
            return tracker.followed(self.held.config.moved_to(travel), elapsed)[0]
        except (ConfigurationError, GraspError, StructureError):
            return tracker.discarded()

    def linearised(self) -> GripTracker:
        """Return the tracker, which has the derivatives at its equilibrium."""
        return self

    def corrected(self, correction: Array, covariance: Array) -> GripTracker:
        """Return the tracker after a correction (r,) of the roller offsets [m]."""
        if self.belief is None:
            return self
        belief = self.belief.with_zeros_corrected(correction)
        return replace(self, belief=belief.with_offset_covariance(covariance))

    def observed(self, pose: StampedInput, age: float) -> tuple[GripTracker, bool]:
        """Return the tracker after a measured pose of an age [s], and whether the pose is new."""
        readings, is_new = self.readings.use('pose', pose.time, pose.value)
        if not is_new:
            return self, False
        return replace(self, belief=self.belief.observed(pose.value, age), readings=readings), True
