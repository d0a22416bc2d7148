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
from isotruss_ros.core.estimation.grip_model import attach_model, Pressures
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings
from isotruss_ros.core.holding.held_grip import HoldStatus, NotHeldError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.grip_placing import place_between
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.work_limit import WorkLimitError
from isotruss_ros.core.servo.servo_settings import SqueezeSettings

PRIOR = EstimatorSettings()


class BeliefStart:
    """
    Search for the first equilibrium of a grip, with at most one search in each call.

    If none is near the measured pose, every second call searches for one with the desired squeeze,
    which is then assumed.
    """

    def __init__(self) -> None:
        self._missed = False  # whether the last search near the measured pose found none
        self._assuming = False  # whether the last search assumed an equilibrium
        self._depth = PRIOR.zero_deviation  # depth of the assumed object in the members [m]

    def search(
        self,
        config: Configuration,
        grip: Grip,
        settings: SqueezeSettings,
        gripped: bool,
        pressures: Pressures,
        zero_covariance: Array | None,
    ) -> GripBelief:
        """
        Return the belief that starts near the measured pose, or at an assumed equilibrium.

        Only if the client reports that the object is gripped, an equilibrium may be assumed. For
        pressures and `zero_covariance` see `GripBelief`.

        :raises NotHeldError: this search has not found an equilibrium.
        """
        calibrated = PRIOR.calibrated(config.robot.description, settings.zero_deviation)
        prior = replace(calibrated, load=settings.load or PRIOR.load)
        was_assuming = self._assuming
        self._assuming = gripped and self._missed and not self._assuming  # every second search
        try:
            start = grip
            if self._assuming:  # the same indentation of all members
                shape, angle = grip.body.shape, grip.body.pose.angle
                centered = place_between(config, grip.members, shape, angle, self._depth)
                start = grip.moved_to(centered.body.pose)
            grasp = attach_model(config, start, pressures, prior.zero_deviation)
            force_error = abs(grasp.squeeze - settings.force)
            if self._assuming and force_error > 2.0 * PRIOR.squeeze_error * settings.force:
                # The next search changes the depth in proportion to the squeeze.
                depth = self._depth * settings.force / grasp.squeeze
                self._depth = min(depth, 4.0 * PRIOR.zero_deviation)
                raise NotHeldError(HoldStatus.NO_BALANCE)
            belief = GripBelief.of(grasp, grip, prior, zero_covariance, is_assumed=self._assuming)
            if belief.hold is not HoldStatus.HELD:
                raise NotHeldError(belief.hold)
        except WorkLimitError as error:
            if not error.advances:
                self._missed = True
                raise NotHeldError(HoldStatus.NO_BALANCE) from error
            self._assuming = was_assuming  # the next call repeats this search
            raise NotHeldError(HoldStatus.SEARCHED) from error
        except NotHeldError as error:
            self._missed = error.hold not in (HoldStatus.SLIPS, HoldStatus.OFF_MEMBER)
            raise
        self._missed = False
        return belief
