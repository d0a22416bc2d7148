# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The balance of a held object: its unknowns and rows, and the search for it by Newton's method.

Unknowns are the object's pose, where along the members the contacts are, how the bent tubes are
inclined there, and the contact forces. Rows are touch along and across the members, inclination,
balance, and the closure, which says what statics leaves open.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import functools
from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Points
import numpy as np
from scipy.linalg import lapack

#: Forces balance to this share of the squeeze, contact points touch to this length [m].
FORCE_TOLERANCE, LENGTH_TOLERANCE = 1e-10, 1e-11
MAX_STEPS = 40
#: In one step contacts and object move at most this share of the object's size ...
MAX_MOVE = 0.5
#: ... and tubes incline at most by this [rad]. A tube that inclines by more than the other has
#: folded long before: there the linear structure has balances that mean nothing.
MAX_TURN, MAX_INCLINATION = 0.2, 0.5
#: Rows that settle what statics leaves open: residual (k,) and derivative (k, 3 + 4k) in a state.
Closure = Callable[[Array, Points], tuple[Array, Array]]

#: Places of the pose among the unknowns.
CENTER, ANGLE, POSE = slice(0, 2), 2, 3


class Places(NamedTuple):
    """
    Places of k contacts among the unknowns, and of the equations.

    :ivar feet: where along the members they are.
    :ivar inclinations: of the bent tubes.
    :ivar normal: forces.
    :ivar friction: forces.
    :ivar balance: rows fx, fy, m.
    :ivar closure: rows that statics leaves open.
    :ivar size: number of unknowns.
    """

    feet: slice
    inclinations: slice
    normal: slice
    friction: slice
    balance: slice
    closure: slice
    size: int

    @classmethod
    @functools.lru_cache(maxsize=16)
    def of(cls, count: int) -> Places:
        """
        Return those of some contacts.

        :param count: k.
        """
        begins = [POSE + i * count for i in range(5)]
        unknowns = [slice(begins[i], begins[i + 1]) for i in range(4)]
        rows = slice(3 * count, 3 * count + 3), slice(3 * count + 3, None)
        return cls(*unknowns, *rows, 4 * count + 3)


@dataclass(frozen=True, eq=False)
class ContactForces:
    """
    Pose, contacts and forces of an object at k contacts.

    :ivar unknowns: (3 + 4k,) x, y [m], angle [rad], feet s_i [m], inclinations of the bent tubes
        beta_i [rad], normal forces N_i [N], friction forces on the tubes T_i [N],
        counter-clockwise around the object.
    :ivar normals: (k,) from the object toward the tubes.
    :ivar jacobian: (3 + 4k, 3 + 4k) of the equations there.
    """

    unknowns: Array
    normals: Points
    jacobian: Array

    @functools.cached_property
    def places(self) -> Places:
        """Return where what is among the unknowns."""
        return Places.of(len(self.normals))

    @property
    def center(self) -> complex:
        """Return the origin of the object's frame, x + iy [m]."""
        return complex(self.unknowns[0], self.unknowns[1])

    @functools.cached_property
    def feet(self) -> Array:
        """Return where along the members the contacts are, (k,) [m]."""
        return self.unknowns[self.places.feet]

    @functools.cached_property
    def normal_forces(self) -> Array:
        """Return (k,) [N], positive where object and tube press on each other."""
        return self.unknowns[self.places.normal]

    @functools.cached_property
    def friction_forces(self) -> Array:
        """Return (k,) on the tubes, counter-clockwise around the object [N]."""
        return self.unknowns[self.places.friction]

    def jacobian_with(self, closing: Array) -> Array:
        """
        Return the Jacobian of the equations with another closure, (3 + 4k, 3 + 4k).

        :param closing: (k, 3 + 4k) derivative of what settles the equations that statics leaves
            open.
        """
        jacobian = self.jacobian.copy()
        jacobian[self.places.closure] = closing
        return jacobian


#: Residual (3 + 4k,), its derivative and the normals (k,) in a state.
Equations = Callable[[Array], tuple[Array, Array, Points]]


def solve_balance(
    equations: Equations, start: Array, arm: float, max_turn: float, steps: int = MAX_STEPS
) -> ContactForces | None:
    """
    Return the equilibrium near a start (Newton's method), or None if it is not found.

    :param equations: in a state.
    :param start: (3 + 4k,) unknowns to begin with, see `ContactForces`.
    :param arm: size of the object, by which steps are bounded [m].
    :param max_turn: the object turns by at most this in one step [rad].
    :param steps: most states that are looked at.
    """
    count = (len(start) - POSE) // 4
    places, unknowns = Places.of(count), start.copy()
    longest = _longest_step(count, arm, max_turn)
    for _ in range(steps):
        residual, jacobian, normals = equations(unknowns)
        if _is_solved(residual, unknowns, places):
            folded = np.abs(unknowns[places.inclinations]).max() > MAX_INCLINATION
            return None if folded else ContactForces(unknowns, normals, jacobian)
        _, _, step, singular = lapack.dgesv(jacobian, -residual)
        size = np.abs(step)
        if singular or not size.max() < np.inf:
            return None
        unknowns = unknowns + step / max(1.0, float((size / longest).max()))
    return None


def _is_solved(residual: Array, unknowns: Array, places: Places) -> bool:
    """Return whether forces balance and contacts touch; one that is no number does neither."""
    least = np.full(places.size, LENGTH_TOLERANCE)
    least[places.balance] = FORCE_TOLERANCE * np.abs(unknowns[places.normal]).sum()
    return bool((np.abs(residual) <= least).all())


@functools.lru_cache(maxsize=16)
def _longest_step(count: int, arm: float, max_turn: float) -> Array:
    """Return by how much the unknowns (3 + 4k,) of k contacts change in one step at most."""
    places = Places.of(count)
    longest = np.full(places.size, MAX_MOVE * arm)
    longest[ANGLE], longest[places.inclinations] = max_turn, MAX_TURN
    longest[places.normal] = longest[places.friction] = np.inf
    longest.flags.writeable = False
    return longest
