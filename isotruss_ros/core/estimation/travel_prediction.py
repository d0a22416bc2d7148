# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Change of an equilibrium by roller travel, to second order along the last travel."""

from __future__ import annotations

from dataclasses import dataclass
import math

from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.frozen import replace
import numpy as np

#: Travel between two equilibria below which their difference gives no derivatives [m]: unknowns
#: with errors of 0.1 um then have derivatives with errors of 0.1 %.
MIN_SECANT_TRAVEL = 2e-4


@dataclass(frozen=True, eq=False)
class TravelPrediction:
    """
    Prediction of the n unknowns of an equilibrium by the travel of r rollers since then.

    The derivatives at the equilibrium take long to compute. So they are those at an equilibrium
    nearby, and along the travel between two equilibria they are the secant, which holds halfway.
    The difference of two secants gives the second derivatives along the travel.

    :ivar rates: (n, r) derivatives by roller travel.
    :ivar direction: (r,) unit vector of the last travel between two equilibria.
    :ivar behind: travel in this direction from where the rates hold to the equilibrium [m].
    :ivar curvature: (n,) second derivatives in this direction.
    """

    rates: Array
    direction: Array
    behind: float
    curvature: Array

    @classmethod
    def of(cls, rates: Array) -> TravelPrediction:
        """Return the prediction of first order by the rates (n, r) at the equilibrium."""
        return cls(rates, np.zeros(rates.shape[1]), 0.0, np.zeros(len(rates)))

    def with_rates(self, rates: Array) -> TravelPrediction:
        """Return the prediction with the rates (n, r) at the equilibrium."""
        return replace(self, rates=rates, behind=0.0)

    def change(self, travel: Array) -> Array:
        """Return the changes (n,) of the unknowns by roller travel (r,) [m]."""
        along = float(self.direction @ travel)
        by_curvature = along * (self.behind + 0.5 * along) * self.curvature
        return self.rates @ travel + by_curvature

    def continued(self, travel: Array, change: Array) -> TravelPrediction:
        """Return the prediction at the equilibrium after a travel (r,) and a change (n,)."""
        length = math.hypot(*travel)
        behind = self.behind + float(self.direction @ travel)
        if length < MIN_SECANT_TRAVEL:
            return replace(self, behind=behind)
        direction = travel / length
        secant_change = change / length - self.rates @ direction
        rates = self.rates + np.outer(secant_change, direction)
        # The secant holds in the middle of the travel; after a turn back, the rates may as well.
        from_rates = self.behind * float(self.direction @ direction) + 0.5 * length
        curvature = np.zeros(len(rates))
        if from_rates >= 0.5 * length:
            curvature = secant_change / from_rates
        return TravelPrediction(rates, direction, 0.5 * length, curvature)
