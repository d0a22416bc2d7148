"""
The robot as a frame: nodes and members of each module (Fig. 1b), tubes, bisection (3).

A module's triangle ABC and its guide arms are rigid; the tube goes from C over the guide ring E
and from B over D. Constraints come with multipliers, so that the matrix of (4) is symmetric.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from isotruss_ros.core.arrays import finite_array
from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.frame import Frame, FrameState, Members
from isotruss_ros.core.tube_stiffness import tube_stiffness
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_matrix

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class Structure:
    """
    The frame of a robot in one configuration.

    Nodes are numbered joints first, then B, C, D, E of module after module. Members: AB, AC, BC,
    the arms BD and CE, the tube pieces BD and CE, and the long tube pieces DE'; m of each.

    :param config: where the robot is.
    :param pressure: (m,) of the tube in each member, gauge [Pa]; that of the robot file if None.
    :raises StructureError: the tube's stiffness laws contradict each other at a member's length.
    """

    def __init__(self, config: Configuration, pressure: Array | None = None) -> None:
        self.config = config
        self._pressure = config.robot.description.pressure if pressure is None else pressure
        layout = config.robot.layout
        m, joints = layout.n_modules, len(layout.joint_names)
        self._b = joints + 4 * np.arange(m)
        pinch = [f'{module}/{node}' for module in layout.module_names for node in 'BCDE']
        self.node_names = (*layout.joint_names, *pinch)
        self._places = {name: i for i, name in enumerate(self.node_names)}
        self.frame = Frame(
            self._points(), self._members(), self._held(), self.node_names, self._bisection()
        )

    def node(self, name: str) -> int:
        """
        Return the number of a node.

        :raises StructureError: there is no such node.
        """
        if name not in self._places:
            raise StructureError(
                f'node {name!r}: robot {self.config.robot.name} has no such node; '
                'nodes are joints j, and t/j/B, t/j/C, t/j/D, t/j/E of each module'
            )
        return self._places[name]

    def _points(self) -> NDArray[np.complex128]:
        layout, nodes = self.config.robot.layout, self.config.points
        side = nodes[layout.c[layout.following]] - nodes[layout.b]
        ahead = self.config.robot.description.module.guide_ring_distance * side / np.abs(side)
        points = np.empty(len(self.node_names), dtype=np.complex128)
        points[: len(layout.joint_names)] = nodes[: len(layout.joint_names)]
        points[self._b], points[self._b + 1] = nodes[layout.b], nodes[layout.c]
        points[self._b + 2] = nodes[layout.b] + ahead
        points[self._b + 3] = nodes[layout.c] - ahead[layout.previous]
        return points

    def _members(self) -> Members:
        layout, file = self.config.robot.layout, self.config.robot.description
        m = layout.n_modules
        a, b = layout.joint, self._b
        c, d, e = b + 1, b + 2, b + 3
        # The laws hold for whole members, pinch to pinch; pieces inherit the member's rigidities.
        tube = tube_stiffness(file).rigidities(self.config.member_lengths, self._pressure)
        before = layout.previous
        free, fixed = np.ones(m, dtype=bool), np.zeros(m, dtype=bool)
        rigid = [np.full(m, file.module.axial_rigidity)] * 5
        stiff = [np.full(m, file.module.flexural_rigidity)] * 5
        return Members(
            start=np.concatenate([a, a, b, b, c, b, c, d]),
            end=np.concatenate([b, c, c, d, e, d, e, e[layout.following]]),
            axial=np.concatenate([*rigid, tube.axial, tube.axial[before], tube.axial]),
            flexural=np.concatenate([*stiff, tube.flexural, tube.flexural[before], tube.flexural]),
            shear=np.concatenate(
                [np.full(5 * m, np.inf), tube.shear, tube.shear[before], tube.shear]
            ),
            pinned_start=np.concatenate([free, free, fixed, free, free, free, free, fixed]),
            pinned_end=np.concatenate([fixed, fixed, fixed, free, free, fixed, fixed, fixed]),
        )

    def _held(self) -> NDArray[np.bool_]:
        held = np.zeros((len(self.node_names), 3), dtype=bool)
        node, axis = np.divmod(self.config.robot.layout.grounded, 2)
        held[node, axis] = True
        return held

    def _bisection(self) -> coo_matrix:
        """Return A(x) of (4): the rod turns half as much as both arms together."""
        layout, points = self.config.robot.layout, self._points()
        a, b = layout.joint, self._b
        c, d, e = b + 1, b + 2, b + 3
        turn = 1j / (0.5 * (points[b] + points[c]) - points[a]).conj()
        arm_b, arm_c = 1j / (points[d] - points[b]).conj(), 1j / (points[e] - points[c]).conj()
        nodes = np.stack([a, b, c, d, e])
        gradients = np.stack([2.0 * turn, -arm_b - turn, -arm_c - turn, arm_b, arm_c])
        rows = np.tile(np.arange(layout.n_modules), 10)
        places = np.concatenate([3 * nodes.ravel(), 3 * nodes.ravel() + 1])
        values = np.concatenate([gradients.real.ravel(), gradients.imag.ravel()])
        shape = (layout.n_modules, 3 * len(self.node_names))
        return coo_matrix((values, (rows, places)), shape=shape)


@dataclass(frozen=True, eq=False)
class Deformation:
    """
    How the robot gives under loads.

    :ivar structure: the frame that was loaded.
    :ivar state: displacements, reactions and member forces of all its nodes and members.
    """

    structure: Structure
    state: FrameState

    def displacement(self, node: str) -> Array:
        """
        Return (ux, uy, theta) of a node [m, rad]; theta of a joint is 0, all is pinned there.

        :param node: a joint j, or t/j/B, t/j/C, t/j/D, t/j/E.
        :raises StructureError: there is no such node.
        """
        return self.state.displacements[self.structure.node(node)]

    @cached_property
    def reactions(self) -> dict[str, tuple[float, float]]:
        """Return the forces (rx, ry) of the supports on the robot by joint [N]."""
        return {
            joint: tuple(map(float, self.state.reactions[self.structure.node(joint), :2]))
            for joint in self.structure.config.robot.description.supports
        }

    @cached_property
    def end_forces(self) -> dict[str, Array]:
        """
        Return the forces on each member's long tube piece, DE', by member name.

        :return: (2, 3) at D and at E': along the member, across it [N], moment [N m].
        """
        names = self.structure.config.robot.member_names
        _, forces = np.split(self.state.end_forces, [-len(names)])
        return dict(zip(names, forces.reshape(-1, 2, 3), strict=True))


def deform(config: Configuration, joint_loads: Mapping[str, ArrayLike]) -> Deformation:
    """
    Return the displacements and reactions under forces on joints: equation (4).

    :param config: where the robot is; its rollers do not turn.
    :param joint_loads: (fx, fy) by joint [N].
    :raises StructureError: no such joint, loads that are not finite, or a structure that cannot
        carry them, with the name of what moves.
    """
    structure = config.structure
    loads = np.zeros((len(structure.node_names), 3))
    for joint, force in joint_loads.items():
        if joint not in config.robot.layout.joint_names:
            raise StructureError(
                f'joint {joint!r}: robot {config.robot.name} has no such joint; '
                f'its joints are {", ".join(config.robot.layout.joint_names)}'
            )
        what = f'the load (fx, fy) [N] on joint {joint}'
        loads[structure.node(joint), :2] = finite_array(force, 2, what, StructureError)
    return Deformation(structure, structure.frame.solve(loads))
