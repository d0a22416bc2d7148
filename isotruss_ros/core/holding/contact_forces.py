# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Contacts, pose and forces of a held object, and their response to small wrenches.

Contacts stick and forces redistribute with the tubes, which gives the slip margin and the change
by moving members.
"""

from __future__ import annotations

from dataclasses import dataclass
import functools
from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np
from scipy.linalg import lapack

#: Indices of the pose among the unknowns.
CENTER, ANGLE, POSE = slice(0, 2), 2, 3


@dataclass(frozen=True, eq=False)
class PressedContacts:
    """
    The k contacts of an object, in ascending order of the members.

    :ivar members: (k,) indices of the members.
    :ivar corners: (k,) corners of a polygon; zero of other shapes.
    :ivar cuts: (k, 2) extent of the contact before and behind, see `corner_dents` [m].
    """

    members: Indices
    corners: Indices
    cuts: Array

    @functools.cached_property
    def owners(self) -> Indices:
        """Return the indices (k,) of the contacts' members within the grip."""
        return np.cumsum(np.diff(self.members, prepend=self.members[0]) > 0)

    @functools.cached_property
    def ends(self) -> list[Indices]:
        """Return the contacts of each grasping member: one, or both ends of a face."""
        return [np.flatnonzero(self.owners == i) for i in range(int(self.owners[-1]) + 1)]

    def without(self, dropped: int) -> PressedContacts:
        """
        Return the remaining contacts.

        If one end of a face is removed, the extent of the other is unlimited.

        :param dropped: index of the removed contact.
        """
        cuts = self.cuts.copy()
        cuts[self.owners == self.owners[dropped]] = np.inf
        every = self.members, self.corners, cuts
        return PressedContacts(*(np.delete(each, dropped, axis=0) for each in every))


class Places(NamedTuple):
    """
    Indices of k contacts among the unknowns and equations.

    :ivar feet: positions along the members.
    :ivar inclinations: inclinations of the bent tubes.
    :ivar normal: normal forces.
    :ivar friction: friction forces.
    :ivar balance: rows of the balance fx, fy, m.
    :ivar conditions: rows of friction or rolling, see `ContactConditions`.
    :ivar size: number of unknowns.
    """

    feet: slice
    inclinations: slice
    normal: slice
    friction: slice
    balance: slice
    conditions: slice
    size: int

    @classmethod
    @functools.lru_cache(maxsize=16)
    def of(cls, count: int) -> Places:
        """
        Return the indices for a number of contacts.

        :param count: number k of contacts.
        """
        begins = [POSE + i * count for i in range(5)]
        unknowns = [slice(begins[i], begins[i + 1]) for i in range(4)]
        rows = slice(3 * count, 3 * count + 3), slice(3 * count + 3, None)
        return cls(*unknowns, *rows, 4 * count + 3)  # type: ignore[call-arg, arg-type]


@dataclass(frozen=True, eq=False)
class ContactForces:
    """
    Pose, contacts and forces of an object at k contacts.

    :ivar unknowns: (3 + 4k,) x, y [m], angle [rad], feet s_i [m], inclinations of the bent tubes
        beta_i [rad], normal forces N_i [N], friction forces on the tubes T_i [N],
        counter-clockwise around the object.
    :ivar normals: (k,) unit normals from the object toward the tubes.
    :ivar loads: (k, 3) loads on the tubes: along and across the members [N], moments [N m].
    :ivar jacobian: (3 + 4k, 3 + 4k) Jacobian of the equations in this state.
    """

    unknowns: Array
    normals: Points
    loads: Array
    jacobian: Array

    @functools.cached_property
    def places(self) -> Places:
        """Return the indices of the unknowns."""
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
        """Return the normal forces (k,) [N], positive in compression."""
        return self.unknowns[self.places.normal]

    @functools.cached_property
    def friction_forces(self) -> Array:
        """Return the friction on the tubes, (k,) counter-clockwise around the object [N]."""
        return self.unknowns[self.places.friction]

    @property
    def forces(self) -> Array:
        """Return normal and friction forces, (2k,) [N]."""
        return np.concatenate([self.normal_forces, self.friction_forces])


@dataclass(frozen=True, eq=False)
class GripResponse:
    """
    Response to a small wrench (fx, fy, m / arm) [N] at k sticking contacts.

    :ivar change: (3 + 4k, 3) change of the unknowns, see `ContactForces`.
    :ivar squeeze: (3,) change of the mean normal force of the members [-].
    :ivar arm: characteristic radius, see `ConvexObject.arm` [m].
    :ivar squeeze_stiffness: derivative of the mean normal force by the opening of the members
        [N/m].
    """

    change: Array
    squeeze: Array
    arm: float
    squeeze_stiffness: float

    @property
    def pose(self) -> Array:
        """Return the compliance of x, y and angle, (3, 3) [m/N, rad/N]."""
        return self.change[:POSE]

    @property
    def forces(self) -> Array:
        """Return the change of normal and of friction forces, (2k, 3) [-]."""
        begin = (POSE + len(self.change)) // 2
        return self.change[begin:]

    @property
    def stiffness(self) -> Array:
        """Return the stiffness: (3, 3), wrench (fx, fy, m) per displacement [N/m, N, N m]."""
        stiffness = np.linalg.inv(self.pose)
        stiffness[2] *= self.arm
        return stiffness

    @property
    def stable(self) -> bool:
        """Return whether the stiffness is positive definite."""
        even = self.pose * np.array([[1.0], [1.0], [self.arm]])
        return not lapack.dpotrf(0.5 * (even + even.T))[1]


def slip_conditions(owners: Indices, friction: float) -> Array:
    """
    Return the matrix from contact forces to margins against slip and opening.

    :param owners: (k,) index of the member of the grip of each contact.
    :param friction: coefficient mu.
    :return: (2m + k, 2k), by normal forces N and friction forces T of the k contacts: mu N - T of
        m members, mu N + T of these, then N of each contact.
    """
    members = np.eye(int(owners[-1]) + 1)[owners].T
    presses, alone = friction * members, np.eye(len(owners), 2 * len(owners))
    slips = np.hstack([presses, -members]), np.hstack([presses, members])
    return np.concatenate([*slips, alone])
