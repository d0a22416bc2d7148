# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Grip of an object between any two or three members, with its contacts.

Members are regarded as undeformed centre lines from pinch point to pinch point. A contact is the
point of the object's surface that is farthest toward the member. A face that touches a member has
contacts at both of its ends, see `Shape.contact_patch`, so it can neither lift nor rotate. Points
of the plane are complex numbers x + iy.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
import copy
from dataclasses import dataclass, field
import functools
import itertools
import math
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError, quote
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.distances import BentParts
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.convex_object import check_friction, ConvexObject
from isotruss_ros.core.model.topology import check_names, Topology
from isotruss_ros.core.numerics.argument_kinds import check_kind, check_kinds
from isotruss_ros.core.numerics.arrays import check_count, Indices
from isotruss_ros.core.numerics.records import Record
import numpy as np
from numpy.typing import ArrayLike

#: Smallest and largest number of members that hold an object [-].
GRIP_SIZES = (2, 3)


class CornerGap(NamedTuple):
    """Gap between a corner without contact and a grasping member in equilibrium."""

    owner: int  #: index of the member within the grip
    corner: int  #: index of the corner
    width: float  #: distance of the corner from the skin of the bent tube, not negative [m]


@dataclass(frozen=True, repr=False)
class Grip(Record, headline=('members', 'friction', 'body')):
    """
    Object with its grasping members, without a configuration of the robot.

    :ivar members: names `t/j-k` of two or three members.
    :ivar body: the object at its pose in the robot frame.
    :ivar friction: coefficient of friction between tubes and object; by default that of the
        object, or `DEFAULT_FRICTION` if the object has none.
    :ivar corners: for each member, the indices of the corners in contact: one corner, or the
        corners at both ends of a face. None: the corners are found by `Shape.contact_patch`.
    :ivar gaps: gaps of corners without contact near the members, which close slowly, see
        `land_faces`; only with `corners`.
    :ivar bent: displacements of the robot's parts by the contact forces, which clearances take
        into account; None: they are unknown, and clearances are those of straight tubes.
    :raises GraspError: the members are not two or three different names, or the coefficient or
        a corner is invalid.
    """

    members: tuple[str, ...]
    body: ConvexObject
    friction: float = None  # type: ignore[assignment]  # a number from the start on
    corners: tuple[tuple[int, ...], ...] | None = None
    gaps: tuple[CornerGap, ...] = ()
    bent: BentParts | None = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check the number of members; their names are checked later, against a robot."""
        check_kind('body', self.body, 'ConvexObject')
        friction = check_friction(self.body.friction_or(self.friction))
        object.__setattr__(self, 'members', check_member_names(self.members))
        object.__setattr__(self, 'friction', friction)
        if self.corners is not None:
            object.__setattr__(self, 'corners', check_corners(self, self.corners))

    @property
    def center(self) -> complex:
        """Return the origin of the object's frame, the reference point of its twist [m]."""
        return self.body.center

    def moved_to(self, pose: ArrayLike) -> Grip:
        """
        Return the grip with the object at another pose.

        :param pose: pose (x, y, angle) of the object's frame in the robot frame [m, rad].
        :raises GraspError: the pose is not three finite numbers within range.
        """
        moved = copy.copy(self)  # the other fields were checked when this grip was created
        object.__setattr__(moved, 'body', self.body.moved_to(pose))
        return moved

    def touching(self, owners: Indices, corners: Indices) -> Grip:
        """
        Return the grip with given corners in contact.

        :param owners: (k,) grasping member of each contact, numbered 0, 1 or 2 within the grip,
            ascending.
        :param corners: (k,) index of the object's corner at each contact.
        """
        touched = [tuple(corners[owners == i].tolist()) for i in range(len(self.members))]
        touching = copy.copy(self)
        object.__setattr__(touching, 'corners', tuple(touched))
        return touching

    @classmethod
    @check_kinds
    def at_module(
        cls, robot: Robot, module: str, body: ConvexObject, friction: float | None = None
    ) -> Grip:
        """
        Return the grip of an object between the two members of a module, as in the paper.

        :param robot: the robot.
        :param module: name `t/j` of the module.
        :param body: the object at its pose in the robot frame.
        :param friction: coefficient of friction between tubes and object; see `Grip`.
        :raises GraspError: the robot has no such module, or a value is invalid, see `Grip`.
        """
        return cls(members_at(robot, module), body, friction)  # type: ignore[arg-type]


def check_member_names(members: Sequence[str]) -> tuple[str, ...]:
    """Return the names of grasping members; raise GraspError unless they are two or three."""
    is_list = isinstance(members, Iterable) and not isinstance(members, str)
    names = tuple(members) if is_list else ()
    shown = ', '.join(map(str, names)) if is_list else str(members)
    fits = all(isinstance(name, str) for name in names) and len(names) == len(set(names))
    if not (fits and len(names) in GRIP_SIZES):
        raise GraspError(
            f'members {quote(shown)}: must be two or three different members, in a list'
        )
    return names


def check_corners(grip: Grip, corners: Sequence[Sequence[int]]) -> tuple[tuple[int, ...], ...]:
    """Return the corners in contact with each member of a grip; raise GraspError for others."""
    lists = corners if isinstance(corners, Sequence) else ()
    have_form = all(isinstance(touched, Sequence) and len(touched) > 0 for touched in lists)
    if not have_form or len(lists) != len(grip.members):
        raise GraspError(
            f'corners {quote(str(corners))}: must be a list of corners for each of the '
            f'{len(grip.members)} members'
        )
    checked = tuple(
        tuple(check_count(corner, f'corner on {name}', GraspError) for corner in touched)
        for name, touched in zip(grip.members, lists, strict=True)
    )
    for corner in set(itertools.chain(*checked)):
        try:
            grip.body.shape.faces_at(corner)
        except IndexError:
            raise GraspError(f'corner {corner}: the object has no corner of this index') from None
    return checked


def members_at(robot: Mechanism, module: str) -> tuple[str, str]:
    """Return the names of the two members that meet at a module; the first begins there."""
    check_names('module', [module], robot.module_names, robot.name)
    number, names = robot.module_names.index(module), robot.member_names
    return names[number], names[int(robot.topology.previous[number])]


class MemberNodes(NamedTuple):
    """Indices of k members, of their end nodes and of their rollers."""

    members: Indices  #: (k,) indices of the members, equal to those of the modules at their starts
    lines: Indices  #: (k, 2) nodes B at the members' starts, and C at their ends
    driven: Indices  #: (d,) positions in `members` of those that start at a driven module
    rollers: Indices  #: (d,) indices of the rollers of these modules


@functools.lru_cache(maxsize=256)
def find_members(topology: Topology, names: tuple[str, ...]) -> MemberNodes:
    """Return the indices of members `t/j-k`, of their end nodes and of their rollers; cached."""
    check_names('members', names, topology.member_names, topology.robot)
    members = np.array([topology.member_names.index(name) for name in names], dtype=np.intp)
    driven = np.flatnonzero(np.isin(members, topology.driven))
    lines = np.stack([topology.b[members], topology.end[members]], axis=1)
    rollers = topology.driven.searchsorted(members[driven])
    nodes = MemberNodes(members, lines, driven, rollers)
    for array in nodes:
        array.flags.writeable = False
    return nodes


class GripContact(NamedTuple):
    """One contact of a grip, as plain Python numbers for speed."""

    owner: int  #: index of the member within the grip
    start: complex  #: start of the member, robot frame [m]
    normal: complex  #: unit vector from the object toward the member
    point: complex  #: point of the object's surface, robot frame [m]
    corner: int  #: index of the corner in contact, see `Shape.corner_at`
    side: float  #: +1 for an object on the left of the member, -1 on the right


@functools.lru_cache(maxsize=8)
def find_contacts(config: Configuration, grip: Grip) -> list[GripContact]:
    """Return the contacts of each member, one or both ends of a face, in their order; cached."""
    nodes = find_members(config.robot.topology, grip.members)
    tube = config.robot.description.tube_diameter
    body, shape = grip.body, grip.body.shape.smoothed(0.5 * tube)
    centroid = body.center + body.turn * shape.centroid
    contacts: list[GripContact] = []
    for owner, (start, end) in enumerate(config.points.take(nodes.lines).tolist()):
        axis = (end - start) / abs(end - start)
        # +1 if the object is on the left of the member, -1 on the right.
        side = math.copysign(1.0, (axis.conjugate() * (centroid - start)).imag)
        normal = -1j * side * axis
        # Corners and points in contact, in the object's frame.
        local_normal = normal * body.turn.conjugate()
        if grip.corners is None:
            patch = shape.contact_patch(local_normal, 0.5 * tube)
            touched = [(patch_end.corner, patch_end.point) for patch_end in patch]
        else:
            touched = [(k, shape.point_at(k, local_normal)) for k in grip.corners[owner]]
        member_contacts = [
            GripContact(owner, start, normal, body.center + body.turn * point, corner, side)
            for corner, point in touched
        ]
        if fault := _contact_fault(member_contacts, end, tube):
            raise GraspError(
                f'member {grip.members[owner]} does not touch the object at '
                f'({grip.center.real:.4g}, {grip.center.imag:.4g}) m: {fault}. Name the members '
                'that hold the object, or give its pose in the robot frame'
            )
        contacts += member_contacts
    return contacts


def _contact_fault(contacts: list[GripContact], end: complex, tube: float) -> str:
    """Return the reason why a member with this end misses the object; empty if it touches."""
    start, normal = contacts[0].start, contacts[0].normal
    shares = [((contact.point - start) / (end - start)).real for contact in contacts]
    if min(shares) > 1.0 or max(shares) < 0.0:  # a face may extend beyond a member's end
        share = min(shares, key=abs)
        return f'the contact would be at {share:.6g} of its length; must be from 0 to 1'
    gaps = [((start - c.point) * normal.conjugate()).real - 0.5 * tube for c in contacts]
    gap = min(gaps, key=abs)
    return f'the gap is {gap:.3g} m; must be within {tube:.3g} m' if abs(gap) > tube else ''


def lifting_choices(owners: Sequence[int]) -> list[tuple[list[int], ...]]:
    """Return the sets of contacts that remain, by member, if faces lift at one of their ends."""
    members = [[k for k, owner in enumerate(owners) if owner == i] for i in dict.fromkeys(owners)]
    options = [[ends, ends[:1], ends[1:]] if ends[1:] else [ends] for ends in members]
    return list(itertools.product(*options))[1:]  # the first choice has all contacts
