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

from isotruss_ros.core.contact.grasp_parameters import GraspParameters
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.loaded_tubes import ContactRates, LoadedTubes
from isotruss_ros.core.holding.response_rates import (
    response_rates,
    slip_margin_rates,
    stiffness_rates,
)
from isotruss_ros.core.holding.settle_grasp import SettledGrasp
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.blas_threads import single_threaded
import numpy as np


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
    :ivar slip_margin: (p,) of the member that slips, or lets go, under the least wrench.
    :ivar gives_way: its name.
    :ivar stiffness: (3, 3, p).
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
    slip_margin: Array
    gives_way: str
    stiffness: Array
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
    if grip.response is None:
        raise GraspError('an indifferent equilibrium has no derivatives')
    parameters = GraspParameters.of(grip.config)
    # Three columns more, for the response to a wrench.
    chosen = np.eye(parameters.size, parameters.size + 3)
    nodes = grip.config.node_jacobian.T.copy().view(np.complex128).T
    moved = nodes @ chosen[parameters.rollers]
    tubes = LoadedTubes(grip, moved, chosen[parameters.pressures])
    dents, softened = dent_rates(grip, chosen, parameters)
    state, statics, places = grip.state, grip.statics, grip.state.places
    left = equation_rates(grip, tubes, dents, chosen, parameters)
    tangent = state.jacobian_with(statics.rolling_rows(state.unknowns, state.normals))
    change = -np.linalg.solve(state.jacobian, left)
    change[:, -3:] = -np.linalg.inv(tangent)[:, places.balance]
    normal, friction = change[places.normal], change[places.friction]
    soft = statics.indentation(state.normal_forces)[1]
    contacts = ContactRates(
        change[places.feet],
        tubes.spins + change[places.inclinations],
        normal + 1j * friction,
        dents + soft[:, None] * normal,
    )
    rates = tubes.respond(contacts)
    softer = -chosen[parameters.stiffness] / grip.tubes.stiffness_scale
    answer = response_rates(grip, tubes, contacts, rates, change, (softened, softer))
    used, utilisation = tubes.utilisation(rates.ends)
    change = change[:, :-3]
    margin, gives_way = slip_margin_rates(settled, change, answer, parameters)
    members = np.eye(len(grip.members))[grip.contacts.owners].T
    presses, rubs = members @ change[places.normal], members @ change[places.friction]
    most, needed = _friction_rates(grip, presses, rubs)
    return GraspGradient(
        parameters,
        change[:3],
        presses,
        -rubs,
        needed,
        grip.member_names[most],
        presses.mean(axis=0),
        margin,
        gives_way,
        stiffness_rates(grip, answer),
        utilisation[:, :-3],
        grip.config.robot.member_names[int(used.argmax())],
    )


def _friction_rates(grip: HeldGrip, presses: Array, rubs: Array) -> tuple[int, Array]:
    """Return which member needs most friction, and how that changes, by its forces' rates."""
    needs = np.abs(grip.friction_forces) / grip.normal_forces
    most = int(needs.argmax())
    sign = float(np.sign(grip.friction_forces[most]))
    return most, (sign * rubs[most] - needs[most] * presses[most]) / grip.normal_forces[most]


def dent_rates(grip: HeldGrip, chosen: Array, parameters: GraspParameters) -> tuple[Array, Array]:
    """
    Return how dents [m] and their derivatives by the forces [m/N] change, these as they are.

    :param grip: how the object is held.
    :param chosen: (n, p) how the parameters change in each column.
    :param parameters: which row of these is which.
    :return: (k, p) each.
    """
    forces, scale = grip.state.normal_forces, grip.tubes.stiffness_scale
    indentation, topology = grip.statics.indentation, grip.config.robot.topology
    soft, (curves, dents, softened) = indentation(forces)[1], indentation.second_rates(forces)
    inflated = chosen[parameters.pressures][topology.tube[grip.contacts.members]]
    stiffer = chosen[parameters.stiffness] / scale
    return (
        dents[:, None] * inflated - np.outer(soft * forces, stiffer),
        softened[:, None] * inflated - np.outer(curves * forces + soft, stiffer),
    )


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
    give, slope, *_ = tubes.respond(ContactRates(zero, spins, zero + 0j, dents))
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
