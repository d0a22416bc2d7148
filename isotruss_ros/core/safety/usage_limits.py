# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How quickly commands use up what holds an object: the slip margin, and the moments of its tubes.

What a command will use of them is learned from what the travel of the rollers used so far.
"""

from __future__ import annotations

from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: At this utilisation a tube has folded: more is not told apart.
FOLDED = 2.0
#: Shares that a path uses in a second of what is left to the bound on the utilisation, and of the
#: slip margin [1/s].
UTILISATION_RATE, MARGIN_RATE = 5.0, 2.0
#: Travel of the rollers in a cycle that tells of the change; shorter ones tell less [m].
TELLING = 1e-4


class UsageLimits:
    """
    Slows commands that would use too much of what is left.

    :param grasp: how the object is held at first.
    """

    def __init__(self, grasp: HeldGrip) -> None:
        #: Of utilisation and slip margin, by how much travel uses them, least mean squares.
        self._rates = np.zeros((2, len(grasp.config.roller_positions)))
        self._take(grasp)

    def learn(self, grasp: HeldGrip, margin: float, travel: Array) -> None:
        """
        Take in what the last travel did.

        :param grasp: how the object is held after it.
        :param margin: change of the slip margin that it made [N].
        :param travel: (r,) of the rollers [m].
        """
        used = self._used
        self._take(grasp)
        missed = np.array([self._used - used, -margin]) - self._rates @ travel
        step = travel / float(travel @ travel + TELLING**2)
        self._rates = self._rates + np.outer(missed, step)

    def margin_share(self, command: RollerCommand, period: float, free: float) -> float:
        """
        Return the part of a command's twist that leaves enough of the slip margin, 0 to 1.

        :param command: the command.
        :param period: for which it holds [s].
        :param free: slip margin that may be used up [N].
        """
        return self._share(1, command, period * MARGIN_RATE * free, period)

    def limit_utilisation(
        self, command: RollerCommand, period: float, most: float
    ) -> RollerCommand:
        """
        Return a command, slowed where it would use too much of what is left of the tubes.

        :param command: the command.
        :param period: for which it holds [s].
        :param most: largest utilisation of a tube [-].
        """
        left = period * UTILISATION_RATE * (most - self._used)
        share = self._share(0, command, left, period)
        if share == 1.0:
            return command
        return command.slowed(share, Status.SLOWED_UTILISATION, (self._member,))

    def _share(self, quantity: int, command: RollerCommand, left: float, period: float) -> float:
        """Return the part of a command that uses no more of a quantity than is left."""
        more = float(self._rates[quantity] @ (period * command.roller_velocities))
        return 1.0 if more <= max(left, 0.0) else max(left, 0.0) / more

    def _take(self, grasp: HeldGrip) -> None:
        """Take in which member is nearest to its wrinkling moment, and how near."""
        used = grasp.sections.used
        self._member = f'member {grasp.config.robot.member_names[int(used.argmax())]}'
        self._used = min(float(used.max()), FOLDED)
