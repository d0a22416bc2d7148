# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How a settled grasp changes with what an optimiser can choose: exact derivatives.

Slip margin and stiffness take second derivatives of the equations of equilibrium. With contacts
that stick, J y_w = -F_w gives the response y_w to a wrench, J the Jacobian with the closure of
rolling. So (y_w)' = -J^-1 J' y_w, and J' y_w is the mixed second derivative of F by the response
and by the change of the grasp, both of which stay.
"""

from __future__ import annotations

from dataclasses import dataclass
import functools

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.contact_forces import slip_conditions
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.loaded_tubes import (
    ContactRates,
    GraspParameters,
    LoadedTubes,
    TubeRates,
)
from isotruss_ros.core.holding.settled_grasp import SettledGrasp
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.records import Record
import numpy as np


@dataclass(frozen=True, eq=False, repr=False)
class GraspGradient(
    Record,
    headline=('parameters', 'gives_way', 'slip_margin', 'most_used', 'needs_most'),
):
    """
    The derivatives of a `SettledGrasp` by p parameters; contacts stay those that there are.

    Where the object is set down counts by how deep it sits between two members: across their
    bisector, and of three members at all, the equilibrium does not depend on the place.

    :ivar parameters: which column is which.
    :ivar settled: the grasp.
    :ivar pose: (3, p) of (x, y, angle).
    :ivar normal_forces: (m, p) by grasping member, in the order of `SettledGrasp.normal_forces`.
    :ivar friction_forces: (m, p) on the object, counter-clockwise.
    :ivar required_friction: (p,) of the member that needs the most; it has a kink where several
        do, as in a symmetric grasp, and is then that of any of them.
    :ivar needs_most: its name.
    :ivar utilisation: (n, p) of the place of each member where it is largest, in the order of
        `Robot.member_names`.
    :ivar most_used: the name of the member with the largest.
    """

    parameters: GraspParameters
    settled: SettledGrasp
    pose: Array
    normal_forces: Array
    friction_forces: Array
    required_friction: Array
    needs_most: str
    utilisation: Array
    most_used: str
    # For second derivatives: with three more columns, those of a unit wrench.
    _changes: tuple[LoadedTubes, ContactRates, TubeRates, Array]

    @property
    def squeeze(self) -> Array:
        """Return those of the mean normal force of the members, (p,)."""
        return self.normal_forces.mean(axis=0)

    @functools.cached_property
    def stiffness(self) -> Array:
        """Return those of the stiffness, (3, 3, p)."""
        grip = self.settled.equilibrium
        inverse = np.linalg.inv(grip.response.pose)
        rates = -np.einsum('ia,apb,bj->ijp', inverse, self._response[:3], inverse)
        rates[2] *= grip.arm
        return rates

    @property
    def slip_margin(self) -> Array:
        """Return those of the slip margin: of the member that `gives_way`, (p,)."""
        return self._margin[0]

    @property
    def gives_way(self) -> str:
        """Return the name of the member that slips, or lets go, under the least wrench."""
        return self._margin[1]

    @functools.cached_property
    def _response(self) -> Array:
        """Return those of the response to a unit wrench, (3 + 4k, p, 3): second derivatives."""
        return _response_rates(self.settled.equilibrium, *self._changes)

    @functools.cached_property
    def _margin(self) -> tuple[Array, str]:
        *_, change = self._changes
        return _slip_margin_rates(self.settled, change[:, :-3], self._response, self.parameters)


@single_threaded
def grasp_gradient(settled: SettledGrasp) -> GraspGradient:
    """
    Return the derivatives of a settled grasp by what an optimiser can choose.

    The equations of the equilibrium, F(y, p) = 0, give y' = -F_y^-1 F_p; F_y is the Jacobian of
    their solution, F_p how tubes give and points move at unknowns y that stay. Second derivatives
    are computed where slip margin or stiffness are asked for.

    :param settled: where the object rests.
    :raises GraspError: there is no equilibrium, or an indifferent one.
    """
    grip = settled.equilibrium
    if grip is None:
        raise GraspError(f'a grasp without equilibrium has no derivatives: {settled.reason}')
    if grip.response is None:
        raise GraspError('an indifferent equilibrium has no derivatives')
    parameters = GraspParameters.of(grip.config)
    chosen = np.eye(parameters.size, parameters.size + 3)
    tubes = LoadedTubes(grip, chosen, parameters)
    state, places = grip.state, grip.state.places
    change = -np.linalg.solve(state.jacobian, tubes.equation_rates())
    change[:, -3:] = -np.linalg.inv(grip.tangent)[:, places.balance]
    contacts = tubes.contact_rates(change)
    rates = tubes.respond(contacts)
    used, utilisation = tubes.utilisation(rates.ends)
    members = np.eye(len(grip.members))[grip.contacts.owners].T
    presses, rubs = (members @ change[each, :-3] for each in (places.normal, places.friction))
    most, needed = _friction_rates(grip, presses, rubs)
    return GraspGradient(
        parameters=parameters,
        settled=settled,
        pose=change[:3, :-3],
        normal_forces=presses,
        friction_forces=-rubs,
        required_friction=needed,
        needs_most=grip.member_names[most],
        utilisation=utilisation[:, :-3],
        most_used=grip.config.robot.member_names[int(used.argmax())],
        _changes=(tubes, contacts, rates, change),
    )


def _friction_rates(grip: HeldGrip, presses: Array, rubs: Array) -> tuple[int, Array]:
    """Return which member needs most friction, and how that changes, by its forces' rates."""
    needs = np.abs(grip.friction_forces) / grip.normal_forces
    most = int(needs.argmax())
    sign = float(np.sign(grip.friction_forces[most]))
    return most, (sign * rubs[most] - needs[most] * presses[most]) / grip.normal_forces[most]


def _response_rates(
    grip: HeldGrip, tubes: LoadedTubes, contacts: ContactRates, rates: TubeRates, change: Array
) -> Array:
    """Return how the response to a unit wrench (fx, fy, m / arm) changes, (3 + 4k, n, 3)."""
    statics, state, places = grip.statics, grip.state, grip.state.places
    normals, turn = state.normals[:, None], grip.body.turn
    points, radii = grip.body.shape.surface_at(statics.contacts.corners, state.normals / turn)
    radius_rates = grip.body.shape.radius_rates(state.normals / turn)[:, None]
    axis, radii, arms = statics.compliance.axis[:, None], radii[:, None], (turn * points)[:, None]
    rubs, scale = state.friction_forces[:, None], grip.tubes.stiffness_scale
    push = state.normal_forces[:, None] + 1j * rubs
    skin = statics.tube_radius - statics.indentation(state.normal_forces)[0][:, None]
    curves = statics.indentation.second_rates(state.normal_forces)[0][:, None]
    turns, angles, spins = contacts.normals, change[2], tubes.spins
    slopes = np.tan(state.unknowns[places.inclinations])[:, None]
    # How arms and forces change, in the plane.
    swung = 1j * (angles * arms + radii * normals * (turns - angles))
    pushed = (contacts.forces + 1j * turns * push) * normals
    left = np.empty((places.size, change.shape[1] - 3, 3))
    for i, j in enumerate(range(-3, 0)):
        turned, angle = turns[:, j, None], angles[j]
        dents = (curves * contacts.forces.real + tubes.softened) * contacts.forces[:, j, None].real
        forces = contacts.forces * turned + contacts.forces[:, j, None] * turns
        forces = (1j * forces - turns * turned * push) * normals
        couples = dents * rubs + contacts.dents * contacts.forces[:, j, None].imag
        couples += contacts.dents[:, j, None] * contacts.forces.imag
        give, slope = tubes.respond_again(rates, j, forces, couples)
        give, slope = give / scale, slope / scale
        give += tubes.softer * rates.give[:, j, None] / scale
        slope += tubes.softer * rates.slope[:, j, None] / scale
        # The point that touches moves on the surface, whose radius there changes.
        grown = radius_rates * (turns - angles)
        arm_rates = 1j * grown * (turned - angle) * normals - angles * angle * arms
        arm_rates -= radii * normals * (turns * turned - angles * angle)
        away = -(change[0, j] + 1j * change[1, j]) - swung[:, j, None]
        away = away + (contacts.dents[:, j, None] - 1j * skin * turned) * normals
        apart = dents + 1j * contacts.dents * turned + 1j * contacts.dents[:, j, None] * turns
        apart = (apart + skin * turns * turned) * normals - arm_rates - 1j * spins * away
        gap = apart / axis + give
        bends = change[places.inclinations]
        slope -= 2.0 * slopes * (1.0 + slopes**2) * bends * bends[:, j, None]
        torque = arm_rates.conj() * push * normals + swung.conj() * pushed[:, j, None]
        torque += swung[:, j, None].conj() * pushed + arms.conj() * forces
        balance = np.stack([forces.real, forces.imag, torque.imag / statics.body.arm]).sum(axis=1)
        closure = grown * (angle - turned)
        touch = np.stack([gap.real, gap.imag, slope], axis=1).reshape(3 * len(gap), -1)
        left[..., i] = np.concatenate([touch, -balance, closure])[:, :-3]
    return -np.linalg.solve(grip.tangent, left.reshape(places.size, -1)).reshape(left.shape)


def _slip_margin_rates(
    settled: SettledGrasp, change: Array, answer: Array, parameters: GraspParameters
) -> tuple[Array, str]:
    """Return how the slip margin changes, (p,) [N], and which member gives way."""
    grip = settled.equilibrium
    owners, response, begin = grip.contacts.owners, grip.response, grip.state.places.normal.start
    rows = slip_conditions(owners, settled.friction)
    reserve, slope, size = grip.slip_reserves(settled.friction)
    nearest = int((reserve / size).argmin())
    row, way = rows[nearest], slope[nearest] / size[nearest]
    # With friction the conditions change, but not those of contacts that let go.
    presses = slip_conditions(owners, 1.0)[nearest] - slip_conditions(owners, 0.0)[nearest]
    left, longer = row @ change[begin:], np.einsum('a,apw,w->p', row, answer[begin:], way)
    left[parameters.friction] += presses @ grip.state.forces
    longer[parameters.friction] += presses @ response.forces @ way
    names = [*2 * grip.member_names, *(grip.member_names[i] for i in owners)]
    return (left - reserve[nearest] / size[nearest] * longer) / size[nearest], names[nearest]
