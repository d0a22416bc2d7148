# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How the analysis of an object held fast changes with what an optimiser can choose.

The points that touch are those of the analysis, and stay closed: X' . nu = V . nu, with V of the
object's surface. Forces f = F d on the tubes change by F' d + i d F delta, and turn by delta with
the surface, d = nu; where tubes slide under an object that is not round, with the bent tubes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from isotruss_ros.core.contact.flattening import flattening_of
from isotruss_ros.core.contact.friction_closure import closure_margin_rates
from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis, HeldFast
from isotruss_ros.core.contact.sliding_contact import find_neighbours
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.statics.cut_frame import CutFrame, FrameRates, structure_rates
import numpy as np


class GraspParameters(NamedTuple):
    """
    Places of the p parameters among the columns of a gradient.

    :ivar rollers: travel of the r rollers [m].
    :ivar place: x, y, angle of the pose at which the object is set down [m, rad].
    :ivar pressures: gauge, of the t tubes in the order of the robot file [Pa].
    :ivar friction: coefficient.
    :ivar wrench: fx, fy, m on the object [N, N m].
    :ivar stiffness: that of robot and tubes against the model's [-].
    :ivar size: p.
    """

    rollers: slice
    place: slice
    pressures: slice
    friction: int
    wrench: slice
    stiffness: int
    size: int

    @classmethod
    def of(cls, config: Configuration) -> GraspParameters:
        """
        Return those of grasps by a robot.

        :param config: configuration of the robot.
        """
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


@dataclass(frozen=True, eq=False)
class AnalysisGradient:
    """
    The derivatives of a `GraspAnalysis` by p parameters; what touches stays what it is.

    :ivar parameters: which column is which; the place is where the object is held.
    :ivar normal_forces: (k, p) by contact point of the analysis.
    :ivar normal_wrench: (3, p).
    :ivar closure_margin: (p,) along the wrench that opens the grasp first.
    :ivar opening: (3,) that wrench, of size one: fx, fy, m over half of the mean width.
    """

    parameters: GraspParameters
    normal_forces: Array
    normal_wrench: Array
    closure_margin: Array
    opening: Array


@single_threaded
def analysis_gradient(analysis: GraspAnalysis) -> AnalysisGradient:
    """
    Return the derivatives of an analysis by what an optimiser can choose.

    :param analysis: of a grasp.
    :raises GraspError: fewer than two points touch the object, or friction is along one line.
    """
    fast = analysis.solution
    (points, contact, *_, kept), body = fast.solved, fast.body
    touching = np.flatnonzero(contact.forces > 0.0)
    if len(touching) < 2:
        raise GraspError(f'{len(touching)} points of contact: a gradient takes two or more')
    parameters = GraspParameters.of(fast.structure.config)
    chosen = np.eye(parameters.size)
    x, y, _ = chosen[parameters.place]
    pressed, turned, moved, leant = _contact_rates(fast, touching, chosen, parameters)
    push, found = contact.push[touching, None], contact.normals[touching, None]
    # The normals of the answer; those that lean no more turn with the forces.
    normals, forces = fast.turned.normals[touching, None], fast.turned.forces[touching, None]
    leant = np.where(np.isclose(normals, found), leant, turned)
    lean = np.angle(normals / push)
    normal_forces = pressed / np.cos(lean) + forces * np.tan(lean) * (leant - turned)
    pushed = push * (pressed / np.abs(push) + 1j * turned)
    # From the origin of the object's frame to where the forces act on its own surface.
    arms = (points.skin + contact.displacements)[touching, None] - body.center
    arms = arms - fast.margin * normals
    swung = moved - x - 1j * y - 1j * fast.margin * leant * normals
    torques = (swung.conj() * push + arms.conj() * pushed).imag.sum(axis=0)
    levers = (arms * normals.conj()).real / body.arm
    lever_rates = ((swung - 1j * leant * arms) * normals.conj()).real / body.arm
    if body.shape.is_round:
        torques, levers, lever_rates = 0.0 * torques, np.ones_like(levers), 0.0 * lever_rates
    wrench = -np.stack([pushed.real.sum(axis=0), pushed.imag.sum(axis=0), torques])
    tangents = np.stack([-normals.imag, normals.real, levers])
    tangent_rates = np.stack([-(normals * leant).real, -(normals * leant).imag, lever_rates])
    scale = np.array([1.0, 1.0, body.arm])
    margin, opening = closure_margin_rates(
        (tangents * forces)[..., 0].T,
        (tangents * normal_forces + tangent_rates * forces).swapaxes(0, 1),
        (analysis.normal_wrench + fast.wrench) / scale,
        (wrench + chosen[parameters.wrench]) / scale[:, None],
        (fast.friction, chosen[parameters.friction]),
    )
    by_point = np.zeros((len(points.points), parameters.size))
    by_point[touching] = normal_forces
    return AnalysisGradient(parameters, by_point[kept], wrench, margin, opening)


def _contact_rates(
    fast: HeldFast, touching: Indices, chosen: Array, parameters: GraspParameters
) -> tuple[Array, Array, Points, Array]:
    """Return how forces grow and turn, skins move, and the surface's normals turn, (a, p) each."""
    (points, contact, *_), body, count = fast.solved, fast.body, len(touching)
    before, after = find_neighbours(points)[:, touching]
    used = np.unique(np.concatenate([touching, before, after])) if fast.sliding else touching
    own, before, after = (np.searchsorted(used, places) for places in (touching, before, after))
    push, normals = contact.push[touching], contact.normals[touching, None]
    # How skins and centre lines move by each force, and by its turn.
    local = points.axis[touching].conj() * np.stack([push / np.abs(push), 1j * push])
    given = points.compliance(used)[..., own]
    by_force = np.einsum('rufa,fca->ruca', given, np.stack([local.real, local.imag]))
    skins = points.axis[used, None] * (by_force[0] + 1j * by_force[1]).reshape(len(used), -1)
    dents = points.dents[used[:, None], touching][:, None] * local.imag
    lines = skins - 1j * points.axis[used, None] * dents.reshape(len(used), -1)
    skin_rates, line_rates = _still_rates(fast, used, chosen, parameters)
    x, y, spin = chosen[parameters.place]
    reached = (points.skin + contact.displacements)[touching, None]
    surface = x + 1j * y + 1j * spin * (reached - body.center)
    radii, chords = contact.radii[touching, None], np.ones((count, 1))
    if fast.sliding:
        bent = points.bend(contact.displacements, contact.push)[used]
        chords = (bent[after] - bent[before])[:, None]

    def turns(skins: Points, lines: Points, spin: Array | float) -> Array:
        """Return how much forces turn as skins, against the surface, and centre lines move."""
        if fast.sliding:
            return ((lines[after] - lines[before]) / chords).imag
        return (normals.conj() * skins).imag / radii + spin

    skins, apart = skins[own], skin_rates[own] - surface
    matrix = np.concatenate([(normals.conj() * skins).real, -turns(skins, lines, 0.0)])
    matrix[count:, count:] += np.eye(count)
    right = -(normals.conj() * apart).real, turns(apart, line_rates, spin)
    change = np.linalg.solve(matrix, np.concatenate(right))
    slid = apart + skins @ change
    leant = (normals.conj() * slid).imag / radii + spin
    return change[:count], change[count:], slid + surface, leant


def _still_rates(
    fast: HeldFast, used: Indices, chosen: Array, parameters: GraspParameters
) -> tuple[Points, Points]:
    """Return how skins and centre lines (u, p) move while the forces stay as they are."""
    structure, (points, contact, *_), body = fast.structure, fast.solved, fast.body
    config, frame, topology = structure.config, structure.frame, structure.config.robot.topology
    nodes = config.node_jacobian.T.copy().view(np.complex128).T @ chosen[parameters.rollers]
    inflated, softer = chosen[parameters.pressures], -chosen[parameters.stiffness]
    member = points.member
    first, last = topology.b[member], topology.c[topology.following[member]]
    start, span = config.points[first][:, None], (config.points[last] - config.points[first])
    spins = ((nodes[last] - nodes[first]) / span[:, None]).imag
    # The points are counted from the foot of the object's middle.
    line, arm = (span / np.abs(span))[:, None], body.middle - body.center
    x, y, spin = chosen[parameters.place]
    foot = ((x + 1j * y + 1j * spin * arm - nodes[first]) / line).real
    foot += spins * ((body.middle - start) / line).imag
    moved = nodes[first] + 1j * spins * (points.points[:, None] - start) + line * foot
    piece = points.pieces[points.piece[used]]
    within = np.abs(points.points[used] - frame.points[frame.members.start[piece]])
    cut = CutFrame(frame, piece, within)
    loads = np.zeros((len(cut.points), 3))
    loads[cut.nodes, 0], loads[cut.nodes, 1] = contact.push[used].real, contact.push[used].imag
    rates = structure_rates(structure, nodes, inflated)
    rates = FrameRates(
        np.concatenate([rates.points, moved[used]]), rates.flexibility[:, cut.whole], rates.rows
    )
    state = cut.solve(loads)
    given = cut.rates(state, rates, np.zeros((*loads.shape, parameters.size)))[0][cut.nodes]
    bent = (state.displacements[cut.nodes] @ (1.0, 1j, 0.0))[:, None]
    lines = moved[used] + given[:, 0] + 1j * given[:, 1] + bent * softer
    across, axis = contact.push[:, None] / points.axis[:, None], points.axis[:, None]
    depths = points.dents @ across.imag
    rate = depths * softer - points.dents @ (spins * across.real)
    if depths.any():
        apart = np.rint(np.abs(points.place[:, None] - points.place) / points.spacing)
        kernel, ahead = flattening_of(config.robot, structure.pressures), (axis / line).real
        tube = topology.tube[member]
        softened = kernel.compliance_rates(int(apart.max()) + 1, points.spacing)
        softened = softened[tube[:, None], apart.astype(np.intp)] * (member[:, None] == member)
        rate += ahead * (softened @ (ahead * across.imag)) * inflated[tube]
    skins = 1j * spins * (points.skin - points.points)[:, None]
    skins += 1j * axis * (rate + 1j * spins * depths)
    return lines + skins[used], lines
