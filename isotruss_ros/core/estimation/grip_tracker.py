# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Tracking of a grip: search for its first equilibrium, belief, and used measurements.

The first equilibrium is that near the measured pose, if load and errors of roller offsets and
measurement explain its distance from this pose. With wrong roller offsets there may be no such
equilibrium. Then, if a client reports that the object is gripped, an equilibrium with the desired
squeeze is assumed instead, and the squeeze gets the large standard deviation of an unknown value.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.estimation.equilibrium_cache import attach_model, Pressures
from isotruss_ros.core.estimation.grip_belief import GripBelief, PRIOR_DEVIATIONS, Readings
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings
from isotruss_ros.core.holding.held_grip import HoldStatus, NotHeldError
from isotruss_ros.core.inputs import StampedInput, steady_pressures, UsedReadings
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.grip_placing import place_between
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.records import replace
from isotruss_ros.core.numerics.work_limit import WorkLimitError
import numpy as np

PRIOR = EstimatorSettings()


@dataclass(frozen=True, eq=False)
class GripTracker:
    """
    Belief of a grip, which rolls with the robot and is corrected by measured poses.

    :ivar belief: belief of the grip; None without a held object.
    :ivar lost: hold status with which the previous belief ended; None if it was discarded.
    :ivar missed: whether the last search near a measured pose found no equilibrium.
    :ivar assuming: whether the last search assumed an equilibrium.
    :ivar depth: depth of the assumed object in the members [m].
    :ivar pressures: gauge pressures of the tubes in the model.
    :ivar offsets: (r,) roller offsets in the equilibrium [m]; None before the first ones.
    :ivar offset_covariance: (r, r) covariance of the offsets [m^2]; None: that of the settings.
    :ivar readings: used poses and estimates of the offsets.
    """

    belief: GripBelief | None = None
    lost: HoldStatus | None = None
    missed: bool = False
    assuming: bool = False
    depth: float = PRIOR.zero_deviation
    pressures: Pressures = None
    offsets: Array | float | None = None
    offset_covariance: Array | None = None
    readings: UsedReadings = field(default_factory=UsedReadings)

    def discarded(self) -> GripTracker:
        """Return the tracker without a belief; a new measured pose starts the next one."""
        return GripTracker(
            pressures=self.pressures,
            offsets=self.offsets,
            offset_covariance=self.offset_covariance,
            readings=self.readings,
        )

    def with_pressures(self, pressures: Pressures) -> GripTracker:
        """Return the tracker with measured gauge pressures [Pa], see `steady_pressures`."""
        steady = steady_pressures(self.pressures, pressures)
        return self if steady is self.pressures else replace(self, pressures=steady)

    def with_offsets(
        self, offsets: Array | float, covariance: Array | None, stamp: float | None = None
    ) -> GripTracker:
        """
        Return the tracker with roller offsets (r,) [m].

        :param covariance: (r, r) covariance of the offsets [m^2]; None if it is unknown.
        :param stamp: time of the covariance, which may be a repeated one [s]; None: it is new.
        """
        readings, belief = self.readings, self.belief
        if belief is not None and covariance is not None:
            is_new = True
            if stamp is not None:
                readings, is_new = readings.use('estimate', stamp, covariance)
            if is_new:
                belief = replace(belief, state=replace(belief.state, prior=covariance))
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

    def searched(
        self,
        config: Configuration,
        grip: Grip,
        prior: EstimatorSettings,
        noise: Array = PRIOR_DEVIATIONS,
        force: float | None = None,
    ) -> tuple[GripTracker, HoldStatus | IsotrussError]:
        """
        Return the tracker after one search for a first equilibrium.

        If none is near the measured pose, every second call searches for one with the desired
        squeeze, which is then assumed.

        :param grip: grip with the measured pose.
        :param prior: standard deviations of the belief.
        :param noise: (3,) prior standard deviations of the measured poses [m, rad].
        :param force: desired squeeze [N]; None: no equilibrium is assumed.
        :return: the tracker, and the hold status, or an error of the search. The belief starts if
            the object is held.
        """
        assuming = force is not None and self.missed and not self.assuming
        tracker = replace(self, assuming=assuming)
        try:
            place = grip
            if assuming:  # the same indentation of all members
                shape, angle = grip.body.shape, grip.body.pose.angle
                centered = place_between(config, grip.members, shape, angle, self.depth)
                place = grip.moved_to(centered.body.pose)
            held = attach_model(config, place, self.pressures, prior.zero_deviation)
            if assuming and abs(held.squeeze - force) > 2.0 * PRIOR.squeeze_error * force:
                # The next search changes the depth in proportion to the squeeze.
                depth = min(self.depth * force / held.squeeze, 4.0 * PRIOR.zero_deviation)
                tracker = replace(tracker, depth=depth)
                raise NotHeldError(HoldStatus.NO_BALANCE)
            belief = GripBelief.of(held, grip, prior, self.offset_covariance, noise, assuming)
            if belief.hold is not HoldStatus.HELD:
                raise NotHeldError(belief.hold)
        except WorkLimitError as error:
            if error.advances:  # the next call repeats this search
                return self, HoldStatus.SEARCHED
            return replace(tracker, missed=True, lost=None), HoldStatus.NO_BALANCE
        except NotHeldError as error:
            missed = error.hold not in (HoldStatus.SLIPS, HoldStatus.OFF_MEMBER)
            return replace(tracker, missed=missed, lost=None), error.hold
        except IsotrussError as error:
            return tracker, error
        return replace(tracker, belief=belief, missed=False, lost=None), HoldStatus.HELD

    def followed(
        self, config: Configuration, elapsed: float, rollers: Readings = None
    ) -> tuple[GripTracker, HoldStatus]:
        """Return the tracker in a configuration, and the hold status; see `GripBelief`."""
        belief, hold = self.belief.followed(config, elapsed, self.pressures, rollers)
        if hold is not HoldStatus.HELD:
            return replace(self, belief=None, lost=hold), hold
        return replace(self, belief=belief), hold

    def observed(self, pose: StampedInput, age: float) -> tuple[GripTracker, bool]:
        """Return the tracker after a measured pose of an age [s], and whether the pose is new."""
        readings, is_new = self.readings.use('pose', pose.time, pose.value)
        if not is_new:
            return self, False
        belief = None if self.belief is None else self.belief.observed(pose.value, age)
        return replace(self, belief=belief, readings=readings), True
