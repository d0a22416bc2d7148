# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
First equilibrium of a grip, from which the estimation of its state starts.

It is the equilibrium near the measured pose, if load and errors of roller offsets and measurement
explain its distance from this pose. With wrong roller offsets there may be no such equilibrium.
Then, if the client reports that the object is gripped, an equilibrium with the desired squeeze is
assumed instead, and the squeeze gets the large standard deviation of an unknown value.
"""

from __future__ import annotations

from dataclasses import replace

from isotruss_ros.core.estimation.grip_belief import GripBelief
from isotruss_ros.core.estimation.grip_model import attach_model, MAX_UTILISATION
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings
from isotruss_ros.core.holding.held_grip import HeldGrip, HoldStatus, NotHeldError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.grip_placing import place_between
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.servo.servo_settings import SqueezeSettings

PRIOR = EstimatorSettings()


class BeliefStart:
    """
    Search for the first equilibrium of a grip, with at most one search in each call.

    If none is near the measured pose, every second call searches for one with the desired squeeze,
    which is then assumed.

    :ivar belief: estimated state of the grip after the last call; None without an equilibrium.
    """

    def __init__(self) -> None:
        self.belief: GripBelief | None = None
        self._missed = False  # no equilibrium near the measured pose
        self._assuming = False  # assuming an equilibrium
        self._depth = PRIOR.zero_deviation  # depth of the assumed object in the members [m]

    def search(
        self,
        config: Configuration,
        grip: Grip,
        settings: SqueezeSettings,
        gripped: bool,
        pressures: tuple[float, ...] | None,
        zero_covariance: Array | None,
    ) -> HoldStatus:
        """
        Search for an equilibrium near the measured pose, or assume one; return the hold status.

        Only if the client reports that the object is gripped, an equilibrium may be assumed. For
        pressures and `zero_covariance` see `GripBelief`.
        """
        self.belief, description = None, config.robot.description
        prior = PRIOR.calibrated(description, settings.zero_deviation)
        prior = replace(prior, load=settings.load or PRIOR.load)
        self._assuming = gripped and self._missed and not self._assuming
        try:
            placed, body = grip, grip.body
            if self._assuming:  # all members have the same indentation
                shape, angle = body.shape, body.pose.angle
                between = place_between(config, grip.members, shape, angle, self._depth)
                placed = grip.moved_to(between.body.pose)
            equilibrium = attach_model(config, placed, pressures, prior.zero_deviation)
        except NotHeldError as error:
            self._missed = True
            return error.hold
        if self._assuming and not self._is_desired(equilibrium, settings.force):
            return HoldStatus.NO_BALANCE
        if not self._assuming and equilibrium.sections.used.max() > MAX_UTILISATION:
            self._missed = True
            return HoldStatus.WRINKLES
        belief = GripBelief(equilibrium, grip, prior, zero_covariance, is_assumed=self._assuming)
        hold = belief.grasp.hold(belief.largest_friction)
        if hold is HoldStatus.HELD and not belief.state.explains(body.pose, belief.cache):
            hold = HoldStatus.FAR
        self._missed = hold in (HoldStatus.NO_CONTACT, HoldStatus.FAR)
        if hold is HoldStatus.HELD:
            self.belief = belief
        return hold

    def _is_desired(self, equilibrium: HeldGrip, force: float) -> bool:
        """Return whether an assumed grip has the desired squeeze; if not, correct the depth."""
        squeeze = equilibrium.squeeze
        if abs(squeeze - force) <= 2.0 * PRIOR.squeeze_error * force:
            return True
        self._depth = min(self._depth * force / squeeze, 4.0 * PRIOR.zero_deviation)
        return False
