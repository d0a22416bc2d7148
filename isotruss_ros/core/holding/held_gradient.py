# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Derivatives of a held object's equilibrium and the loaded robot with respect to parameters.

From the equilibrium equations F(y, x) = 0 follows y' = -F_y^-1 F_x.
"""

from __future__ import annotations

import copy
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.contact_statics import object_angles
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.pressed_contacts import ANGLE, POSE
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.tolerances import EPSILON, ROUNDING
from isotruss_ros.core.statics.bent_tubes import BentTubes, FOLLOWED_MOTION
from isotruss_ros.core.statics.structure import section_rates
from isotruss_ros.core.statics.wrinkling import evaluate_utilisation, find_utilisation
import numpy as np


class GraspParameters(NamedTuple):
    """Indices of the columns that belong to each of the p parameters in a gradient."""

    rollers: slice  #: travel of the r rollers [m]
    place: slice  #: x, y and angle of the object's given pose [m, rad]
    pressures: slice  #: gauge pressures of the t tubes, in the order of the robot file [Pa]
    friction: int  #: coefficient of friction [-]
    wrench: slice  #: wrench fx, fy, m on the object [N, N m]
    stiffness: int  #: ratio of the robot's true stiffness to its modelled stiffness [-]
    size: int  #: number p of the parameters

    @classmethod
    def of(cls, config: Configuration) -> GraspParameters:
        """Return the column indices of all parameters of grasps by a robot."""
        rollers = len(config.roller_positions)
        tubes = rollers + 3 + len(config.robot.description.pressures)
        return cls(
            rollers=slice(0, rollers),
            place=slice(rollers, rollers + 3),
            pressures=slice(rollers + 3, tubes),
            friction=tubes,
            wrench=slice(tubes + 1, tubes + 4),
            stiffness=tubes + 4,
            size=tubes + 5,
        )


class TubeRates(NamedTuple):
    """Derivatives of the tubes' displacements and forces with respect to p parameters."""

    give: Points  #: (k, p) of the contact points, along + i across the members [m]
    slope: Array  #: (k, p) of the bent centre lines' inclinations at the contacts [rad]
    nodes: Array  #: (n, 3, p) of the displacements of the frame's nodes [m, rad]
    forces: Array  #: (c, 3, p) of the `EndForces` of the frame's parts with fixed nodes


class LoadedTubes:
    """
    Bent tubes of a robot with a held object, with derivatives along p parameter changes.

    Each column of `chosen` (n, p) is a direction of change of the n parameters. The tubes are
    linearised again if a node has moved by more than `reach` [m]. The derivatives `spins` (k, p)
    are those of the directions of the contacts' members [rad].
    """

    def __init__(
        self, grip: HeldGrip, chosen: Array, parameters: GraspParameters, reach: float = ROUNDING
    ) -> None:
        if grip.response is None:
            raise GraspError(
                'the equilibrium is neutral, so it has no derivatives: it must resist every motion'
            )
        self._chosen, self._parameters = chosen, parameters
        topology, members = grip.config.robot.topology, grip.contacts.members
        by_rollers = grip.config.node_jacobian.T.copy().view(np.complex128).T
        self.moved = by_rollers @ chosen[parameters.rollers]
        self._starts, lines = self.moved[topology.b[members]], grip.statics.bent.lines
        ahead = self.moved[topology.end[members]] - self._starts
        self.spins = (ahead / (lines.length * lines.axis)[:, None]).imag
        self._inflated = chosen[parameters.pressures]
        self._stiffer = chosen[parameters.stiffness] / grip.statics.bent.stiffness
        bent, state = grip.statics.bent, grip.state
        if bent.distance(state.loads, state.feet) > reach:
            bent = bent.update(state.loads, state.feet)
        bent = bent.activated()
        self.sections = section_rates(bent.structure, bent.frame, self.moved, self._inflated)
        self._load(grip, bent)

    def _load(self, grip: HeldGrip, bent: BentTubes) -> None:
        """Set grip and tubes; compute the tubes' derivatives with respect to section changes."""
        self._grip, self._bent, state, statics = grip, bent, grip.state, grip.statics
        self._by_sections = bent.section_changes(self.sections)
        normal, tube = state.normal_forces, grip.config.robot.topology.tube
        self._push = (normal + 1j * state.friction_forces) * state.normals
        angles = object_angles(state.unknowns, state.normals)
        depths, self._soft, self._tilts = statics.dents(normal, angles)
        self._skin = statics.tube_radius - depths
        by_pressure = statics.dents.pressure_rates(normal, angles)[:, None]
        self.dents = by_pressure * self._inflated[tube[grip.contacts.members]]
        self.dents -= np.outer(self._soft * normal, self._stiffer)
        self.dents += self._tilts[:, None] * self.spins

    def at(self, grip: HeldGrip) -> LoadedTubes:
        """Return the derivatives at another equilibrium in the same configuration."""
        other = copy.copy(self)
        other._load(grip, grip.statics.bent)
        return other

    def equation_rates(self, sticks: bool = False) -> Array:
        """Return the equations' derivatives (3 + 4k, p), also with sticking contacts."""
        grip, spins = self._grip, self.spins
        statics, state, body = grip.statics, grip.state, grip.body
        indices, normals = state.places, state.normals[:, None]
        axis = self._bent.lines.axis[:, None]
        give, slope, *_ = self.respond(np.zeros((indices.size, spins.shape[1])))
        points, radii = body.shape.surface_at(statics.contacts.corners, state.normals / body.turn)
        # The contact points move on the surface, because the normals turn with the members.
        arms, swept = (body.turn * points)[:, None], 1j * radii[:, None] * spins * normals
        away = self._bent.lines.start[:, None] - body.center - arms
        gap = self._starts - swept - 1j * spins * away + self.dents * normals
        gap = gap / axis + give
        forces = self._push[:, None]
        turned = 1j * spins * forces
        torque = (swept.conj() * forces + arms.conj() * turned).imag.sum(axis=0)
        total = turned.sum(axis=0)
        wrench = self._chosen[self._parameters.wrench] / np.array([[1.0], [1.0], [grip.arm]])
        # The conditions depend on the normals, which turn with the members.
        closing = state.jacobian[indices.conditions]
        if sticks:
            closing = statics.rolling_rows(state.unknowns, state.normals)
        closure = closing[:, indices.inclinations] @ spins
        if not sticks:
            # Other conditions depend on the pose relative to the measured pose. They use the
            # centroid, which has turned about the origin since the measurement.
            place, measured = self._chosen[self._parameters.place], statics.body
            still = measured.middle - measured.center - (body.middle - body.center)
            place = place + np.array([[-still.imag], [still.real], [0.0]]) * place[2]
            closure -= closing[:, :3] @ place
        balance = wrench - np.stack([total.real, total.imag, torque / grip.arm])
        touch = np.stack([gap.real, gap.imag, slope], axis=1).reshape(3 * len(gap), -1)
        return np.concatenate([touch, balance, closure])

    def respond(self, change: Array) -> TubeRates:
        """Return the tubes' derivatives, given those (3 + 4k, p) of the equilibrium's unknowns."""
        bent, state = self._bent, self._grip.state
        nodes_at, tangent, axis = bent.frame.layout.nodes, bent.tangent, bent.lines.axis[:, None]
        feet, inclined, normal, rubs = change[POSE:].reshape(4, len(axis), -1)
        forces = (normal + 1j * rubs) * state.normals[:, None]
        forces += 1j * (self.spins + inclined) * self._push[:, None]
        dented = self.dents + self._soft[:, None] * normal
        dented += self._tilts[:, None] * (inclined - change[ANGLE])
        couples = dented * state.friction_forces[:, None] - self._skin[:, None] * rubs
        local = forces / axis
        loads = np.stack([local.real, local.imag, couples], axis=1)
        # A robot that is stiffer by a fraction deforms as under loads smaller by this fraction.
        loads -= state.loads[..., None] * self._stiffer
        by_sections, turned, rates = self._by_sections
        moved, slope, by_places = bent.changes(loads, feet)
        nodes = by_sections + moved
        still = tangent.displacements[nodes_at]
        there = bent.lines.axis * state.feet + still[:, 0] + 1j * still[:, 1]
        give = nodes[nodes_at, 0] + 1j * nodes[nodes_at, 1]
        give -= self._starts + 1j * self.spins * there[:, None]
        # The displacement is relative to the contact, which moves along its member.
        give = give / axis - feet
        slope += turned - self.spins
        return TubeRates(give, slope, nodes, rates + by_places)

    def utilisation(self, rates: TubeRates) -> tuple[Array, Array]:
        """Return the members' utilisations (m,), and their derivatives (m, p)."""
        grip, bent, robot = self._grip, self._bent, self._grip.config.robot
        frame, (forces, bowing) = bent.frame, bent.end_forces(grip.state.loads, grip.state.feet)
        most = find_utilisation(bent.structure, frame, forces, bowing)
        radius = 0.5 * robot.description.tube_diameter
        tube, piece = robot.topology.tube, most.piece
        wall = np.pi * radius**2 * np.array(bent.structure.pressures)[tube]
        ends = forces[piece]
        loads = np.stack([-ends[:, 2], ends[:, 5], ends[:, 3] + wall, bowing[piece]])
        force_rates = (rates.forces + bent.tangent.force_changes(rates.nodes)[0])[piece]
        # Rows: axial force and moments at both ends.
        by_end = np.array([[1.0, 0.0, 0.0], [0.0, 0.5, 0.5], [0.0, 0.5, -0.5]])
        changes = np.tensordot(by_end, bent.stiffness * force_rates, (1, 1))
        pull, first, second = changes + ends.T[[3, 2, 5], :, None] * self._stiffer
        pulled = pull + np.pi * radius**2 * self._inflated[tube]
        changes = np.stack([-first, second, pulled, force_rates[:, 0]])
        sections = np.vstack([frame.length[piece], frame.section[1:, piece]])
        others = self.sections[[0, 2, 3]][:, piece]
        # Complex step at the same kind of place. The utilisation of a tube without wall tension is
        # infinite and has no derivative.
        step = 1j * EPSILON
        used, _ = evaluate_utilisation(
            loads[..., None] + step * changes, sections[..., None] + step * others, radius
        )
        return most.used, np.take_along_axis(used, most.kind[None, :, None], 0)[0].imag / EPSILON


class HeldGradient(NamedTuple):
    """
    Derivatives of pose, normal forces and joint positions of a held object.

    The p = r + k columns are the parameters: travel of the r rollers [m], and rolling invariants
    of the k contacts [m], see `ContactStatics.anchors`.
    """

    pose: Array  #: (3, p) derivatives of the pose (x, y, angle)
    normal_forces: Array  #: (m, p) derivatives of the normal forces of the grasping members
    #: (2j, p) derivatives of the joint positions (x0, y0, x1, y1, ...), in the order of
    #: `Topology.joint_names`
    joints: Array


@single_threaded
def held_gradient(grip: HeldGrip) -> HeldGradient:
    """Return the derivatives of pose, forces and displaced joints while the contacts stick."""
    config, state, statics = grip.config, grip.state, grip.statics
    indices, parameters = state.places, GraspParameters.of(config)
    rollers, count = len(config.roller_positions), len(grip.anchors)
    chosen = np.zeros((parameters.size, rollers + count))
    chosen[parameters.rollers, :rollers] = np.eye(rollers)
    tubes = LoadedTubes(grip, chosen, parameters, reach=FOLLOWED_MOTION)
    changes = tubes.equation_rates(sticks=True)
    changes[indices.conditions, :rollers] += statics.anchor_rates
    changes[indices.conditions, rollers:] -= np.eye(count)
    change = grip.respond(changes)
    forces = grip.contacts.sum_by_member(change[indices.normal])
    joints = tubes.respond(change).nodes[: len(config.robot.topology.joint_names), :2]
    return HeldGradient(change[:3], forces, joints.reshape(-1, change.shape[1]))
