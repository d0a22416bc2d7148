# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Topology: names and index arrays of a robot's joints, modules and members."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

from isotruss_ros.core.errors import GraspError, quote
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

    joint_names: tuple[str, ...]  #: names of the joints, in the order of the robot file
    module_names: tuple[str, ...]  #: names t/j of the modules, tube by tube
    joint: Indices  #: (m,) index of node A of each module
    following: Indices  #: (m,) index of the next module along the tube
    previous: Indices  #: (m,) index of the previous module along the tube
    tube: Indices  #: (m,) index of the tube of each module
    driven: Indices  #: (r,) indices of the modules with a motor
    grounded: Indices  #: (g,) grounded coordinates, numbered 2 node + (0 for x, 1 for y)
    ground: Array  #: (g,) values of the grounded coordinates [m]

    @cached_property
    def n_modules(self) -> int:
        """Return the number of modules, equal to the number of members."""
        return len(self.module_names)

    @cached_property
    def n_nodes(self) -> int:
        """Return the number of kinematic nodes: joints and pinch points."""
        return len(self.joint_names) + 2 * self.n_modules

    @cached_property
    def b(self) -> Indices:
        """Return the index of node B of each module, (m,)."""
        return len(self.joint_names) + 2 * np.arange(self.n_modules)

    @cached_property
    def c(self) -> Indices:
        """Return the index of node C of each module, (m,)."""
        return self.b + 1

    @cached_property
    def end(self) -> Indices:
        """Return the index (m,) of the node at each member's end: C of the following module."""
        return self.c[self.following]

    @cached_property
    def node_names(self) -> tuple[str, ...]:
        """Return the names of the kinematic nodes: joints, then t/j/B and t/j/C of each module."""
        pinch = [f'{module}/{node}' for module in self.module_names for node in 'BC']
        return (*self.joint_names, *pinch)

    @cached_property
    def member_names(self) -> tuple[str, ...]:
        """Return the names t/j-k of the members, in module order."""
        ends = self.joint[self.following]
        return tuple(
            f'{module}-{self.joint_names[end]}'
            for module, end in zip(self.module_names, ends, strict=True)
        )

    @cached_property
    def roller_names(self) -> tuple[str, ...]:
        """Return the names of the driven modules, in module order."""
        return tuple(self.module_names[i] for i in self.driven)

    @cached_property
    def incidence(self) -> Array:
        """
        Return the incidence matrix C (m, r) in Ldot = C phidot for members and rollers.

        The columns of C sum to zero over each tube, from which (13) follows.
        """
        matrix = np.zeros((self.n_modules, self.n_modules))
        members = np.arange(self.n_modules)
        matrix[members, members] = 1.0
        matrix[members, self.following] = -1.0
        return matrix[:, self.driven]


def make_topology(description: RobotDescription) -> Topology:
    """Return the topology of a robot, in the order of its file."""
    joint_names = tuple(description.joints)
    number = {name: index for index, name in enumerate(joint_names)}
    tubes = description.tubes
    modules = [(tube, name) for tube in tubes for name in tube.joints]
    sizes = [len(tube.joints) for tube in tubes]
    # The modules of a tube are numbered one after the other, and it is closed.
    by_tube = np.split(np.arange(len(modules)), np.cumsum(sizes)[:-1])
    grounded = [
        2 * number[name] + 'xy'.index(axis)
        for name, axes in description.supports.items()
        for axis in sorted(axes)
    ]
    coordinates = np.array(list(description.joints.values())).ravel()
    return Topology(
        joint_names=joint_names,
        module_names=tuple(f'{tube.name}/{name}' for tube, name in modules),
        joint=np.array([number[name] for _, name in modules], dtype=np.intp),
        following=np.concatenate([np.roll(modules, -1) for modules in by_tube]),
        previous=np.concatenate([np.roll(modules, 1) for modules in by_tube]),
        tube=np.repeat(np.arange(len(tubes)), sizes),
        driven=np.flatnonzero([name != tube.passive for tube, name in modules]),
        grounded=np.array(grounded, dtype=np.intp),
        ground=coordinates[np.array(grounded, dtype=np.intp)],
    )


def check_roller_names(what: str, names: Iterable[str], roller_names: Sequence[str]) -> None:
    """Raise GraspError if names do not belong to rollers."""
    unknown = frozenset(names) - frozenset(roller_names)
    if unknown:
        listed = quote(', '.join(sorted(map(str, unknown))))
        raise GraspError(
            f'{what}: {listed}: the robot has no such rollers; '
            f'its rollers are {", ".join(roller_names)}'
        )
