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
from numpy.typing import ArrayLike


@dataclass(frozen=True, eq=False)
class Flattening:
    """Local compliance of the tubes' sections under transverse forces from one side."""

    radius: float  #: tube radius R [m]
    #: (t, n) k_n of the modes whose deformation spreads along the tube, per unit length [N/m^2]
    stiffness: Array
    #: (t, n) tension G_n, which couples neighbouring sections in these modes [N]
    tension: Array
    #: (t,) compliance for a line load of the other modes, whose deformation does not spread along
    #: the tube [m^2/N]
    rest: Array
    pressure: Array  #: (t,) gauge pressure p in each tube [Pa]
    tension_rate: Array  #: (t, n) derivatives of G_n with respect to p [N/Pa]

    @property
    def reach(self) -> Array:
        """Return the decay lengths lambda_n of the modes along the tube, (t, n) [m]."""
        return np.sqrt(self.tension / self.stiffness)

    def compliance(self, place: Array, member: Indices, tube: Indices, spacing: float) -> Array:
        """
        Return the compliance of points on the skin by dents alone, without bending of the tubes.

        Each point represents a piece of tube that is one spacing long; load and depth are
        averaged over this piece. Therefore the sum over many points equals the integral for any
        spacing.

        :param place: (c,) positions along the members [m]; on each member they differ by multiples
            of the spacing.
        :param member: (c,) index of the member of each point; points on one member interact.
        :param tube: (c,) index of the tube of each point.
        :param spacing: spacing of the points [m].
        :return: (c, c) compliance, symmetric positive definite [m/N].
        """
        apart = np.rint(np.abs(place[:, None] - place) / spacing).astype(np.intp)
        same = member[:, None] == member
        apart[~same] = 0
        # The table's length is a power of two, so few tables are computed.
        count = 1 << int(apart.max(initial=0)).bit_length()
        table = _compliance_by_distance(self, count, spacing)
        return np.where(same, table[tube[:, None], apart], 0.0)

    def lattice_compliance(self, count: int, tube: int, spacing: float) -> Array:
        """
        Return the compliance (count, count) of successive points on one tube [m/N].

        :param spacing: spacing of the points [m].
        """
        size = 1 << (count - 1).bit_length()
        return _compliance_by_distance(self, size, spacing)[tube][lattice_distances(count)]

    def compliance_rates(self, count: int, spacing: float) -> Array:
        """
        Return the derivatives with respect to pressure of the compliance between two points.

        :param spacing: spacing of the points [m].
        :return: (t, count) derivatives for each tube and distance [m/N/Pa].
        """
        ratio, blown = spacing / self.reach, 1.0 / self.pressure[:, None]
        pulled = self.tension_rate / self.tension
        # Derivatives of the logarithm of `peak`, and of `ratio`.
        higher, wider = -0.5 * (blown + pulled), -0.5 * (pulled - blown) * ratio
        peak = 0.5 / np.sqrt(self.stiffness * self.tension)
        mean = -np.expm1(-ratio) / ratio
        mean_rate = (np.exp(-ratio) - mean) / ratio
        spread = peak * mean**2
        steps = np.arange(count) - 1.0
        change = (higher + 2.0 * mean_rate / mean * wider)[:, :, None] - wider[:, :, None] * steps
        rates = np.einsum('tn,tnk->tk', spread, np.exp(-ratio[:, :, None] * steps) * change)
        alone = higher * (1.0 - mean) - wider * ((1.0 - mean) / ratio + mean_rate)
        rates[:, 0] = (2.0 * peak / ratio * alone).sum(axis=1) - self.rest / spacing * blown[:, 0]
        return rates


@functools.lru_cache(maxsize=16)
def lattice_distances(count: int) -> Indices:
    """Return the distances (count, count) between successive points in spacings."""
    found = np.arange(count)
    return np.abs(found[:, None] - found)


@functools.lru_cache(maxsize=64)
def _compliance_by_distance(kernel: Flattening, count: int, spacing: float) -> Array:
    """Return the compliance (t, count) between points that are 0, 1, ... spacings apart [m/N]."""
    ratio = spacing / kernel.reach
    peak = 0.5 / np.sqrt(kernel.stiffness * kernel.tension)
    # exp(-k ratio) (2 / ratio sinh(ratio / 2))^2, in a form that cannot overflow.
    spread = peak * (np.expm1(-ratio) / ratio) ** 2
    steps = np.arange(count) - 1.0
    table = np.einsum('tn,tnk->tk', spread, np.exp(-ratio[:, :, None] * steps))
    alone = peak * (2.0 / ratio) * (1.0 + np.expm1(-ratio) / ratio)
    table[:, 0] = alone.sum(axis=1) + kernel.rest / spacing
    return table


def flattening(
    radius: float,
    pressure: ArrayLike,
    fabric: Fabric | None = None,
    modes: int = 8,
    local_stiffness: float = 1.0,
) -> Flattening:
    """
    Return the local compliance of tubes under their gauge pressures.

    :param radius: tube radius R [m].
    :param pressure: (t,) gauge pressure p in each tube [Pa].
    :param fabric: E t and G t of the wall; None: f_n = 0, so the fabric has no influence.
    :param local_stiffness: ratio of a tube's measured local stiffness to the theoretical one [-].
    """
    n = np.arange(2, modes + 1)
    pressure = np.atleast_1d(np.asarray(pressure, dtype=float))[:, None]
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
    rest = (1.0 / modes + 1.0 / (modes + 1)) / (2.0 * np.pi * pressure[:, 0])
    measured = local_stiffness
    return Flattening(
        radius,
        measured * stiffness,
        measured * tension,
        rest / measured,
        pressure[:, 0],
        measured * tension_rate,
    )


@functools.lru_cache(maxsize=8)
def flattening_of(robot: Mechanism, pressures: tuple[float, ...] | None = None) -> Flattening:
    """
    Return the local compliance of the sections of a robot's tubes, cached.

    :param pressures: (t,) gauge pressures in the order of the robot file [Pa]; None: the pressures
        of the robot file.
    """
    file = robot.description
    if pressures is None:
        pressures = tuple(file.pressures.values())
    return flattening(
        0.5 * file.tube_diameter,
        pressures,
        tube_stiffness(file).fabric,
        local_stiffness=file.local_stiffness,
    )
