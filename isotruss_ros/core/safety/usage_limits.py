# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Limits on commands that reduce the slip margin or increase the utilisation.

The gradients of both with respect to roller travel are identified online from past travel (least
mean squares).
"""

from __future__ import annotations

from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Largest decay rates of the distance of the utilisation from its bound, and of the slip margin
#: [1/s].
UTILISATION_RATE, MARGIN_RATE = 5.0, 2.0
#: Regularisation of the normalised least mean squares [m]; shorter travel has less weight.
LMS_REGULARIZATION = 1e-4


class UsageLimits:
    """Limits on a command from the predicted slip margin and utilisation."""

    def __init__(self, grasp: HeldGrip) -> None:
        #: Gradients (2, r) of utilisation and lost slip margin with respect to roller travel.
        self._rates = np.zeros((2, len(grasp.config.roller_positions)))
        self._take(grasp)

    def learn(self, grasp: HeldGrip, margin: float, travel: Array) -> None:
        """Update the gradients from an equilibrium and the change `margin` [N] by travel (r,)."""
        used_before = self._used
        self._take(grasp)
        increases = np.array([self._used - used_before, -margin])
        step = travel / float(travel @ travel + LMS_REGULARIZATION**2)
        self._rates = self._rates + np.outer(increases - self._rates @ travel, step)

    def margin_share(self, command: RollerCommand, period: float, margin: float) -> float:
        """Return the factor (0 to 1) on a command that bounds the loss rate of a margin [N]."""
        return self._share(1, command, period * MARGIN_RATE * margin, period)

    def limit_utilisation(
        self, command: RollerCommand, period: float, bound: float
    ) -> RollerCommand:
        """Return the command, slowed if the utilisation approaches its `bound` too fast."""
        increase = period * UTILISATION_RATE * (bound - self._used)
        share = self._share(0, command, increase, period)
        if share == 1.0:
            return command
        return command.slowed(share, Status.SLOWED_UTILISATION, (self._member,))

    def _share(self, row: int, command: RollerCommand, largest: float, period: float) -> float:
        """Return the factor (0 to 1) on a command that limits a quantity's growth to `largest`."""
        increase = float(self._rates[row] @ (period * command.roller_velocities))
        return 1.0 if increase <= max(largest, 0.0) else max(largest, 0.0) / increase

    def _take(self, grasp: HeldGrip) -> None:
        """Store the largest utilisation of an equilibrium and the name of its member."""
        utilisations = grasp.sections.used
        self._member = f'member {grasp.config.robot.member_names[int(utilisations.argmax())]}'
        # At twice the wrinkling moment a tube folds.
        self._used = min(float(utilisations.max()), 2.0)
