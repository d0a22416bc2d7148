# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the squeeze is to be, and how it is corrected where an estimate of it is at hand."""

from __future__ import annotations

from dataclasses import dataclass
import math

from isotruss_ros.core.control.state_estimate import EstimatedTravel

#: The target moves by the difference to an estimated squeeze, behind this low-pass [s], ...
TRIM_TIME = 0.5
#: ... where its deviation is no larger share of the target than this.
TRUSTED = 0.2


@dataclass(frozen=True)
class SqueezeSettings:
    """
    What the squeeze is to be, and how quickly it gets there.

    :ivar force: mean normal force of the grasping members, positive [N].
    :ivar pose_gain: the user's own gain of the pose, from which the others follow; None for that
        of the frequency, see `choose_gain` [1/s].
    :ivar force_gain: accept a gain beyond the limit.
    :ivar frequency: lowest natural frequency of the held object, measured; None to compute it from
        the masses [rad/s].
    :ivar max_utilisation: of the moment at which tubes wrinkle; commands that lead toward it are
        slowed, and beyond it only those that lead away are carried out [-].
    :ivar load: size of the loads on the object that are expected, see `LoadEstimate` [N].
    """

    force: float
    pose_gain: float | None = None
    force_gain: bool = False
    frequency: float | None = None
    max_utilisation: float = 1.0
    load: float = 0.0


class SqueezeTrim:
    """
    By how much the model is to squeeze more, for the robot to squeeze as is wanted.

    :ivar force: more [N].
    :ivar estimate: of the robot's squeeze; None without a fresh one.
    """

    def __init__(self) -> None:
        self.force = 0.0
        self.estimate: EstimatedTravel | None = None

    def follow(self, modelled: float, wanted: float, elapsed: float) -> None:
        """
        Come nearer to what the model has more of the squeeze than the estimate.

        :param modelled: squeeze of the model [N].
        :param wanted: that of the robot [N].
        :param elapsed: since the last call [s].
        """
        estimate = self.estimate
        if estimate is None or not estimate.squeeze_deviation <= TRUSTED * wanted:
            return
        passed = -math.expm1(-elapsed / TRIM_TIME)
        self.force += passed * (modelled - estimate.squeeze - self.force)

    def tell(self, modelled: float) -> tuple[float, float]:
        """
        Return the squeeze of the robot and its standard deviation, inf if not known [N].

        :param modelled: squeeze of the model [N].
        """
        if self.estimate is None or math.isnan(self.estimate.squeeze):
            return modelled - self.force, math.inf
        return self.estimate.squeeze, self.estimate.squeeze_deviation

    def note(self) -> str:
        """Return how the squeeze is regulated where the estimate has ended; empty else."""
        if self.estimate is None and self.force:
            return f'no fresh state estimate: the squeeze keeps its correction {self.force:+.1f} N'
        return ''
