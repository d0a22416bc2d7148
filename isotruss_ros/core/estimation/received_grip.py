# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Grip that a control loop tracks and has sent, with derivatives at an equilibrium nearby."""

from __future__ import annotations

from dataclasses import dataclass, replace

from isotruss_ros.core.estimation.grip_belief import GripBelief
from isotruss_ros.core.estimation.grip_model import Pressures
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings
from isotruss_ros.core.holding.grip_record import GripEstimate, GripRecord
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.numerics.arrays import Array


@dataclass(frozen=True, eq=False)
class ReceivedGrip:
    """
    Grip that another process tracks, in the place of a `GripTracker`.

    :ivar record: the received grip with its estimate, which is not solved for again.
    :ivar held: its equilibrium.
    :ivar belief: belief at an equilibrium nearby, for derivatives only.
    """

    record: GripRecord
    held: HeldGrip
    belief: GripBelief

    @classmethod
    def of(
        cls,
        record: GripRecord,
        config: Configuration,
        grip: Grip,
        settings: EstimatorSettings,
        covariance: Array,
    ) -> ReceivedGrip:
        """
        Return a received grip, given a near configuration.

        :param covariance: (r, r) covariance of the roller offsets [m^2].
        :raises GraspError: the object has no such corners.
        :raises StructureError: the tubes are those of another structure.
        """
        held = record.restore(config, grip.body)
        start = grip.moved_to(held.pose)
        belief = GripBelief.of(held, start, settings, covariance, is_assumed=True)
        return cls(record, held, belief)

    def updated(self, record: GripRecord, config: Configuration) -> ReceivedGrip:
        """Return the next received grip of the same object."""
        held = record.restore(config, self.belief.start_grip.body)
        return replace(self, record=record, held=held)

    @property
    def estimate(self) -> GripEstimate | None:
        """Return the received estimates of pose, squeeze and delay."""
        return self.record.estimate

    def rolled(self, travel: Array, elapsed: float, pressures: Pressures) -> ReceivedGrip:
        """Return the received grip, which rolls in the control loop only."""
        return self

    def linearised(self) -> ReceivedGrip:
        """Return the grip with derivatives at the received equilibrium."""
        return replace(self, belief=self.belief.taken(self.held))

    def corrected(self, correction: Array, covariance: Array) -> ReceivedGrip:
        """Return the grip for other roller offsets, of which it has the covariance (r, r)."""
        return replace(self, belief=self.belief.with_offset_covariance(covariance))
