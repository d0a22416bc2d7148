"""
The robot as a frame: nodes and members of each module (Fig. 1b), tubes, bisection (3).

A module's triangle ABC is rigid; the tube goes from C through the guide ring E and from B through
D. The rings sit on arms that turn about B and C and are coupled by (3): they guide the tube
across, and it runs through them along. Constraints come with multipliers, so that the matrix of
(4) is symmetric.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import functools
from functools import cached_property

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.numerics.arrays import Array, finite_array, Flags, Indices, Points
from isotruss_ros.core.statics.frame import Frame, FrameState, Members
from isotruss_ros.core.statics.pressures import Pressure, tube_pressures
from isotruss_ros.core.statics.tube_stiffness import tube_stiffness
import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_matrix


class Structure:
    """
    The frame of a robot in one configuration.

    Nodes are numbered joints first, then B, C, D, E of module after module. Members: AB, AC, BC,
    the tube pieces BD and CE, and the long tube pieces DE'; m of each.

    :param config: where the robot is.
    :param pressure: gauge [Pa], see `tube_pressures`; that of the robot file if None.
    :ivar tube: how stiff the tube is.
    :ivar pressures: (t,) gauge pressure of each tube, in the order of the robot file [Pa].
    :raises StructureError: a pressure is not usable, or the stiffness model has no stiffness for a
        member's length and pressure.
    """

    def __init__(self, config: Configuration, pressure: Pressure | None = None) -> None:
        self.config = config
        self.tube = tube_stiffness(config.robot.description)
        self.pressures = tube_pressures(config.robot.description, pressure)
        topology = config.robot.topology
        m, joints = topology.n_modules, len(topology.joint_names)
        self._b = joints + 4 * np.arange(m)
        pinch = [f'{module}/{node}' for module in topology.module_names for node in 'BCDE']
        self.node_names = (*topology.joint_names, *pinch)
        self._places = {name: i for i, name in enumerate(self.node_names)}
        self.frame = Frame(
            self._points(), self._members(), self._held(), self.node_names, self._bisection()
        )

    def node(self, name: str) -> int:
        """
        Return the number of a node.

        :param name: a joint j, or t/j/B, t/j/C, t/j/D, t/j/E.
        :raises StructureError: there is no such node.
        """
        if name not in self._places:
            raise StructureError(
                f'node {name!r}: robot {self.config.robot.name} has no such node; '
                'nodes are joints j, and t/j/B, t/j/C, t/j/D, t/j/E of each module'
            )
        return self._places[name]

    def _points(self) -> Points:
        topology, nodes = self.config.robot.topology, self.config.points
        side = nodes[topology.c[topology.following]] - nodes[topology.b]
        ahead = self.config.robot.description.module.guide_ring_distance * side / np.abs(side)
        points = np.empty(len(self.node_names), dtype=np.complex128)
        points[: len(topology.joint_names)] = nodes[: len(topology.joint_names)]
        points[self._b], points[self._b + 1] = nodes[topology.b], nodes[topology.c]
        points[self._b + 2] = nodes[topology.b] + ahead
        points[self._b + 3] = nodes[topology.c] - ahead[topology.previous]
        return points

    def _members(self) -> Members:
        topology, file = self.config.robot.topology, self.config.robot.description
        m = topology.n_modules
        a, b = topology.joint, self._b
        c, d, e = b + 1, b + 2, b + 3
        # Section stiffness belongs to whole members, pinch to pinch; their pieces inherit it.
        pressure = np.array(self.pressures)[topology.tube]
        tube = self.tube.section_stiffness(self.config.member_lengths, pressure)
        before = topology.previous
        free, fixed = np.ones(m, dtype=bool), np.zeros(m, dtype=bool)
        rigid = [np.full(m, file.module.axial_rigidity)] * 3
        stiff = [np.full(m, file.module.flexural_rigidity)] * 3
        return Members(
            start=np.concatenate([a, a, b, b, c, d]),
            end=np.concatenate([b, c, c, d, e, e[topology.following]]),
            axial=np.concatenate([*rigid, tube.axial, tube.axial[before], tube.axial]),
            flexural=np.concatenate([*stiff, tube.flexural, tube.flexural[before], tube.flexural]),
            shear=np.concatenate(
                [np.full(3 * m, np.inf), tube.shear, tube.shear[before], tube.shear]
            ),
            pinned_start=np.concatenate([free, free, fixed, free, free, fixed]),
            pinned_end=np.zeros(6 * m, dtype=bool),
        )

    def _held(self) -> Flags:
        held = np.zeros((len(self.node_names), 3), dtype=bool)
        node, axis = np.divmod(self.config.robot.topology.grounded, 2)
        held[node, axis] = True
        return held

    def _bisection(self) -> coo_matrix:
        """Return A(x) of (4): the rod turns half as much as both arms together."""
        topology, points = self.config.robot.topology, self._points()
        a, b = topology.joint, self._b
        c, d, e = b + 1, b + 2, b + 3
        turn = 1j / (0.5 * (points[b] + points[c]) - points[a]).conj()
        arm_b, arm_c = 1j / (points[d] - points[b]).conj(), 1j / (points[e] - points[c]).conj()
        nodes = np.stack([a, b, c, d, e])
        gradients = np.stack([2.0 * turn, -arm_b - turn, -arm_c - turn, arm_b, arm_c])
        rows = np.tile(np.arange(topology.n_modules), 10)
        places = np.concatenate([3 * nodes.ravel(), 3 * nodes.ravel() + 1])
        values = np.concatenate([gradients.real.ravel(), gradients.imag.ravel()])
        shape = (topology.n_modules, 3 * len(self.node_names))
        return coo_matrix((values, (rows, places)), shape=shape)


def tube_pieces(n_modules: int) -> Indices:
    """
    Return the numbers of the tube's pieces among the members of a `Structure`'s frame.

    :param n_modules: m.
    :return: (3, m): BD and CE of each module, DE' of each member.
    """
    return np.arange(3 * n_modules, 6 * n_modules).reshape(3, -1)


def structure_of(config: Configuration, pressure: Pressure | None = None) -> Structure:
    """
    Return the frame of a robot in one configuration; the last few are kept.

    :param config: where the robot is.
    :param pressure: gauge [Pa], see `tube_pressures`; that of the robot file if None.
    :raises StructureError: see `Structure`.
    """
    return _structure(config, tube_pressures(config.robot.description, pressure))


@functools.lru_cache(maxsize=8)
def _structure(config: Configuration, pressures: tuple[float, ...]) -> Structure:
    return Structure(config, pressures)


@dataclass(frozen=True, eq=False)
class Deformation:
    """
    The response of the robot to loads.

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


def deform(
    config: Configuration,
    joint_loads: Mapping[str, ArrayLike],
    pressure: Pressure | None = None,
) -> Deformation:
    """
    Return the displacements and reactions under forces on joints: equation (4).

    :param config: where the robot is; its rollers do not turn.
    :param joint_loads: (fx, fy) by joint, robot frame [N].
    :param pressure: gauge, measured [Pa]: one number for all tubes, one for each tube, or by tube
        name; that of the robot file if None.
    :raises StructureError: no such joint, loads that are not finite, a pressure that is not
        usable, or a structure that cannot carry the loads, with the name of what moves.
    """
    structure = structure_of(config, pressure)
    loads = np.zeros((len(structure.node_names), 3))
    for joint, force in joint_loads.items():
        if joint not in config.robot.topology.joint_names:
            raise StructureError(
                f'joint {joint!r}: robot {config.robot.name} has no such joint; '
                f'its joints are {", ".join(config.robot.topology.joint_names)}'
            )
        what = f'the load (fx, fy) [N] on joint {joint}'
        loads[structure.node(joint), :2] = finite_array(force, 2, what, StructureError)
    return Deformation(structure, structure.frame.solve(loads))
