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

from dataclasses import dataclass, replace

from isotruss_ros.core.errors import IsotrussError
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


@dataclass(frozen=True)
class BeliefStart:
    """
    Search for the first equilibrium of a grip, with at most one search in each call.

    If none is near the measured pose, every second call searches for one with the desired squeeze,
    which is then assumed.

    :ivar missed: whether the last search near the measured pose found none.
    :ivar assuming: whether the last search assumed an equilibrium.
    :ivar depth: depth of the assumed object in the members [m].
    """

    missed: bool = False
    assuming: bool = False
    depth: float = PRIOR.zero_deviation

    def searched(
        self,
        config: Configuration,
        grip: Grip,
        settings: SqueezeSettings,
        gripped: bool,
        pressures: Pressures,
        zero_covariance: Array | None,
    ) -> tuple[BeliefStart, GripBelief | IsotrussError]:
        """
        Return the belief that starts near the measured pose, or at an assumed equilibrium.

        Only if the client reports that the object is gripped, an equilibrium may be assumed. For
        pressures and `zero_covariance` see `GripBelief`.

        :return: the search for the next call, and the belief, or the error without one: a
            `NotHeldError` if this search has not found an equilibrium.
        """
        # Every second search assumes an equilibrium.
        start = replace(self, assuming=gripped and self.missed and not self.assuming)
        calibrated = PRIOR.calibrated(config.robot.description, settings.zero_deviation)
        prior = replace(calibrated, load=settings.load or PRIOR.load)
        try:
            place = grip
            if start.assuming:  # the same indentation of all members
                shape, angle = grip.body.shape, grip.body.pose.angle
                centered = place_between(config, grip.members, shape, angle, self.depth)
                place = grip.moved_to(centered.body.pose)
            held = attach_model(config, place, pressures, prior.zero_deviation)
            force_error = abs(held.squeeze - settings.force)
            if start.assuming and force_error > 2.0 * PRIOR.squeeze_error * settings.force:
                # The next search changes the depth in proportion to the squeeze.
                depth = self.depth * settings.force / held.squeeze
                start = replace(start, depth=min(depth, 4.0 * PRIOR.zero_deviation))
                raise NotHeldError(HoldStatus.NO_BALANCE)
            belief = GripBelief.of(held, grip, prior, zero_covariance, is_assumed=start.assuming)
            if belief.hold is not HoldStatus.HELD:
                raise NotHeldError(belief.hold)
        except WorkLimitError as error:
            if error.advances:  # the next call repeats this search
                return self, NotHeldError(HoldStatus.SEARCHED)
            return replace(start, missed=True), NotHeldError(HoldStatus.NO_BALANCE)
        except NotHeldError as error:
            missed = error.hold not in (HoldStatus.SLIPS, HoldStatus.OFF_MEMBER)
            return replace(start, missed=missed), error
        except IsotrussError as error:
            return start, error
        return replace(start, missed=False), belief
