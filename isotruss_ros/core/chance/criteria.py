# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Conditions under which an object is held, with their derivatives by the uncertain parameters.

The parameters are those of `GraspParameters`, and as the last one the relative size of the object
about its centroid. The condition of slip is mu - |T| / N > 0, whose derivatives vary much less
with the parameters than those of the slip margin.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.contact_search import depths_in_others, free_corners
from isotruss_ros.core.holding.contact_statics import find_dents
from isotruss_ros.core.holding.grasp_gradient import turn_dents
from isotruss_ros.core.holding.held_gradient import GraspParameters, LoadedTubes
from isotruss_ros.core.holding.held_grip import HeldGrip, MAX_DISPLACEMENT, travel_rates
from isotruss_ros.core.holding.pressed_contacts import ANGLE, contacts_at
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array, Flags
from isotruss_ros.core.numerics.tolerances import NEGLIGIBLE_SHARE
from isotruss_ros.core.statics.bent_tubes import FOLLOWED_MOTION
import numpy as np

#: Names of the conditions that contacts change while the object is held.
OPENING, CLOSING = 'face opens at', 'corner touches'


class Criteria(NamedTuple):
    """Values of c conditions, which are positive while the object is held."""

    names: tuple[str, ...]  #: names of the violations
    values: Array  #: (c,) values [- or N or m]
    rates: Array  #: (c, p) derivatives by the parameters
    changing: Flags  #: (c,) true for changes of the contacts, which the object may survive

    @classmethod
    def joined(cls, criteria: list[Criteria]) -> Criteria:
        """Return the criteria of several equilibria."""
        names = sum((part.names for part in criteria), ())
        arrays = zip(*(part[1:] for part in criteria), strict=True)
        return cls(names, *map(np.concatenate, arrays))


class History(NamedTuple):
    """Derivatives of the values that stay constant while k contacts roll."""

    anchors: Array  #: (k, p) derivatives of the rolling invariants
    turns: Array  #: (k, p) derivatives of the angles of the dents' normals, see `LoadedTubes`
    grown: Array  #: (k,) derivatives of the dents' depths by the relative size of the object [m]

    def of(self, first: HeldGrip, grip: HeldGrip) -> History:
        """Return the derivatives for the contacts of a later grip; those of new ones are zero."""
        old, new = (
            list(zip(contacts.members.tolist(), contacts.corners.tolist(), strict=True))
            for contacts in (first.contacts, grip.contacts)
        )
        if old == new:
            return self
        share = np.array([[float(contact == before) for before in old] for contact in new])
        return History(*(share @ rates for rates in self))


def rest_criteria(grip: HeldGrip, friction: float) -> tuple[Criteria, History]:
    """Return the criteria of an equilibrium with unknown contact history, and its history."""
    parameters = GraspParameters.of(grip.config)
    chosen = np.eye(parameters.size, parameters.size + 1)
    turns, grown = turn_dents(grip, chosen, parameters), _size_dents(grip)
    tubes = LoadedTubes(grip, chosen, parameters, turns=turns)
    rates = _equation_rates(grip, tubes, grown)
    try:
        change = -np.linalg.solve(grip.state.jacobian, rates)
    except np.linalg.LinAlgError:
        raise GraspError('the equilibrium is neutral: it must resist every motion') from None
    rolling = grip.statics.rolling_rows(grip.state.unknowns, grip.state.normals)
    criteria = [_criteria(grip, friction, tubes, change), _near(grip, tubes, change)]
    anchors = rolling @ change + _rolled(grip, tubes)
    return Criteria.joined(criteria), History(anchors, turns, grown)


def carried_criteria(grip: HeldGrip, friction: float, history: History) -> Criteria:
    """Return the criteria of an equilibrium to which the contacts have rolled."""
    parameters = GraspParameters.of(grip.config)
    chosen = np.eye(parameters.size, parameters.size + 1)
    tubes = LoadedTubes(grip, chosen, parameters, history.turns, FOLLOWED_MOTION)
    rates = _equation_rates(grip, tubes, history.grown, sticks=True)
    rates[grip.state.places.conditions] = _rolled(grip, tubes) - history.anchors
    change = grip.respond(rates)
    if change is None:
        raise GraspError('the equilibrium is neutral: it must resist every motion')
    return _criteria(grip, friction, tubes, change)


def _equation_rates(
    grip: HeldGrip, tubes: LoadedTubes, grown: Array, sticks: bool = False
) -> Array:
    """Return the derivatives of the equations; dents grow by `grown` (k,) with the size [m]."""
    tubes.dents[:, -1] += grown
    rates = tubes.equation_rates(sticks)
    rates[: grip.state.places.conditions.start, -1] += _size_rates(grip)
    return rates


def _near(grip: HeldGrip, tubes: LoadedTubes, change: Array) -> Criteria:
    """Return the conditions that the equilibrium is near the given pose."""
    body, given, normals = grip.body, grip.statics.body, grip.state.normals
    turned = 1j * normals[:, None] * (tubes.spins + change[grip.state.places.inclinations])
    chord, swung = normals[0] - normals[-1], turned[0] - turned[-1]
    axes = chord / abs(chord) * np.array([[1.0], [1.0j], [-1.0], [-1.0j]])
    shift, moved = body.middle - given.middle, change[0] + 1j * change[1]
    moved = moved + 1j * (body.middle - body.center) * change[ANGLE]
    place = GraspParameters.of(grip.config).place
    moved[place] -= 1.0, 1.0j, 1j * (given.middle - given.center)
    # The axes turn with the chord.
    moved = moved - 1j * (swung / chord).imag * shift
    limit = MAX_DISPLACEMENT * grip.config.robot.description.tube_diameter
    values = limit - (axes[:, 0].conj() * shift).real
    rates = -(axes.conj() * moved).real
    return Criteria(4 * ('far from the given pose',), values, rates, np.zeros(4, dtype=bool))


def _rolled(grip: HeldGrip, tubes: LoadedTubes) -> Array:
    """Return the derivatives (k, p) of the rolling invariants at constant unknowns."""
    state, statics, contacts = grip.state, grip.statics, grip.contacts
    rolling = statics.rolling_rows(state.unknowns, state.normals)
    rates = rolling[:, state.places.inclinations] @ tubes.spins
    travel = travel_rates(grip.config, contacts.members)
    rates[:, : travel.shape[1]] += statics.sides[:, None] * travel
    rates[:, -1] -= grip.body.shape.unroll(grip.angles, contacts.corners)
    return rates


def _size_rates(grip: HeldGrip) -> Array:
    """Return the derivatives (3k + 3,) of touch and balance by the object's size; round tubes."""
    state, body = grip.state, grip.body
    points, _ = body.shape.surface_at(grip.contacts.corners, state.normals / body.turn)
    grown = body.turn * (points - body.shape.centroid)
    forces = (state.normal_forces + 1j * state.friction_forces) * state.normals
    local = grown / grip.statics.bent.lines.axis
    touch = np.column_stack([-local.real, -local.imag, np.zeros(len(local))])
    torque = (grown.conj() * forces).imag.sum() / grip.arm
    return np.concatenate([touch.ravel(), [0.0, 0.0, -torque]])


def scaled(body: ConvexObject, factor: float) -> ConvexObject:
    """Return an object of another size; its centroid does not move, its fields are lengths."""
    shape: Any = body.shape
    lengths = {field.name: np.array(getattr(shape, field.name)) for field in fields(shape)}
    larger = replace(shape, **{name: (factor * x).tolist() for name, x in lengths.items()})
    moved = body.turn * shape.centroid * (1.0 - factor)
    x, y, angle = body.pose
    return replace(body, shape=larger).moved_to((x + moved.real, y + moved.imag, angle))


def _size_dents(grip: HeldGrip) -> Array:
    """Return the derivatives (k,) of the dents' depths by the relative size of the object [m]."""
    statics, contacts, pressed = grip.statics, grip.contacts, grip.state.normal_forces
    basis = grip.dent_basis
    normals = statics.straight_normals if basis is None else basis.state.normals
    larger = scaled(statics.body if basis is None else basis.body, 1.0 + NEGLIGIBLE_SHARE)
    contacts = contacts_at(larger.shape, contacts.members, contacts.corners, statics.tube_radius)
    dents = find_dents(statics.bent.structure, larger, contacts, grip.tubes, normals)
    return (dents(pressed)[0] - statics.dents(pressed)[0]) / NEGLIGIBLE_SHARE


def _criteria(grip: HeldGrip, friction: float, tubes: LoadedTubes, change: Array) -> Criteria:
    """Return the criteria for changes (3 + 4k, p) of the unknowns."""
    indices, contacts, config = grip.state.places, grip.contacts, grip.config
    touched, count = contacts.members[contacts.first], change.shape[1]
    normal, presses = grip.normal_forces, contacts.sum_by_member(change[indices.normal])
    rubs = contacts.sum_by_member(change[indices.friction])
    needed = grip.friction_forces / normal
    needs = (rubs - needed[:, None] * presses) / normal[:, None]
    by_friction = np.eye(1, count, GraspParameters.of(config).friction)
    used, utilised = tubes.utilisation(tubes.respond(change))
    feet, slid, members = grip.state.feet, change[indices.feet], contacts.members
    room, lengthened = grip.statics.bent.lines.length - feet, -slid
    incidence = config.robot.topology.incidence[members]
    lengthened[:, : incidence.shape[1]] += incidence
    others, depths = depths_in_others(grip)
    distances = collision_model(config.robot).body_distances(config, grip.body, others)
    receding, by_rollers = distances[2] @ change[:3], distances[1] @ config.node_jacobian
    receding[:, : by_rollers.shape[1]] += by_rollers
    ends = np.flatnonzero(contacts.at_faces)
    corners = list(free_corners(grip, np.inf))
    beside = np.array([corner.contact for corner in corners], dtype=int)
    along = np.array([corner.along for corner in corners])[:, None]
    # The object turns about the contact; the sign does not matter for the deviation.
    turned = change[ANGLE] - (tubes.spins + change[indices.inclinations])[beside]
    gaps = -np.array([corner.depth for corner in corners])
    groups = [
        ('slip at', touched, friction - needed, by_friction - needs),
        ('slip at', touched, friction + needed, by_friction + needs),
        ('no contact at', touched, normal, presses),
        ('wrinkling of', np.arange(len(used)), 1.0 - used, -utilised),
        ('contact beyond the start of', members, feet, slid),
        ('contact beyond the end of', members, room, lengthened),
        (OPENING, members[ends], grip.state.normal_forces[ends], change[indices.normal][ends]),
        (CLOSING, members[beside], gaps, along * turned),
        ('contact with', others, -depths, receding),
    ]
    names = config.robot.member_names
    labels = [f'{what} {names[i]}' for what, where, *_ in groups for i in where.tolist()]
    changing = [np.full(len(where), what in (OPENING, CLOSING)) for what, where, *_ in groups]
    values, rates = (np.concatenate([group[i] for group in groups]) for i in (2, 3))
    return Criteria(tuple(labels), values, rates, np.concatenate(changing))
