# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Flattening: local compliance of the section of an inflated tube under contact.

An inextensible wall of radius R under the gauge pressure p deforms under a line load in ring modes
cos(n phi), n = 2, 3, ..., with the stiffness k_n = pi p (n^2 - 1) per unit length. The compliance
of all modes is 3 / (4 pi p) for a load from one side, which the shear flow of the tube as a beam
balances. It is 1 / (pi p) between two plates. Along the tube each mode is a string on an elastic
foundation,

    k_n w - G_n w'' = q,
    G_n = pi p R^2 (1 + 1/n^2) / 2 + pi R G t f_n / n^2,
    f_n = E t / (E t + G t n^2 lambda_n^2 / R^2),   lambda_n = sqrt(G_n / k_n),

where w is the amplitude of the mode, q the load per length, and G_n is due to the wall tension
p R / 2 and the shear of the fabric. The compliance of a mode at a distance s is exp(-s / lambda_n)
/ (2 sqrt(k_n G_n)). All but the first few modes decay so fast along the tube that they deform only
the loaded section.
"""

from __future__ import annotations

from dataclasses import dataclass
import functools

from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.statics.section import Fabric
from isotruss_ros.core.statics.tube_stiffness import tube_stiffness
import numpy as np


@dataclass(frozen=True, eq=False)
class Flattening:
    """Local compliance of a tube's sections under transverse forces from one side."""

    radius: float  #: tube radius R [m]
    #: (n,) k_n of the modes whose deformation spreads along the tube, per unit length [N/m^2]
    stiffness: Array
    tension: Array  #: (n,) tension G_n, which couples neighbouring sections in these modes [N]
    #: compliance for a line load of the other modes, whose deformation does not spread along the
    #: tube [m^2/N]
    rest: float
    pressure: float  #: gauge pressure p [Pa]
    tension_rate: Array  #: (n,) derivatives of G_n with respect to p [N/Pa]

    @property
    def reach(self) -> Array:
        """Return the decay lengths lambda_n of the modes along the tube, (n,) [m]."""
        return np.sqrt(self.tension / self.stiffness)

    def compliance(self, points: Indices, spacing: float) -> Array:
        """
        Return the compliances (c, c) of points on the skin by dents alone [m/N].

        The positions of the points are in spacings [-]. Load and depth are averaged over pieces of
        tube that are one spacing long, so the sum over many points equals the integral.
        """
        apart, ratio = np.abs(points[:, None] - points), spacing / self.reach
        steps = np.arange(apart.max(initial=0) + 1) - 1.0
        # exp(-k ratio) (2 / ratio sinh(ratio / 2))^2, in a form that cannot overflow.
        spread = self._peak * (np.expm1(-ratio) / ratio) ** 2
        table = spread @ np.exp(-np.outer(ratio, steps))
        alone = self._peak * (2.0 / ratio) * (1.0 + np.expm1(-ratio) / ratio)
        table[0] = alone.sum() + self.rest / spacing
        return table[apart]

    def compliance_rates(self, points: Indices, spacing: float) -> Array:
        """Return the derivatives (c, c) of `compliance` with respect to pressure [m/N/Pa]."""
        apart, ratio, blown = np.abs(points[:, None] - points), spacing / self.reach, self.pressure
        pulled = self.tension_rate / self.tension
        # Derivatives of the logarithm of the peak, and of `ratio`.
        higher, wider = -0.5 * (1.0 / blown + pulled), -0.5 * (pulled - 1.0 / blown) * ratio
        mean = -np.expm1(-ratio) / ratio
        mean_rate = (np.exp(-ratio) - mean) / ratio
        steps = np.arange(apart.max(initial=0) + 1) - 1.0
        change = (higher + 2.0 * mean_rate / mean * wider)[:, None] - np.outer(wider, steps)
        rates = (self._peak * mean**2) @ (np.exp(-np.outer(ratio, steps)) * change)
        alone = higher * (1.0 - mean) - wider * ((1.0 - mean) / ratio + mean_rate)
        rates[0] = (2.0 * self._peak / ratio * alone).sum() - self.rest / spacing / blown
        return rates[apart]

    @property
    def _peak(self) -> Array:
        """Return the compliance (n,) of the modes for a line load, at the load [m/N]."""
        return 0.5 / np.sqrt(self.stiffness * self.tension)


def flattening(
    radius: float,
    pressure: float,
    fabric: Fabric | None = None,
    modes: int = 8,
    local_stiffness: float = 1.0,
) -> Flattening:
    """
    Return the local compliance of a tube; without fabric, f_n = 0.

    `local_stiffness` is the ratio of a tube's measured local stiffness to the theoretical one [-].
    """
    n = np.arange(2, modes + 1)
    stiffness = np.pi * pressure * (n**2 - 1.0)
    pulled = 0.5 * np.pi * pressure * radius**2 * (1.0 + 1.0 / n**2)
    tension, tension_rate = pulled, pulled / pressure
    if fabric is not None:
        wall, shear = fabric
        for _ in range(12):  # each reduces the error to less than a fifth
            share = wall / (wall + shear * n**2 * tension / stiffness / radius**2)
            tension = pulled + np.pi * radius * shear * share / n**2
        slower = np.pi * (shear * share) ** 2 / (wall * radius * stiffness)
        tension_rate = (pulled + slower * tension) / pressure / (1.0 + slower)
    compliances = (1.0 / modes + 1.0 / (modes + 1)) / (2.0 * np.pi * pressure)
    return Flattening(
        radius,
        local_stiffness * stiffness,
        local_stiffness * tension,
        compliances / local_stiffness,
        pressure,
        local_stiffness * tension_rate,
    )


@functools.lru_cache(maxsize=32)
def flattening_of(robot: Mechanism, pressure: float) -> Flattening:
    """Return the local compliance of a robot's tube under a gauge pressure [Pa], cached."""
    file = robot.description
    return flattening(
        0.5 * file.tube_diameter,
        pressure,
        tube_stiffness(file).fabric,
        local_stiffness=file.local_stiffness,
    )
