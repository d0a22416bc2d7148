# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pose and contact forces of a held object."""

from __future__ import annotations

from dataclasses import dataclass
import functools
from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Points

#: Indices of the pose among the unknowns.
CENTER, ANGLE, POSE = slice(0, 2), 2, 3


class Places(NamedTuple):
    """
    Indices of the unknowns and of the equations of k contacts.

    :ivar feet: indices of the unknown positions along the members.
    :ivar inclinations: indices of the unknown inclinations of the bent tubes.
    :ivar normal: indices of the unknown normal forces.
    :ivar friction: indices of the unknown friction forces.
    :ivar forces: indices of the unknown normal and friction forces.
    :ivar balance: indices of the equations for the balance of fx, fy and m.
    :ivar conditions: indices of the equations of friction or rolling, see `ContactConditions`.
    :ivar size: number of unknowns.
    """

    feet: slice
    inclinations: slice
    normal: slice
    friction: slice
    forces: slice
    balance: slice
    conditions: slice
    size: int

    @classmethod
    @functools.lru_cache(maxsize=16)
    def of(cls, count: int) -> Places:
        """Return the indices of unknowns and equations for a number of contacts."""
        begins = [POSE + i * count for i in range(5)]
        unknowns = [slice(begins[i], begins[i + 1]) for i in range(4)]
        forces = slice(begins[2], begins[4])
        rows = slice(3 * count, 3 * count + 3), slice(3 * count + 3, None)
        return cls(*unknowns, forces, *rows, 4 * count + 3)  # type: ignore[call-arg, arg-type]


@dataclass(frozen=True, eq=False)
class ContactForces:
    """
    Pose, contacts and forces of an object at k contacts.

    :ivar unknowns: (3 + 4k,) pose x, y [m], angle [rad]; distances s_i of the contacts from the
        members' starts [m]; inclinations beta_i of the bent tubes relative to the straight members
        [rad]; normal forces N_i [N]; friction forces T_i on the tubes, counter-clockwise around
        the object [N].
    :ivar normals: (k,) unit normals from the object toward the tubes.
    :ivar loads: (k, 3) loads on the tubes: forces along and across the members [N], and moments [N
        m].
    :ivar jacobian: (3 + 4k, 3 + 4k) Jacobian of the equilibrium equations with respect to the
        unknowns.
    """

    unknowns: Array
    normals: Points
    loads: Array
    jacobian: Array

    @functools.cached_property
    def places(self) -> Places:
        """Return the indices of the unknowns and of the equations."""
        return Places.of(len(self.normals))

    @property
    def center(self) -> complex:
        """Return the origin of the object's frame, x + iy [m]."""
        return complex(self.unknowns[0], self.unknowns[1])

    @functools.cached_property
    def feet(self) -> Array:
        """Return the positions of the contacts along the members, (k,) [m]."""
        return self.unknowns[self.places.feet]

    @functools.cached_property
    def normal_forces(self) -> Array:
        """Return the normal forces (k,) at the contacts [N], positive in compression."""
        return self.unknowns[self.places.normal]

    @functools.cached_property
    def friction_forces(self) -> Array:
        """Return the friction forces (k,) on the tubes, counter-clockwise round the object [N]."""
        return self.unknowns[self.places.friction]

    @property
    def forces(self) -> Array:
        """Return the normal and then the friction forces at the contacts, (2k,) [N]."""
        return self.unknowns[self.places.forces]
