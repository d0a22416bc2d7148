# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
How deep a tube's skin dents under a cylinder that presses on it with a given force.

The contact of the analysis on a tube whose centre line stands still: what is left is the dent of
`flattening`. It depends on the tube and the cylinder alone, so that a table of it serves every
grasp; in the 2/3 power of the force, as of a point contact, it is close to straight.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
import functools
import math

from isotruss_ros.core.contact.contact import solve_contact
from isotruss_ros.core.contact.contact_points import ContactPoints
from isotruss_ros.core.contact.flattening import flattening_of
from isotruss_ros.core.contact.surfaces import RoundSurface
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.numerics.arrays import Array
import numpy as np
import scipy

#: Depths of the table as shares of the tube's or the object's radius, whichever is smaller ...
DEPTHS = 0.8 * np.linspace(0.0, 1.0, 15)[1:] ** 2
#: ... and contact points across the chord in which the object overlaps the round tube.
POINTS = 41
POWER = 2.0 / 3.0


class SkinIndentation:
    """
    The depth of a dent by the normal force, for one tube and one object.

    :param depths: (n,) of dents, rising from above zero [m].
    :param forces: (n,) with which the object presses there [N].
    """

    def __init__(self, depths: Array, forces: Array) -> None:
        places = np.append(0.0, forces**POWER)
        skin = np.append(0.0, depths)
        spline = scipy.interpolate.CubicSpline(places, skin, bc_type='natural')
        # In place of calling the spline and its derivative: single numbers of Python are several
        # times quicker, in each state of a search.
        self._places: list[float] = places.tolist()
        self._pieces: list[list[float]] = spline.c.T.tolist()

    def __call__(self, force: float) -> tuple[float, float]:
        """
        Return depth [m] and its derivative by the force [m/N]; beyond the table it goes on evenly.

        :param force: [N]; a pulling one has a depth below zero, for a search that passes it.
        """
        size = max(abs(force), 1e-9)
        place = size**POWER
        last = self._places[-1]
        inside = min(place, last)
        piece = min(bisect_right(self._places, inside), len(self._pieces)) - 1
        a, b, c, d = self._pieces[piece]
        x = inside - self._places[piece]
        slope = (3.0 * a * x + 2.0 * b) * x + c
        depth = ((a * x + b) * x + c) * x + d + slope * (place - inside)
        return math.copysign(depth, force), slope * POWER * place / size


def no_indentation(forces: Array) -> tuple[Array, Array]:
    """
    Return depths and derivatives of tubes that stay round: zero.

    :param forces: (k,) normal forces [N].
    """
    return np.zeros(len(forces)), np.zeros(len(forces))


class Indentation:
    """
    The dents of several tubes by one object.

    :param tables: of the k tubes.
    :param scale: stiffness of the tubes against that of the tables.
    """

    def __init__(self, tables: Sequence[SkinIndentation], scale: float) -> None:
        self._tables, self._scale = tables, scale

    def __call__(self, forces: Array) -> tuple[Array, Array]:
        """Return depths (k,) [m] and their derivatives by the normal forces (k,) [m/N]."""
        found = np.array(
            [
                table(force / self._scale)
                for table, force in zip(self._tables, forces.tolist(), strict=True)
            ]
        )
        return found[:, 0], found[:, 1] / self._scale


@functools.lru_cache(maxsize=32)
def skin_indentation(
    robot: Mechanism, tube: int, radius: float, pressures: tuple[float, ...] | None = None
) -> SkinIndentation:
    """
    Return the dents of one tube by one object; the tables of the last few are kept.

    :param robot: the robot.
    :param tube: number of the tube.
    :param radius: of the object [m].
    :param pressures: (t,) gauge, by tube [Pa]; those of the robot file if None.
    """
    depths = DEPTHS * min(radius, 0.5 * robot.description.tube_diameter)
    forces = [_pressing_force(robot, tube, radius, depth, pressures) for depth in depths]
    return SkinIndentation(depths, np.array(forces))


def _pressing_force(
    robot: Mechanism,
    tube: int,
    radius: float,
    depth: float,
    pressures: tuple[float, ...] | None,
) -> float:
    """Return the force with which a cylinder presses on a tube that it dents this deep [N]."""
    half = np.sqrt(radius**2 - (radius - depth) ** 2)
    place = half * np.linspace(-1.0, 1.0, POINTS)
    spacing = 2.0 * half / (POINTS - 1)
    alike = np.zeros(POINTS, dtype=np.intp)
    dents = flattening_of(robot, pressures).compliance(place, alike, alike + tube, spacing)
    line = place.astype(np.complex128)
    still = ContactPoints(
        points=line,
        skin=line,
        member=alike,
        place=place,
        pieces=alike[:1],
        piece=alike,
        spacing=spacing,
        axis=np.ones_like(line),
        inside=np.zeros((2, POINTS, POINTS)),
        spread=np.zeros((2, POINTS, 0)),
        ends=np.zeros((0, 0)),
        dents=dents,
    )
    contact = solve_contact(still, RoundSurface(-1j * (radius - depth), radius))
    return float((contact.forces * contact.normals.imag).sum())
