"""
An object held between any two members, or three, and where it touches them.

A member touches with its straight skin: the object's contact is the point of its surface that is
farthest in the direction of the member. Points of the plane are complex numbers, as in
`constraints`.
"""

from __future__ import annotations

from dataclasses import dataclass
import functools
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError, quote
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grasp import Grasp, module_index
from isotruss_ros.core.model.objects import Cylinder
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
import numpy as np

#: Number of members that hold an object.
FEWEST, MOST = 2, 3


@dataclass(frozen=True)
class Grip:
    """
    An object and the members that hold it, wherever these are.

    `Grasp(module, center, diameter)` is short for the two members that meet at a module, see
    `at_module`.

    :ivar members: names `t/j-k` of two members, or three.
    :ivar body: the object, placed in the robot frame.
    :raises GraspError: not two or three different names.
    """

    members: tuple[str, ...]
    body: Cylinder

    def __post_init__(self) -> None:
        """Check the number of members; their names are checked against a robot when used."""
        names = (self.members,) if isinstance(self.members, str) else tuple(self.members)
        fits = all(isinstance(name, str) for name in names) and len(names) == len(set(names))
        if not (fits and FEWEST <= len(names) <= MOST):
            raise GraspError(
                f'members {quote(", ".join(map(str, names)))}: a grip has two or three different '
                'members'
            )
        object.__setattr__(self, 'members', names)

    @classmethod
    def at_module(cls, robot: Robot, grasp: Grasp) -> Grip:
        """
        Return a grasp between the two members of a module as a grip of these members.

        :param robot: the robot.
        :param grasp: the grasp.
        :raises GraspError: the robot has no such module.
        """
        module = module_index(robot, grasp.module)
        names = robot.member_names
        ahead, back = names[module], names[int(robot.topology.previous[module])]
        return cls((ahead, back), Cylinder(grasp.center, grasp.diameter))


class MemberNodes(NamedTuple):
    """
    Members and the nodes at their ends.

    :ivar members: (k,) numbers of the members, which are those of the modules that they leave.
    :ivar starts: (k,) nodes B at which they start.
    :ivar ends: (k,) nodes C at which they end.
    :ivar places: (2, k, 2) where starts and ends are in rows vx, vy by member and node, flat.
    :ivar columns: (2 k,) the members, for their rows vx and vy.
    """

    members: Indices
    starts: Indices
    ends: Indices
    places: Indices
    columns: Indices


@dataclass(frozen=True, eq=False)
class GripContacts:
    """
    The k contacts of a grip, in the robot frame.

    :ivar nodes: numbers of the members and of their nodes.
    :ivar spans: (k,) members from start to end [m].
    :ivar axes: (k,) their unit vectors.
    :ivar points: (k,) of the object's surface [m].
    :ivar normals: (k,) unit vectors out of the object into the member.
    :ivar sides: (k,) +1 where the object is left of the member, -1 where it is right.
    """

    nodes: MemberNodes
    spans: Points
    axes: Points
    points: Points
    normals: Points
    sides: Array


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
    members = np.array([robot.member_names.index(name) for name in names])
    starts, ends = topology.b[members], topology.c[topology.following[members]]
    rows = np.arange(2 * len(members)).reshape(-1, 2) * topology.n_nodes
    places = np.stack([starts[:, None] + rows, ends[:, None] + rows])
    found = MemberNodes(members, starts, ends, places, members.repeat(2))
    for numbers in found:
        numbers.flags.writeable = False
    return found


def find_contacts(config: Configuration, grip: Grip) -> GripContacts:
    """
    Find where the members touch the object.

    :param config: configuration of the robot.
    :param grip: the grip.
    :raises GraspError: no such member; or a member does not touch the object between its ends:
        it is off by more than a tube is thick.
    """
    nodes = find_members(config.robot, grip.members)
    starts = config.points[nodes.starts]
    spans = config.points[nodes.ends] - starts
    lengths = np.abs(spans)
    axes = spans / lengths
    center, own_radius = complex(*grip.body.center), 0.5 * grip.body.diameter
    local = axes.conj() * (center - starts)
    along, across = local.real, local.imag
    sides = np.sign(across)
    tube = config.robot.description.tube_diameter
    gaps, shares = np.abs(across) - (own_radius + 0.5 * tube), along / lengths
    # Lists: with two or three entries quicker than arrays.
    off, share = gaps.tolist(), shares.tolist()
    if not (-tube <= min(off) and max(off) <= tube and min(share) >= 0.0 and max(share) <= 1.0):
        raise GraspError(_explain(grip, gaps, np.maximum(-along, along - lengths), tube))
    normals = -1j * sides * axes
    return GripContacts(nodes, spans, axes, center + own_radius * normals, normals, sides)


def _explain(grip: Grip, gaps: Array, beyond: Array, tube: float) -> str:
    """Return what is wrong with the first member that does not touch the object."""
    number = int(np.flatnonzero((beyond > 0.0) | (np.abs(gaps) > tube))[0])
    x, y = grip.body.center
    what = f'the gap is {gaps[number]:.3g} m, within {tube:.3g} m in a grip'
    if beyond[number] > 0.0:
        what = f'it ends {beyond[number]:.3g} m before'
    return (
        f'member {grip.members[number]} does not touch the object at ({x:.4g}, {y:.4g}) m: '
        f'{what}; name the members that hold it, or give the centre in the robot frame'
    )
