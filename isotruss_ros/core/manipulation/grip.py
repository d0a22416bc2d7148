# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""An object held between any two members, or three, and the numbers of these members."""

from __future__ import annotations

from dataclasses import dataclass
import functools
import math
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError, quote
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Indices
import numpy as np
from numpy.typing import ArrayLike

#: Number of members that hold an object.
FEWEST, MOST = 2, 3


@dataclass(frozen=True)
class Grip:
    """
    An object and the members that hold it, wherever these are.

    :ivar members: names `t/j-k` of two members, or three.
    :ivar body: the object in its place in the robot frame.
    :ivar friction: coefficient between tubes and object; that of the object if it has one.
    :raises GraspError: not two or three different names, no such object, or no such coefficient.
    """

    members: tuple[str, ...]
    body: ConvexObject
    friction: float = 0.5

    def __post_init__(self) -> None:
        """Check the number of members; their names are checked against a robot when used."""
        try:
            own = self.body.friction
        except AttributeError:
            raise GraspError(f'object {self.body!r}: must be a ConvexObject') from None
        names = (self.members,) if isinstance(self.members, str) else tuple(self.members)
        fits = all(isinstance(name, str) for name in names) and len(names) == len(set(names))
        if not (fits and FEWEST <= len(names) <= MOST):
            raise GraspError(
                f'members {quote(", ".join(map(str, names)))}: a grip has two or three different '
                'members'
            )
        object.__setattr__(self, 'members', names)
        friction = self.friction if own is None else own
        if not 0.0 <= friction < math.inf:
            raise GraspError(f'friction {friction!r}: must be a finite number, not negative')
        object.__setattr__(self, 'friction', friction)

    @property
    def center(self) -> complex:
        """Return the origin of the object's frame, to which its twist belongs, x + iy [m]."""
        return self.body.center

    def moved_to(self, pose: ArrayLike) -> Grip:
        """
        Return the grip with the object in another place.

        :param pose: of the object's frame in the robot frame (x, y, angle) [m, rad].
        :raises GraspError: the pose is not three finite numbers within range.
        """
        moved = object.__new__(Grip)
        # What has been checked need not be checked again.
        moved.__dict__.update(self.__dict__, body=self.body.moved_to(pose))
        return moved

    @classmethod
    def at_module(
        cls, robot: Robot, module: str, body: ConvexObject, friction: float = 0.5
    ) -> Grip:
        """
        Return the grip by the two members that meet at a module, as the paper's.

        :param robot: the robot.
        :param module: name `t/j` of the module.
        :param body: the object in its place in the robot frame.
        :param friction: coefficient between tubes and object; of an object that has its own, that
            one.
        :raises GraspError: the robot has no such module, or see `Grip`.
        """
        return cls(members_at(robot, module), body, friction)


def members_at(robot: Robot, module: str) -> tuple[str, str]:
    """
    Return the names of the two members that meet at a module: the one ahead, the one behind.

    :param robot: the robot.
    :param module: name `t/j` of the module.
    :raises GraspError: the robot has no such module.
    """
    if module not in robot.module_names:
        raise GraspError(
            f'module {quote(str(module))}: robot {robot.name} has no such module; '
            f'its modules are {", ".join(robot.module_names)}'
        )
    number, names = robot.module_names.index(module), robot.member_names
    return names[number], names[int(robot.topology.previous[number])]


class MemberNodes(NamedTuple):
    """Members and the nodes at their ends."""

    members: Indices  #: (k,) numbers of the members: those of the modules that they leave
    starts: Indices  #: (k,) nodes B at which they start
    ends: Indices  #: (k,) nodes C at which they end
    both: Indices  #: (2 k,) nodes at which they start, then those at which they end
    driven: Indices  #: (d,) which of the k members start at a module with a roller
    rollers: Indices  #: (d,) numbers of these rollers
    entries: Indices  #: (4 k,) places of the entries of `member_rows` among (3 k, n)


@functools.lru_cache(maxsize=256)
def find_members(robot: Robot, names: tuple[str, ...]) -> MemberNodes:
    """
    Return the numbers of members and of their nodes, which are not to be written to.

    :param robot: the robot.
    :param names: (k,) names `t/j-k`.
    :raises GraspError: the robot has no such member.
    """
    unknown = [name for name in names if name not in robot.member_names]
    if unknown:
        raise GraspError(
            f'members {quote(", ".join(map(str, unknown)))}: robot {robot.name} has no such '
            f'members; its members are {", ".join(robot.member_names)}'
        )
    topology = robot.topology
    members = np.array([robot.member_names.index(name) for name in names], dtype=np.intp)
    driven = np.flatnonzero(np.isin(members, topology.driven))
    starts, ends = topology.b[members], topology.c[topology.following[members]]
    rows = topology.n_nodes * np.arange(3 * len(members)).reshape(-1, 3)
    found = MemberNodes(
        members=members,
        starts=starts,
        ends=ends,
        both=np.concatenate([starts, ends]),
        driven=driven,
        rollers=topology.driven.searchsorted(members[driven]),
        entries=np.stack([*(starts + rows.T), ends + rows[:, 2]], axis=1).ravel(),
    )
    for array in found:
        array.flags.writeable = False
    return found
