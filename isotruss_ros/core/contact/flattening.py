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

import functools

from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.tolerances import EPSILON
from isotruss_ros.core.statics.section import Fabric
from isotruss_ros.core.statics.tube_stiffness import tube_stiffness
import numpy as np


class Flattening:
    """
    Local compliance of a tube's sections under transverse forces from one side.

    Without fabric, f_n = 0. `local_stiffness` is the ratio of a tube's measured local stiffness to
    the theoretical one [-].

    :ivar stiffness: stiffness k_n of the modes n = 2, 3, ..., `modes` per length [N/m^2].
    :ivar tension: tension G_n of the modes [N].
    :ivar decay_length: length lambda_n of the modes [m].
    :ivar local_compliance: compliance for a line load of the modes n > `modes`, which are assumed
        not to spread along the tube [m^2/N].
    """

    def __init__(
        self,
        radius: float,
        pressure: complex,
        fabric: Fabric | None = None,
        modes: int = 8,
        local_stiffness: float = 1.0,
    ) -> None:
        self.radius, self.pressure = radius, pressure
        self._other_arguments = fabric, modes, local_stiffness
        n = np.arange(2, modes + 1)
        stiffness = np.pi * pressure * (n**2 - 1.0)
        # With f_n inserted, G_n = a + b / (1 + c G_n), where a is due to the wall tension and b to
        # the shear of the fabric: c G_n^2 + (1 - a c) G_n - (a + b) = 0.
        a = 0.5 * np.pi * pressure * radius**2 * (1.0 + 1.0 / n**2)
        wall_modulus, shear_modulus = fabric or Fabric(1.0, 0.0)
        b = np.pi * radius * shear_modulus / n**2
        c = shear_modulus * n**2 / (wall_modulus * stiffness * radius**2)
        # The positive solution, in a form that is also valid for c = 0.
        linear = 1.0 - a * c
        tension = 2.0 * (a + b) / (linear + np.sqrt(linear * linear + 4.0 * c * (a + b)))
        self.stiffness, self.tension = local_stiffness * stiffness, local_stiffness * tension
        self.decay_length = np.sqrt(self.tension / self.stiffness)
        # The sum of 1 / k_n over all n > modes.
        local_compliance = (1.0 / modes + 1.0 / (modes + 1)) / (2.0 * np.pi * pressure)
        self.local_compliance = local_compliance / local_stiffness

    def compliance(self, points: Indices, spacing: float) -> Array:
        """Return the compliances (c, c) of points at integer multiples of a spacing [m/N]."""
        distances = np.abs(points[:, None] - points)
        count = int(distances.max(initial=0)) + 1
        return self.compliance_column(count, np.array([spacing]))[0, distances]

    def compliance_column(self, count: int, spacing: Array) -> Array:
        """Return the compliances (s, c) at 0 to c - 1 spacings (s,) from a load [m/N]."""
        # Load and depth are averaged over pieces of tube that are one spacing long.
        ratio = spacing[:, None] / self.decay_length
        # Compliance of each mode for a concentrated load, at the load.
        peak = 0.5 / np.sqrt(self.stiffness * self.tension)
        # The average over two pieces at a distance of d spacings is exp(-d ratio) times
        # (2 sinh(ratio / 2) / ratio)^2, which is here without overflow exp(-(d - 1) ratio) times
        # ((1 - exp(-ratio)) / ratio)^2.
        averaged_peak = peak * (np.expm1(-ratio) / ratio) ** 2
        decays = np.exp(-ratio[:, :, None] * (np.arange(count) - 1.0))
        by_distance = (averaged_peak[:, None] @ decays)[:, 0]
        # The average within one piece.
        same_piece = peak * (2.0 / ratio) * (1.0 + np.expm1(-ratio) / ratio)
        by_distance[:, 0] = same_piece.sum(axis=1) + self.local_compliance / spacing
        return by_distance

    def compliance_rates(self, points: Indices, spacing: float) -> Array:
        """Return the derivatives (c, c) of `compliance` with respect to pressure [m/N/Pa]."""
        inflated = Flattening(self.radius, self.pressure + 1j * EPSILON, *self._other_arguments)
        return inflated.compliance(points, spacing).imag / EPSILON


@functools.lru_cache(maxsize=32)
def flattening_of(robot: Mechanism, pressure: float) -> Flattening:
    """Return the local compliance of a robot's tube under a gauge pressure [Pa], cached."""
    file = robot.description
    return Flattening(
        0.5 * file.tube_diameter,
        pressure,
        tube_stiffness(file).model.fabric,
        local_stiffness=file.local_stiffness,
    )
