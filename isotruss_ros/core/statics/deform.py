# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Deformation of the robot under loads: equations (1) and (4)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from isotruss_ros.core.errors import SolverError, StructureError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.numerics.arrays import Array, finite_array
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.statics.bent_tubes import SHORTEST_PART
from isotruss_ros.core.statics.cut_frame import CutFrame, keep_apart
from isotruss_ros.core.statics.frame import Frame, FrameState
from isotruss_ros.core.statics.load_path import follow_loads
from isotruss_ros.core.statics.section import Pressure
from isotruss_ros.core.statics.structure import Structure, structure_of
from isotruss_ros.core.statics.wrinkling import find_utilisation
import numpy as np
from numpy.typing import ArrayLike

#: Largest searched limit load factor [-].
MAX_LIMIT_FACTOR = 100.0
#: Loads are applied in steps if the tangent, unloaded, misses the straight structure by a larger
#: share of the displacements [-]: of 971 random loads 14 led beyond a limit load, by 0.49 or more.
MAX_UNLOADED_SHARE = 0.3


@dataclass(frozen=True, eq=False, repr=False)
class Deformation(Record, headline=('reactions', 'displacements')):
    """
    Response of the robot to loads.

    :ivar structure: frame of the robot.
    :ivar frame: frame of the structure, cut at loads on tubes.
    :ivar loads: (n, 3) fx, fy [N], m [N m] on its nodes.
    :ivar state: displacements, reactions and member forces of all its nodes and members.
    """

    structure: Structure = field(repr=False)
    frame: Frame = field(repr=False)
    loads: Array = field(repr=False)
    state: FrameState = field(repr=False)

    def displacement(self, node: str) -> Array:
        """
        Return (ux, uy, theta) of a node [m, rad]; theta of a pinned joint is 0.

        :param node: a joint j, or t/j/B, t/j/C, t/j/D, t/j/E.
        :raises StructureError: there is no such node.
        """
        return self.state.displacements[self.structure.node(node)]

    @cached_property
    def displacements(self) -> dict[str, tuple[float, float, float]]:
        """Return (ux, uy, theta) by the name of the node [m, rad], see `displacement`."""
        found = self.state.displacements.tolist()
        return {
            name: tuple(found[self.structure.node(name)]) for name in self.structure.node_names
        }

    @cached_property
    def reactions(self) -> dict[str, tuple[float, float]]:
        """Return the forces (rx, ry) of the supports on the robot by joint [N]."""
        return {
            joint: (float(self.state.reactions[node, 0]), float(self.state.reactions[node, 1]))
            for joint in self.structure.config.robot.description.supports
            for node in (self.structure.node(joint),)
        }

    @cached_property
    def utilisation(self) -> dict[str, float]:
        """
        Return the largest bending moment over the wrinkling moment, by member [-].

        It includes moments inside members, amplified by compression. From 1 on a tube wrinkles,
        and the results are outside of the model.
        """
        forces = self.state.end_forces, self.state.bowing
        used = find_utilisation(self.structure, self.frame, *forces).used
        return dict(zip(self.structure.config.robot.member_names, used.tolist(), strict=True))

    @single_threaded
    def limit_factor(self) -> float:
        """
        Return the factor on the loads at the limit load of the bent structure [-].

        Infinite beyond 100 times the loads.

        :raises SolverError: neither was reached, since the displacements are too large.
        """
        path = follow_loads(self.frame, self.loads, MAX_LIMIT_FACTOR)
        if path.limit == np.inf and path.factors[-1] < MAX_LIMIT_FACTOR:
            farthest = np.abs(path.tangents[-1].displacements[:, :2]).max()
            raise SolverError(
                f'no limit load up to {path.factors[-1]:.3g} times these loads, and farther is '
                f'not searched: the robot moves by {farthest:.3g} m'
            )
        return path.limit


@single_threaded
def deform(
    config: Configuration,
    joint_loads: Mapping[str, ArrayLike],
    pressure: Pressure | None = None,
    *,
    module_loads: Mapping[str, ArrayLike] | None = None,
    tube_loads: Mapping[str, ArrayLike] | None = None,
    paper_model: bool = False,
) -> Deformation:
    """
    Return displacements and reactions under loads, with large bending: (1) and (4).

    :param config: configuration of the robot, with rollers at rest.
    :param joint_loads: (fx, fy) by joint, robot frame [N]; joints are hinges without moment.
    :param pressure: gauge pressure [Pa]: one for all tubes, one for each, or by tube name; None:
        that of the robot file.
    :param module_loads: (fx, fy, m) by module, in the middle of its pinch points [N, N m].
    :param tube_loads: (l, 4) by member, each (place, fx, fy, m) at a distance from the member's
        start, between its ends [m, N, N m].
    :param paper_model: structure linear about straight tubes, as in the paper.
    :raises StructureError: no such joint, module or member, loads that are not finite, a place
        beyond a member, an invalid pressure, a mechanism (names the moving parts), or loads
        beyond the limit load (names it).
    """
    structure = structure_of(config, pressure)
    robot = config.robot
    frame, loads = _load_tubes(structure, tube_loads or {})
    for joint, force in joint_loads.items():
        _check_name('joint', joint, robot.topology.joint_names, robot.name)
        what = f'the load (fx, fy) [N] on joint {joint}'
        loads[structure.node(joint), :2] += finite_array(force, 2, what, StructureError)
    for module, load in (module_loads or {}).items():
        _check_name('module', module, robot.module_names, robot.name)
        what = f'the load (fx, fy, m) [N, N m] on module {module}'
        half = 0.5 * finite_array(load, 3, what, StructureError)
        for node in 'BC':
            loads[structure.node(f'{module}/{node}')] += half
    state = frame.solve(loads) if paper_model else _bend(frame, loads)
    return Deformation(structure, frame, loads, state)


def _load_tubes(structure: Structure, tube_loads: Mapping[str, ArrayLike]) -> tuple[Frame, Array]:
    """Return the frame cut at loads on tubes, and the nodal loads (n, 3)."""
    config, rows, members = structure.config, [], []
    names = config.robot.member_names
    for member, given in tube_loads.items():
        _check_name('member', member, names, config.robot.name)
        number = names.index(member)
        for load in np.reshape(np.asarray(given, dtype=float), (-1, 4)):
            what = f'the load (place, fx, fy, m) [m, N, N m] on member {member}'
            rows.append(finite_array(load, 4, what, StructureError))
            length = float(config.member_lengths[number])
            if not 0.0 < load[0] < length:
                raise StructureError(
                    f'a load at {load[0]:g} m of member {member}: must be between its ends, '
                    f'0 and {length:.6g} m'
                )
            members.append(number)
    if not rows:
        return structure.frame, np.zeros((len(structure.node_names), 3))
    place, *load = np.array(rows).T
    pieces, within, _ = structure.locate(np.array(members), place)
    # Loads do not move the places: parts may be a thousandth as long as those that do.
    apart = keep_apart(pieces, within, structure.frame.length[pieces], 1e-3 * SHORTEST_PART)
    cut = CutFrame(structure.frame, pieces, apart)
    loads = np.zeros((len(cut.points), 3))
    loads[cut.nodes] = np.stack(load, axis=1)
    return cut, loads


def _bend(frame: Frame, loads: Array) -> FrameState:
    """Return the equilibrium of the bent frame under loads."""
    with np.errstate(over='ignore', invalid='ignore'):
        found = frame.bend(loads)
    if found is None:
        frame.solve(loads)  # refuses what is beyond all numbers
    else:
        moved = found.displacements
        left = moved - found.respond(loads.reshape(-1, 1))[0].reshape(-1, 3)
        near = np.abs(left[:, :2]).max() <= MAX_UNLOADED_SHARE * np.abs(moved[:, :2]).max()
        if near and frame.is_stable(found):
            return frame.state(found, loads)
    path = follow_loads(frame, loads, 1.0)
    if path.factors[-1] < 1.0:
        limit = min(path.limit, path.factors[-1])
        raise StructureError(
            f'the loads are beyond the limit load: the structure gives way at {limit:.4g} '
            'times these loads; must be smaller'
        )
    return frame.state(path.tangents[-1], loads)


def _check_name(kind: str, name: str, known: Iterable[str], robot: str) -> None:
    """Raise for unknown names of parts."""
    if name not in known:
        raise StructureError(
            f'{kind} {name!r}: robot {robot} has no such {kind}; '
            f'its {kind}s are {", ".join(known)}'
        )
