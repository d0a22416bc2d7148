# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Limits on commands that reduce the slip margin or increase the utilisation.

The gradients of both with respect to roller travel are identified online from past travel (least
mean squares).
"""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.records import replace
import numpy as np

#: Largest decay rates of the distance of the utilisation from its bound, and of the slip margin
#: [1/s].
UTILISATION_RATE, MARGIN_RATE = 5.0, 2.0
#: Regularisation of the normalised least mean squares [m]; shorter travel has less weight.
LMS_REGULARIZATION = 1e-4


@dataclass(frozen=True, eq=False)
class UsageLimits:
    """
    Limits on a command from the predicted slip margin and utilisation.

    :ivar used: largest utilisation, predicted from the last equilibrium [-].
    :ivar member: text that names its member.
    :ivar rates: gradients (2, r) of utilisation and lost slip margin with respect to roller
        travel.
    """

    used: float
    member: str
    rates: Array

    @classmethod
    def of(cls, held: HeldGrip) -> UsageLimits:
        """Return the limits at an equilibrium, with gradients of zero."""
        utilisations = held.sections.used
        member = held.config.robot.member_names[int(utilisations.argmax())]
        rates = np.zeros((2, len(held.config.roller_positions)))
        # At twice the wrinkling moment a tube folds.
        return cls(min(float(utilisations.max()), 2.0), f'member {member}', rates)

    def rolled(self, travel: Array) -> UsageLimits:
        """Return the limits with the utilisation predicted after roller travel (r,) [m]."""
        return replace(self, used=self.used + float(self.rates[0] @ travel))

    def at(self, held: HeldGrip) -> UsageLimits:
        """Return the limits at another equilibrium, with these gradients."""
        return replace(UsageLimits.of(held), rates=self.rates)

    def learned(self, held: HeldGrip, margin_error: float, travel: Array) -> UsageLimits:
        """
        Return the limits at an equilibrium after travel (r,) [m].

        :param margin_error: slip margin there, minus that predicted after this travel [N].
        """
        learned = self.at(held)
        errors = np.array([learned.used - self.used, -margin_error])
        step = travel / float(travel @ travel + LMS_REGULARIZATION**2)
        return replace(learned, rates=learned.rates + np.outer(errors, step))

    def margin_share(self, command: RollerCommand, period: float, margin: float) -> float:
        """Return the factor (0 to 1) on a command that bounds the loss rate of a margin [N]."""
        return self._share(1, command, period * MARGIN_RATE * margin, period)

    def limit_utilisation(
        self, command: RollerCommand, period: float, bound: float
    ) -> RollerCommand:
        """Return the command, slowed if the utilisation approaches its `bound` too fast."""
        increase = period * UTILISATION_RATE * (bound - self.used)
        share = self._share(0, command, increase, period)
        if share == 1.0:
            return command
        return command.slowed(share, Status.SLOWED_UTILISATION, (self.member,))

    def _share(self, row: int, command: RollerCommand, largest: float, period: float) -> float:
        """Return the factor (0 to 1) on a command that limits a quantity's growth to `largest`."""
        increase = float(self.rates[row] @ (period * command.roller_velocities))
        return 1.0 if increase <= max(largest, 0.0) else max(largest, 0.0) / increase
