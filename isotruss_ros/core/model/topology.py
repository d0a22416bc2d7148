# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Topology: names and index arrays of a robot's joints, modules and members."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from isotruss_ros.core.errors import GraspError, IsotrussError, quote, suggest
from isotruss_ros.core.model.description import RobotDescription
from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np


@dataclass(frozen=True, eq=False)
class Topology:
    """
    Names and index arrays of joints, modules i = 0..m-1, members and rollers.

    Modules are in the order of the robot file. The first nodes are the joints, followed by B and C
    of each module. Member i goes from B of module i to C of module `following[i]`, so members and
    modules have the same indices.
    """

    robot: str  #: name of the robot
    joint_names: tuple[str, ...]  #: names of the joints, in the order of the robot file
    module_names: tuple[str, ...]  #: names t/j of the modules, tube by tube
    #: names of the kinematic nodes: joints, then t/j/B and t/j/C of each module
    node_names: tuple[str, ...]
    member_names: tuple[str, ...]  #: names t/j-k of the members, in module order
    roller_names: tuple[str, ...]  #: names of the driven modules, in module order
    n_modules: int  #: number m of modules, equal to the number of members
    joint: Indices  #: (m,) index of node A of each module
    b: Indices  #: (m,) index of node B of each module
    c: Indices  #: (m,) index of node C of each module
    end: Indices  #: (m,) index of the node at each member's end: C of the following module
    following: Indices  #: (m,) index of the next module along the tube
    previous: Indices  #: (m,) index of the previous module along the tube
    tube: Indices  #: (m,) index of the tube of each module
    driven: Indices  #: (r,) indices of the modules with a motor
    grounded: Indices  #: (g,) grounded coordinates, numbered 2 node + (0 for x, 1 for y)
    ground: Array  #: (g,) values of the grounded coordinates [m]
    #: (m, r) incidence matrix C in Ldot = C phidot for members and rollers; its columns sum to
    #: zero over each tube, from which (13) follows
    incidence: Array


def make_topology(description: RobotDescription) -> Topology:
    """Return the topology of a robot, in the order of its file."""
    joints, tubes = tuple(description.joints), description.tubes
    # Modules (tube, joint), which are numbered one after the other along each closed tube.
    modules = [(tube, joint) for tube in tubes for joint in tube.joints]
    sizes, count = [len(tube.joints) for tube in tubes], len(modules)
    tube_modules = np.split(np.arange(count), np.cumsum(sizes)[:-1])
    following = np.concatenate([np.roll(numbers, -1) for numbers in tube_modules])
    module_names = tuple(f'{tube.name}/{joint}' for tube, joint in modules)
    driven = np.flatnonzero([joint != tube.passive for tube, joint in modules])
    # Nodes: the joints, followed by B and C of each module.
    b = len(joints) + 2 * np.arange(count)

    supports = [
        (joint, axis) for joint, axes in description.supports.items() for axis in sorted(axes)
    ]
    numbers = [2 * joints.index(joint) + 'xy'.index(axis) for joint, axis in supports]
    grounded = np.array(numbers, dtype=np.intp)
    coordinates = np.array(list(description.joints.values())).ravel()
    return Topology(
        robot=description.name,
        joint_names=joints,
        module_names=module_names,
        node_names=(*joints, *(f'{module}/{node}' for module in module_names for node in 'BC')),
        member_names=tuple(f'{module_names[i]}-{modules[j][1]}' for i, j in enumerate(following)),
        roller_names=tuple(module_names[i] for i in driven),
        n_modules=count,
        joint=np.array([joints.index(joint) for _, joint in modules], dtype=np.intp),
        b=b,
        c=b + 1,
        end=(b + 1)[following],
        following=following,
        previous=np.concatenate([np.roll(numbers, 1) for numbers in tube_modules]),
        tube=np.repeat(np.arange(len(tubes)), sizes),
        driven=driven,
        grounded=grounded,
        ground=coordinates[grounded],
        incidence=(np.eye(count) - np.eye(count)[following])[:, driven],
    )


def check_names(
    what: str,
    names: Iterable[str],
    valid: Collection[str],
    robot: str = '',
    error: type[IsotrussError] = GraspError,
) -> None:
    """Raise an error if a robot has no parts of these names; `what` ends with their kind."""
    kind = what.split()[-1]
    if isinstance(names, str) or not isinstance(names, Iterable):
        raise error(f'{what} {quote(str(names))}: must be a list of names')
    unknown = sorted({str(name) for name in names if name not in valid})
    if unknown:
        owner = f'robot {robot}' if robot else 'the robot'
        hint = ''.join(suggest(name, valid) for name in unknown)
        raise error(
            f'{what} {quote(", ".join(unknown))}: {owner} has no such {kind}; '
            f'{hint}its {kind.removesuffix("s")}s are {", ".join(valid)}'
        )
