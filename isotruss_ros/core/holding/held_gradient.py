# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Derivatives of a held object's equilibrium and the loaded robot with respect to parameters.

From the equilibrium equations F(y, x) = 0 follows y' = -F_y^-1 F_x.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.equations import Linear
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.newton import linearize_at
from isotruss_ros.core.holding.pressed_contacts import ANGLE, POSE
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.samples import take
from isotruss_ros.core.numerics.tolerances import EPSILON
from isotruss_ros.core.statics.bent_tubes import BentTubes
from isotruss_ros.core.statics.structure import section_rates
from isotruss_ros.core.statics.tube_rates import (
    find_load_changes,
    find_section_changes,
    TubeRates,
)
from isotruss_ros.core.statics.wrinkling import evaluate_utilisation
import numpy as np


class GraspParameters(NamedTuple):
    """Indices of the columns that belong to each of the p parameters in a gradient."""

    rollers: slice  #: travel of the r rollers [m]
    place: slice  #: x, y and angle of the object's given pose [m, rad]
    pressures: slice  #: gauge pressures of the t tubes, in the order of the robot file [Pa]
    friction: int  #: coefficient of friction [-]
    wrench: slice  #: wrench fx, fy, m on the object [N, N m]
    stiffness: int  #: ratio of the tubes' true EA, EI and GA to the modelled ones [-]
    size: int  #: number p of the parameters

    @classmethod
    def of(cls, config: Configuration) -> GraspParameters:
        """Return the column indices of all parameters of grasps by a robot."""
        rollers = len(config.roller_positions)
        pressures_end = rollers + 3 + len(config.robot.description.pressures)
        return cls(
            rollers=slice(0, rollers),
            place=slice(rollers, rollers + 3),
            pressures=slice(rollers + 3, pressures_end),
            friction=pressures_end,
            wrench=slice(pressures_end + 1, pressures_end + 4),
            stiffness=pressures_end + 4,
            size=pressures_end + 5,
        )


class ParameterChanges(NamedTuple):
    """Derivatives of robot, wrench and given pose along p directions of parameter changes."""

    spins: Array  #: (k, p) rotations of the contacts' members [rad]
    sections: Array  #: (4, c, p) rest length, EA, EI and GA of the frame's parts
    nodes: Points  #: (n, p) positions of the undeformed robot's nodes, x + iy [m]
    pressures: Array  #: (t, p) gauge pressures of the tubes [Pa]
    place: Array  #: (3, p) given pose of the object [m, rad]
    wrench: Array  #: (3, p) wrench on the object, see `HeldGrip.wrench` [N]

    @classmethod
    def of(
        cls, grip: HeldGrip, bent: BentTubes, directions: Array, columns: GraspParameters
    ) -> ParameterChanges:
        """Return the derivatives along p `directions` (n, p) of the n parameters."""
        members, topology = grip.contacts.members, grip.config.robot.topology
        by_rollers = grip.config.node_jacobian.T.copy().view(np.complex128).T
        nodes = by_rollers @ directions[columns.rollers]
        span_rates = nodes[topology.end[members]] - nodes[topology.b[members]]
        pressures = directions[columns.pressures]
        return cls(
            spins=(span_rates / (bent.lines.length * bent.lines.axis)[:, None]).imag,
            sections=section_rates(
                bent.structure, bent.tangent.frame, nodes, pressures, directions[columns.stiffness]
            ),
            nodes=nodes,
            pressures=pressures,
            place=directions[columns.place],
            wrench=directions[columns.wrench] / np.array([[1.0], [1.0], [grip.arm]]),
        )


class LoadedTubes(NamedTuple):
    """Bent tubes of a robot with a held object, with derivatives along p parameter changes."""

    grip: HeldGrip  #: the held object
    linear: Linear  #: its linearised equations
    tubes: BentTubes  #: the tubes of this sample
    changes: ParameterChanges  #: the parameter changes
    depth_rates: Array  #: (k, p) derivatives of the dents' depths at constant unknowns [m]
    by_sections: TubeRates  #: derivatives at constant loads

    @classmethod
    def of(
        cls, grip: HeldGrip, directions: Array, columns: GraspParameters, exact: bool = False
    ) -> LoadedTubes:
        """
        Return the tubes with derivatives along p `directions` (n, p) of the n parameters.

        If they must be exact, the equations are linearised at the equilibrium; otherwise those of
        the last step of Newton's method are taken.
        """
        if grip.response is None:
            raise GraspError(
                'the equilibrium is neutral, so it has no derivatives: it must resist every motion'
            )
        one = grip.alone
        linear = linearize_at(one.g, one.iterate) if exact else one.linear
        tubes = take(linear.tubes, 0)
        changes = ParameterChanges.of(grip, tubes, directions, columns)
        state, dents = grip.state, one.g.dents.take_samples(0)
        angles = np.angle(state.normals * np.exp(-1j * state.unknowns[ANGLE]))
        tube = grip.config.robot.topology.tube[grip.contacts.members]
        depth_rates = linear.pushes.depth_by_angle[0][:, None] * changes.spins
        if changes.pressures.any():
            by_pressure = dents.pressure_rates(state.normal_forces, angles)
            depth_rates += by_pressure[:, None] * changes.pressures[tube]
        by_sections = find_section_changes(tubes, changes.sections, changes.nodes)
        return cls(grip, linear, tubes, changes, depth_rates, by_sections)

    def equation_rates(self, sticks: bool = False) -> Array:
        """Return the equations' derivatives (3 + 4k, p), for `sticks` those without slip."""
        grip, g, state, body = self.grip, self.grip.samples.g, self.grip.state, self.grip.body
        indices, normals, lines = state.places, state.normals[:, None], self.tubes.lines
        layout = self.tubes.tangent.frame.layout
        spins, axis = self.changes.spins, lines.axis[:, None]
        at_constant_unknowns = self.respond(np.zeros((indices.size, spins.shape[1])))
        # Touch: gaps from the object's surface to the tubes, in axes that turn with the members.
        node_rates = at_constant_unknowns.nodes[layout.nodes]
        displaced = self.tubes.tangent.displacements[layout.nodes]
        points, radii = body.shape.surface_at(g.contacts.corners, state.normals / body.turn)
        to_contacts = (body.turn * points)[:, None]
        # The contact points move on the surface, because the normals turn with the members.
        contact_rates = 1j * radii[:, None] * spins * normals
        feet = lines.start + lines.axis * state.feet + displaced[:, 0] + 1j * displaced[:, 1]
        gaps = feet[:, None] - body.center - to_contacts
        # The last term is the rotation of the members' axes, in which the gaps are.
        foot_rates = node_rates[:, 0] + 1j * node_rates[:, 1] - 1j * spins * gaps
        gap_rates = (foot_rates - contact_rates + self.depth_rates * normals) / axis
        slope_rates = at_constant_unknowns.inclinations - spins
        touch = np.stack([gap_rates.real, gap_rates.imag, slope_rates], axis=1)
        # Balance: the forces on the tubes, x + iy, turn with the members.
        forces = self.linear.pushes.forces[0][:, None] * axis
        force_rates = 1j * spins * forces
        torques = contact_rates.conj() * forces + to_contacts.conj() * force_rates
        torque = torques.imag.sum(axis=0)
        total = force_rates.sum(axis=0)
        balance = self.changes.wrench - np.stack([total.real, total.imag, torque / grip.arm])
        # The conditions depend on the normals, which turn with the members.
        rows = self.linear.jacobian[0, indices.conditions]
        if sticks:
            rows = grip.alone.g.rolling_rows(radii[None])[0]
        conditions = rows[:, indices.inclinations] @ spins
        if not sticks:
            # Other conditions depend on the pose relative to the measured pose, of which x and y
            # are those of the centroid. If the measured angle changes, both centroids turn about
            # their origins; `turning` is the difference.
            measured = grip.measured
            shift = measured.middle - measured.center - (body.middle - body.center)
            turning = np.outer([-shift.imag, shift.real, 0.0], self.changes.place[ANGLE])
            conditions -= rows[:, :POSE] @ (self.changes.place + turning)
        return np.concatenate([touch.reshape(3 * len(gaps), -1), balance, conditions])

    def respond(self, change: Array) -> TubeRates:
        """Return the tubes' derivatives, given those (3 + 4k, p) of the equilibrium's unknowns."""
        state, changes = self.grip.state, self.changes
        force_rates = 1j * changes.spins * self.linear.pushes.forces[0][:, None]
        # Friction acts at the skin, so its moment depends on the depths of the dents.
        moment_rates = self.depth_rates * state.friction_forces[:, None]
        loads = np.stack([force_rates.real, force_rates.imag, moment_rates], axis=1)
        loads += self.linear.load_rates(change[None])[0].reshape(loads.shape)
        by_loads = find_load_changes(self.tubes, loads, change[state.places.feet])
        return TubeRates(*map(np.add, self.by_sections, by_loads))

    def utilisation(self, rates: TubeRates) -> tuple[Array, Array]:
        """
        Return the members' utilisations (m,), and their derivatives (m, p).

        That of a tube without loads has a kink at zero; its derivatives are zero.
        """
        robot, changes, usage = self.grip.config.robot, self.changes, self.grip.sections
        tube, loaded = robot.topology.tube, np.flatnonzero(usage.sections[0])
        radius, piece = 0.5 * robot.description.tube_diameter, usage.piece[loaded]
        # Loads of `evaluate_utilisation`: the bending moments are -M1 and M2 of `EndForces`, of
        # which the sum M1 + M2 and the difference M1 - M2 are given; wall tension, axial force.
        by_nodes, _ = self.tubes.tangent.force_changes(rates.nodes)
        force_rates = (rates.forces + by_nodes)[piece]
        by_end_forces = np.array([[0.0, -0.5, -0.5], [0.0, 0.5, -0.5], [1.0, 0.0, 0.0]])
        load_rates = np.tensordot(by_end_forces, force_rates, (1, 1))
        load_rates[2] += np.pi * radius**2 * changes.pressures[tube[loaded]]
        load_rates = np.concatenate([load_rates, force_rates[None, :, 0]])
        length_and_section_rates = changes.sections[[0, 2, 3]][:, piece]
        # Complex step at the same kind of place. The utilisation of a tube without wall tension is
        # infinite and has no derivative.
        varied_loads = usage.loads[:, loaded, None] + 1j * EPSILON * load_rates
        varied_sections = usage.sections[:, loaded, None] + 1j * EPSILON * length_and_section_rates
        used, _ = evaluate_utilisation(varied_loads, varied_sections, radius)
        used_rates = np.zeros((len(tube), used.shape[2]))
        used_rates[loaded] = used[usage.kind[loaded], np.arange(len(loaded))].imag / EPSILON
        return usage.used, used_rates


class HeldGradient(NamedTuple):
    """
    Derivatives of the unknowns, normal forces and joint positions of a held object.

    The p = r + k columns are the parameters: travel of the r rollers [m], and rolling invariants
    of the k contacts [m], see `Grasps.find_anchors`.
    """

    unknowns: Array  #: (3 + 4k, p) derivatives of the unknowns, first the pose (x, y, angle)
    normal_forces: Array  #: (m, p) derivatives of the normal forces of the grasping members
    #: (2j, p) derivatives of the joint positions (x0, y0, x1, y1, ...), in the order of
    #: `Topology.joint_names`
    joints: Array

    @property
    def pose(self) -> Array:
        """Return the derivatives (3, p) of x, y and angle."""
        return self.unknowns[:POSE]


@single_threaded
def held_gradient(grip: HeldGrip) -> HeldGradient:
    """Return the derivatives by roller travel and rolling invariants; the contacts stick."""
    indices, parameters = grip.state.places, GraspParameters.of(grip.config)
    rollers, count = len(grip.config.roller_positions), len(grip.contacts.members)
    # Columns: roller travel, then rolling invariants, which change no parameter of a grasp.
    directions = np.zeros((parameters.size, rollers + count))
    directions[parameters.rollers, :rollers] = np.eye(rollers)
    tubes = LoadedTubes.of(grip, directions, parameters)
    residuals = tubes.equation_rates(sticks=True)
    residuals[indices.conditions, :rollers] += grip.anchor_rates
    residuals[indices.conditions, rollers:] -= np.eye(count)
    change = grip.respond(residuals)
    forces = grip.contacts.sum_by_member(change[indices.normal])
    joints = tubes.respond(change).nodes[: len(grip.config.robot.topology.joint_names), :2]
    return HeldGradient(change, forces, joints.reshape(-1, change.shape[1]))
