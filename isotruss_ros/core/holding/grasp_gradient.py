# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""How a settled grasp changes with what an optimiser can choose: exact derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.loaded_tubes import ContactRates, LoadedTubes
from isotruss_ros.core.holding.settle_grasp import SettledGrasp
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.blas_threads import single_threaded
import numpy as np


class GraspParameters(NamedTuple):
    """
    Places of the p parameters among the columns of a `GraspGradient`.

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


@dataclass(frozen=True, eq=False)
class GraspGradient:
    """
    The derivatives of a `SettledGrasp` by p parameters; contacts stay those that there are.

    Where the object is set down counts by how deep it sits between two members: across their
    bisector, and of three members at all, the equilibrium does not depend on the place.

    :ivar parameters: which column is which.
    :ivar pose: (3, p) of (x, y, angle).
    :ivar normal_forces: (m, p) by grasping member, in the order of `SettledGrasp.normal_forces`.
    :ivar friction_forces: (m, p) on the object, counter-clockwise.
    :ivar required_friction: (p,) of the member that needs the most.
    :ivar needs_most: its name.
    :ivar squeeze: (p,) of the mean normal force of the members.
    :ivar utilisation: (n, p) of the place of each member where it is largest, in the order of
        `Robot.member_names`.
    :ivar most_used: the name of the member with the largest.
    """

    parameters: GraspParameters
    pose: Array
    normal_forces: Array
    friction_forces: Array
    required_friction: Array
    needs_most: str
    squeeze: Array
    utilisation: Array
    most_used: str


@single_threaded
def grasp_gradient(settled: SettledGrasp) -> GraspGradient:
    """
    Return the derivatives of a settled grasp by what an optimiser can choose.

    The equations of the equilibrium, F(y, p) = 0, give y' = -F_y^-1 F_p; F_y is the Jacobian of
    their solution, F_p how tubes give and points move at unknowns y that stay.

    :param settled: where the object rests.
    :raises GraspError: there is no equilibrium, or an indifferent one.
    """
    grip = settled.equilibrium
    if grip is None:
        raise GraspError(f'a grasp without equilibrium has no derivatives: {settled.reason}')
    parameters = parameters_of(grip)
    chosen = np.eye(parameters.size)
    nodes = grip.config.node_jacobian.T.copy().view(np.complex128).T
    moved = nodes @ chosen[parameters.rollers]
    tubes = LoadedTubes(grip, moved, chosen[parameters.pressures])
    dents = dent_rates(grip, chosen, parameters)
    state, places = grip.state, grip.state.places
    left = equation_rates(grip, tubes, dents, chosen, parameters)
    try:
        change = -np.linalg.solve(state.jacobian, left)
    except np.linalg.LinAlgError as error:
        raise GraspError('an indifferent equilibrium has no derivatives') from error
    normal, friction = change[places.normal], change[places.friction]
    soft = grip.statics.indentation(state.normal_forces)[1]
    contacts = ContactRates(
        change[places.feet],
        tubes.spins + change[places.inclinations],
        normal + 1j * friction,
        dents + soft[:, None] * normal,
    )
    used, utilisation = tubes.utilisation(tubes.respond(contacts)[2])
    members = np.eye(len(grip.members))[grip.contacts.owners].T
    presses, rubs = members @ normal, members @ friction
    needs = np.abs(grip.friction_forces) / grip.normal_forces
    most = int(needs.argmax())
    sign = float(np.sign(grip.friction_forces[most]))
    needed = (sign * rubs[most] - needs[most] * presses[most]) / grip.normal_forces[most]
    return GraspGradient(
        parameters,
        change[:3],
        presses,
        -rubs,
        needed,
        grip.member_names[most],
        presses.mean(axis=0),
        utilisation,
        grip.config.robot.member_names[int(used.argmax())],
    )


def parameters_of(grip: HeldGrip) -> GraspParameters:
    """
    Return the places of the parameters of a grasp.

    :param grip: how the object is held.
    """
    rollers = len(grip.config.roller_positions)
    tubes = rollers + 3 + len(grip.config.robot.description.pressures)
    return GraspParameters(
        rollers=slice(0, rollers),
        place=slice(rollers, rollers + 3),
        pressures=slice(rollers + 3, tubes),
        friction=tubes,
        wrench=slice(tubes + 1, tubes + 4),
        stiffness=tubes + 4,
        size=tubes + 5,
    )


def dent_rates(grip: HeldGrip, chosen: Array, parameters: GraspParameters) -> Array:
    """
    Return how the dents change by the parameters alone, the forces as they are, (k, p) [m].

    :param grip: how the object is held.
    :param chosen: (n, p) how the parameters change in each column.
    :param parameters: which row of these is which.
    """
    forces, scale = grip.state.normal_forces, grip.tubes.stiffness_scale
    indentation, topology = grip.statics.indentation, grip.config.robot.topology
    softer = np.outer(indentation(forces)[1] * forces / scale, chosen[parameters.stiffness])
    tubes = topology.tube[grip.contacts.members]
    inflated = chosen[parameters.pressures][tubes]
    return indentation.pressure_rates(forces)[:, None] * inflated - softer


def equation_rates(
    grip: HeldGrip,
    tubes: LoadedTubes,
    dents: Array,
    chosen: Array,
    parameters: GraspParameters,
) -> Array:
    """
    Return how the residual of the equations changes while the unknowns stay, (3 + 4k, p).

    :param grip: how the object is held.
    :param tubes: its frame.
    :param dents: (k, p) see `dent_rates` [m].
    :param chosen: (n, p) how the parameters change in each column.
    :param parameters: which row of these is which.
    """
    statics, state, body = grip.statics, grip.state, grip.body
    places, axis = state.places, statics.compliance.axis[:, None]
    normals, scale = state.normals[:, None], grip.tubes.stiffness_scale
    zero, spins = np.zeros_like(dents), tubes.spins
    give, slope, _ = tubes.respond(ContactRates(zero, spins, zero + 0j, dents))
    softer = -chosen[parameters.stiffness] / scale
    own = statics.compliance.at(state.feet).respond(statics.loads(state.unknowns))
    points, radii = body.shape.surface_at(statics.contacts.corners, state.normals / body.turn)
    # Points of the surface whose normals turn with the members.
    arms, swept = (body.turn * points)[:, None], 1j * radii[:, None] * spins * normals
    away = statics.compliance.start[:, None] - state.center - arms
    gap = (tubes.starts - swept - 1j * spins * away + dents * normals) / axis + give / scale
    gap += (own[:, 0] + 1j * own[:, 1])[:, None] * softer
    slope = slope / scale + own[:, 2, None] * softer
    forces = (state.normal_forces + 1j * state.friction_forces)[:, None] * normals
    turned = 1j * spins * forces
    torque = (swept.conj() * forces + arms.conj() * turned).imag.sum(axis=0)
    total = turned.sum(axis=0)
    wrench = chosen[parameters.wrench] / np.array([[1.0], [1.0], [statics.arm]])
    # The closure depends on the normals, and on how far the pose is from where it was set down.
    closing = state.jacobian[places.closure]
    closure = closing[:, places.inclinations] @ spins
    closure -= closing[:, :3] @ chosen[parameters.place]
    balance = wrench - np.stack([total.real, total.imag, torque / statics.arm])
    return np.concatenate([gap.real, gap.imag, slope, balance, closure])
