# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Deformation of the robot under loads, equations (1) and (4), and sag under its weight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

from isotruss_ros.core.errors import SolverError, StructureError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.topology import check_names
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import Array, finite_array, MAX_LOAD
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.statics.frame import Frame, keep_apart, largest_motion
from isotruss_ros.core.statics.structure import Structure, structure_of
from isotruss_ros.core.statics.tangent import (
    bend,
    follow_loads,
    FrameState,
    linearize,
    solve,
    state_under,
    Tangent,
)
from isotruss_ros.core.statics.tube_stiffness import Pressure
from isotruss_ros.core.statics.wrinkling import find_utilisation
import numpy as np
from numpy.typing import ArrayLike

#: Largest load factor up to which a limit load is searched [-].
MAX_LIMIT_FACTOR = 100.0
#: The frame linearised about the loaded state predicts displacements without loads; they should be
#: zero. If they exceed this fraction of the displacements under load [-], loads are applied in
#: steps: of 971 random loads, 14 exceeded a limit load, and their fractions were 0.49 or more.
MAX_UNLOADED_SHARE = 0.3
#: An upright robot exceeds both bounds: fraction of the squared displacements that the weight
#: explains [-], and largest displacement of a joint [m]. A robot that lies flat exceeds both in
#: one of a hundred cases, if its roller offsets are 10 mm.
MIN_EXPLAINED_SHARE, MIN_SAG = 0.95, 5e-3


@dataclass(frozen=True, eq=False, repr=False)
class Deformation(Record, headline=('reactions', 'displacements')):
    """
    Displacements, reactions and member forces of the robot under loads.

    The frame has additional nodes at the loads on tubes; its loads are (n, 3) fx, fy [N], m [N m].
    """

    structure: Structure = field(repr=False)
    frame: Frame = field(repr=False)
    loads: Array = field(repr=False)
    state: FrameState = field(repr=False)

    def displacement(self, node: str) -> Array:
        """Return (ux, uy, theta) of a node [m, rad]; theta of a pinned joint is 0."""
        return self.state.displacements[self.structure.node(node)]

    @cached_property
    def displacements(self) -> dict[str, tuple[float, float, float]]:
        """Return (ux, uy, theta) [m, rad] for the name of each node, see `displacement`."""
        displaced = map(tuple, self.state.displacements.tolist())
        return dict(zip(self.structure.node_names, displaced, strict=False))  # not those at cuts

    @cached_property
    def reactions(self) -> dict[str, tuple[float, float]]:
        """Return the force (rx, ry) of each support on the robot [N], by the joint's name."""
        supports = self.structure.config.robot.description.supports
        forces = self.state.reactions[:, :2].tolist()
        return {joint: tuple(forces[self.structure.node(joint)]) for joint in supports}

    @cached_property
    def utilisation(self) -> dict[str, float]:
        """
        Return the largest ratio of bending moment to wrinkling moment of each member [-].

        Moments inside members, which compression amplifies, are included. At 1 and above the tube
        wrinkles, and the model no longer holds.
        """
        forces = self.state.end_forces, self.state.bowing
        used = find_utilisation(self.structure, self.frame, *forces).used
        return dict(zip(self.structure.config.robot.member_names, used.tolist(), strict=True))

    @single_threaded
    def limit_factor(self) -> float:
        """
        Return the factor on all loads at which the structure becomes unstable [-].

        Infinity is returned if the factor exceeds 100.
        """
        path = follow_loads(_unloaded(self.structure, self.frame), self.loads, MAX_LIMIT_FACTOR)
        if path.limit == np.inf and path.factors[-1] < MAX_LIMIT_FACTOR:
            farthest = largest_motion(path.tangents[-1].displacements)
            raise SolverError(
                f'no limit load up to {path.factors[-1]:.3g} times these loads; the search '
                f'ended there, because the robot had moved by {farthest:.3g} m'
            )
        return path.limit


@check_kinds
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
    Compute displacements and reactions under loads by (1) and (4), with large bending.

    :param config: configuration of the robot, with rollers at rest.
    :param joint_loads: force (fx, fy) for each joint name, robot frame [N]. Joints are hinges and
        transmit no moment.
    :param pressure: gauge pressure from 1e3 to 3e5 [Pa], given as one number for all tubes, as one
        number for each tube, or as a mapping from tube names to pressures. If None, the pressure
        of the robot file is used.
    :param module_loads: load (fx, fy, m) for each module name, acting at the midpoint of the
        module's pinch points [N, N m].
    :param tube_loads: array (l, 4) for each member name. A row is (s, fx, fy, m), with the
        distance s of the load from the member's start [m, N, N m].
    :param paper_model: True for the paper's model, which is linear, with straight tubes under all
        loads.
    :raises StructureError: the robot has no such joint, module or member; a load is not finite,
        larger than 1e6 N or N m, or outside of its member; a pressure is invalid; the robot is a
        mechanism (the message names the moving parts); or the loads exceed the limit load (the
        message names it).
    """
    structure = structure_of(config, pressure)
    robot = config.robot
    frame, loads = _load_tubes(structure, tube_loads or {})
    check_names('joint', joint_loads, robot.topology.joint_names, robot.name, StructureError)
    for joint, force in joint_loads.items():
        what = f'the load (fx, fy) [N] on joint {joint}'
        loads[structure.node(joint), :2] += finite_array(force, 2, what, StructureError, MAX_LOAD)
    module_loads = module_loads or {}
    check_names('module', module_loads, robot.module_names, robot.name, StructureError)
    for module, load in module_loads.items():
        what = f'the load (fx, fy, m) [N, N m] on module {module}'
        half = 0.5 * finite_array(load, 3, what, StructureError, MAX_LOAD)
        for node in 'BC':
            loads[structure.node(f'{module}/{node}')] += half
    straight = _unloaded(structure, frame)
    state = solve(straight, loads) if paper_model else _bend(straight, loads)
    return Deformation(structure, frame, loads, state)


def _unloaded(structure: Structure, frame: Frame) -> Tangent:
    """Return a frame of a structure, which may have cuts, linearised without loads."""
    straight, _ = structure.unloaded
    return straight if frame is structure.frame else linearize(frame, np.zeros(len(frame.scale)))


def _load_tubes(structure: Structure, tube_loads: Mapping[str, ArrayLike]) -> tuple[Frame, Array]:
    """Return the frame with nodes at the loads on tubes, and the loads (n, 3) on all nodes."""
    config, names = structure.config, structure.config.robot.member_names
    rows, members = [], []
    check_names('member', tube_loads, names, config.robot.name, StructureError)
    for member, of_member in tube_loads.items():
        number = names.index(member)
        length = float(config.member_lengths[number])
        for row in np.reshape(np.asarray(of_member, dtype=float), (-1, 4)):
            what = f'the load (place, fx, fy, m) [m, N, N m] on member {member}'
            load = finite_array(row, 4, what, StructureError, MAX_LOAD)
            if not 0.0 < load[0] < length:
                raise StructureError(
                    f'a load at {load[0]:g} m of member {member}: must be between its ends, '
                    f'0 and {length:.6g} m'
                )
            rows.append(load)
            members.append(number)
    if not rows:
        return structure.frame, np.zeros((len(structure.node_names), 3))
    table = np.array(rows)
    pieces, within, _ = structure.locate(np.array(members), table[:, 0])
    frame = structure.frame.cut(pieces, keep_apart(pieces, within, structure.frame.length[pieces]))
    loads = np.zeros((len(frame.points), 3))
    loads[frame.layout.nodes] = table[:, 1:]
    return frame, loads


def _bend(straight: Tangent, loads: Array) -> FrameState:
    """Return displacements, reactions and member forces of a bent frame in equilibrium."""
    bent = bend(straight, loads)
    if bent is not None:
        by_loads = bent.frame.displacements(bent.respond(loads.reshape(-1, 1))[:, 0])
        largest_unloaded = largest_motion(bent.displacements - by_loads)
        largest = largest_motion(bent.displacements)
        if largest_unloaded <= MAX_UNLOADED_SHARE * largest and bent.is_stable:
            return state_under(bent, loads)
    path = follow_loads(straight, loads, 1.0)
    if path.factors[-1] < 1.0:
        raise StructureError(
            'the loads are beyond the limit load: the structure is unstable at '
            f'{path.factors[-1]:.4g} times these loads; must be smaller'
        )
    return state_under(path.tangents[-1], loads)


class Sag(NamedTuple):
    """Weight of each module, fitted to measured displacements of the joints."""

    weight: Array  #: (2,) weight of each module, robot frame [N]
    explained: float  #: share of the squared displacements that the weight explains [-]
    largest: float  #: largest displacement of a joint [m]

    def __str__(self) -> str:
        """Return a sentence with the fitted weight and the displacements."""
        x, y = self.weight.tolist()
        return (
            f'the joints hang by up to {1e3 * self.largest:.0f} mm as if each module weighed '
            f'({x:.1f}, {y:.1f}) N: the robot stands upright or on a slope, and gravity is not in '
            'the model: lay it flat'
        )

    @property
    def is_upright(self) -> bool:
        """Return whether weight explains the displacements, as it does in an upright robot."""
        return self.explained > MIN_EXPLAINED_SHARE and self.largest > MIN_SAG


def find_sag(config: Configuration, joints: Mapping[str, tuple[float, float]]) -> Sag | None:
    """
    Fit an equal weight of all modules to measured joints; None if too few are measured.

    :param joints: measured position (x, y) for the name of each joint, robot frame [m].
    """
    if 2 * len(joints) <= len(config.roller_positions):
        return None  # roller offsets alone can explain the displacements
    names = config.robot.topology.joint_names
    home = config.nodes[[names.index(name) for name in joints]]
    displacements = (np.array(list(joints.values())) - home).ravel()
    by_weight = sag_rates(config, tuple(joints))
    weight, *_ = np.linalg.lstsq(by_weight, displacements, rcond=None)
    error = displacements - by_weight @ weight
    largest = float(np.hypot(*displacements.reshape(-1, 2).T).max())
    unexplained = float(error @ error) / max(float(displacements @ displacements), 1e-18)
    return Sag(weight, 1.0 - unexplained, largest)


def sag_rates(config: Configuration, joints: Sequence[str]) -> Array:
    """Return derivatives (2k, 2) of joint positions by an equal weight (x, y) of all modules."""
    rates = np.empty((2 * len(joints), 2))
    for column, unit_weight in enumerate(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))):
        loads = dict.fromkeys(config.robot.module_names, unit_weight)
        sagged = deform(config, {}, module_loads=loads, paper_model=True)
        rates[:, column] = np.concatenate([sagged.displacement(joint)[:2] for joint in joints])
    return rates
