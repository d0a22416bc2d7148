# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Contacts, pose and forces of a held object, and their response to small wrenches.

The contacts stick, and the tubes redistribute the forces. The slip margin and the effect of moving
members follow from this response.
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
    The k contacts of an object, in ascending order of their members.

    :ivar members: (k,) indices of the members.
    :ivar corners: (k,) index of the polygon's corner of each contact; zero for other shapes.
    :ivar cuts: (k, 2) extent of each contact before and behind its point, see `corner_dents` [m].
    """

    members: Indices
    corners: Indices
    cuts: Array

    @functools.cached_property
    def owners(self) -> Indices:
        """Return the number (k,) of each contact's member within the grip: 0, 1 or 2."""
        return np.cumsum(np.diff(self.members, prepend=self.members[0]) > 0)

    @functools.cached_property
    def ends(self) -> list[Indices]:
        """Return the contacts of each grasping member: one contact, or two at a face's ends."""
        return [np.flatnonzero(self.owners == i) for i in range(int(self.owners[-1]) + 1)]

    def without(self, dropped: int) -> PressedContacts:
        """
        Return the contacts after the removal of one contact.

        If the removed contact is one end of a face, the extent of the other end becomes unlimited.

        :param dropped: index of the removed contact.
        """
        cuts = self.cuts.copy()
        cuts[self.owners == self.owners[dropped]] = np.inf
        every = self.members, self.corners, cuts
        return PressedContacts(*(np.delete(each, dropped, axis=0) for each in every))


class Places(NamedTuple):
    """
    Indices of the unknowns and equations of k contacts.

    :ivar feet: unknown positions along the members.
    :ivar inclinations: unknown inclinations of the bent tubes.
    :ivar normal: unknown normal forces.
    :ivar friction: unknown friction forces.
    :ivar balance: equations of the balance fx, fy, m.
    :ivar conditions: equations of friction or rolling, see `ContactConditions`.
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

    :ivar unknowns: (3 + 4k,) pose x, y [m], angle [rad]; positions s_i of the contacts along the
        members [m]; inclinations beta_i of the bent tubes relative to the straight members [rad];
        normal forces N_i [N]; friction T_i on the tubes, counter-clockwise around the object [N].
    :ivar normals: (k,) unit normals from the object toward the tubes.
    :ivar loads: (k, 3) loads on the tubes: forces along and across members [N], moments [N m].
    :ivar jacobian: (3 + 4k, 3 + 4k) Jacobian of the equations with respect to the unknowns.
    """

    unknowns: Array
    normals: Points
    loads: Array
    jacobian: Array

    @functools.cached_property
    def places(self) -> Places:
        """Return the indices of the unknowns and equations."""
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
        """Return the friction forces (k,) on the tubes, counter-clockwise round the object [N]."""
        return self.unknowns[self.places.friction]

    @property
    def forces(self) -> Array:
        """Return the normal and friction forces, (2k,) [N]."""
        return np.concatenate([self.normal_forces, self.friction_forces])


@dataclass(frozen=True, eq=False)
class GripResponse:
    """
    Response to a small wrench (fx, fy, m / arm) [N] at k sticking contacts.

    :ivar change: (3 + 4k, 3) change of the unknowns, see `ContactForces`.
    :ivar squeeze: (3,) change of the mean normal force of the members due to the wrench [-].
    :ivar arm: characteristic radius, see `ConvexObject.arm` [m].
    :ivar squeeze_stiffness: derivative of the mean normal force with respect to the opening of the
        members, see `HeldGrip.squeeze_stiffness` [N/m].
    :ivar ends: (e,) contacts that are an end of a face.
    :ivar opening: (e, 2k) change of normal and friction forces as an end opens, relative to its
        tension [-].
    """

    change: Array
    squeeze: Array
    arm: float
    squeeze_stiffness: float
    ends: Indices
    opening: Array

    @property
    def pose(self) -> Array:
        """Return the compliance (3, 3) of x, y and angle [m/N, rad/N]."""
        return self.change[:POSE]

    @property
    def forces(self) -> Array:
        """Return the changes (2k, 3) of normal and friction forces by the wrench [-]."""
        begin = (POSE + len(self.change)) // 2
        return self.change[begin:]

    @property
    def stiffness(self) -> Array:
        """Return the matrix (3, 3) of wrench (fx, fy, m) per displacement [N/m, N, N m]."""
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
    Return the matrix from contact forces to the margins against slip.

    :param owners: (k,) number of each contact's member within the grip.
    :param friction: coefficient of friction mu.
    :return: (2m, 2k) matrix. Its columns are the normal forces N and friction forces T of k
        contacts. Its rows are mu N - T of m members and mu N + T of m members, of the sums over
        each member's contacts.
    """
    members = np.eye(int(owners[-1]) + 1)[owners].T
    presses = friction * members
    return np.concatenate([np.hstack([presses, -members]), np.hstack([presses, members])])
