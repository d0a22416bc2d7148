# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Conditions under which an object is held, with their derivatives by the uncertain parameters.

The parameters are those of `GraspParameters`, and as the last one the relative size of the object
about its centroid. The condition of slip is mu - |T| / N > 0, whose derivatives vary much less
with the parameters than those of the slip margin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
import functools
from typing import Any, NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.contact_search import depths_in_others
from isotruss_ros.core.holding.held_gradient import GraspParameters, LoadedTubes
from isotruss_ros.core.holding.held_grip import HeldGrip, MAX_DISPLACEMENT
from isotruss_ros.core.holding.pressed_contacts import ANGLE
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.tolerances import ROUNDING
from isotruss_ros.core.statics.bent_tubes import FOLLOWED_MOTION
import numpy as np


class Criteria(NamedTuple):
    """Values (c,) and their derivatives of conditions, positive while the object is held."""

    names: tuple[str, ...]  #: names of the violations
    values: Array  #: (c,) values [- or N or m]
    rates: Array  #: (c, p) derivatives by the parameters


def find_criteria(grips: Sequence[HeldGrip], friction: float) -> Criteria:
    """
    Return the conditions that an object is held in the equilibria along a path.

    The first equilibrium has an unknown contact history; from it, the contacts roll to the others.
    The conditions are those of the first equilibrium, of the last one, and of those with the
    smallest slip margin and the largest utilisation.
    """
    first, *others = grips
    weakest = sorted(others, key=lambda grip: grip.slip_margin(friction))[:1]
    most_used = sorted(others, key=lambda grip: -float(grip.sections.used.max()))[:1]
    critical = list(dict.fromkeys(weakest + most_used + others[-1:]))
    if any(grip.response is None for grip in (first, *critical)):
        raise GraspError('the equilibrium is neutral: it must resist every motion')
    change, tubes = find_unknown_rates(first)
    parts = [_criteria(first, friction, tubes, change), _bound_displacement(first, tubes, change)]
    anchors = _rolled(first, tubes)
    anchors += first.statics.rolling_rows(first.state.unknowns, first.state.normals) @ change
    for grip in critical:
        old, new = first.contacts, grip.contacts
        same = (new.members[:, None] == old.members) & (new.corners[:, None] == old.corners)
        tubes = _loaded_tubes(grip, FOLLOWED_MOTION)
        rates = _equation_rates(grip, tubes, sticks=True)
        # New contacts have no history.
        rates[grip.state.places.conditions] = _rolled(grip, tubes) - same @ anchors
        parts.append(_criteria(grip, friction, tubes, grip.respond(rates)))
    names, *arrays = zip(*parts, strict=True)
    return Criteria(sum(names, ()), *map(np.concatenate, arrays))


def find_unknown_rates(grip: HeldGrip) -> tuple[Array, LoadedTubes]:
    """Return the derivatives (3 + 4k, p) of the unknowns, and the tubes with derivatives."""
    tubes = _loaded_tubes(grip)
    return -np.linalg.solve(grip.state.jacobian, _equation_rates(grip, tubes)), tubes


def _loaded_tubes(grip: HeldGrip, reach: float = ROUNDING) -> LoadedTubes:
    parameters = GraspParameters.of(grip.config)
    return LoadedTubes.of(grip, np.eye(parameters.size, parameters.size + 1), parameters, reach)


def _equation_rates(grip: HeldGrip, tubes: LoadedTubes, sticks: bool = False) -> Array:
    """Return the equations' derivatives (3 + 4k, p) by p parameters; the size changes no dents."""
    state, body, touch = grip.state, grip.body, grip.state.places.balance.start
    rates = tubes.equation_rates(sticks)
    points, _ = body.shape.surface_at(grip.contacts.corners, state.normals / body.turn)
    larger = body.turn * (points - body.shape.centroid)
    local = larger / grip.statics.bent.lines.axis
    rates[0:touch:3, -1] -= local.real
    rates[1:touch:3, -1] -= local.imag
    forces = (state.normal_forces + 1j * state.friction_forces) * state.normals
    rates[touch + 2, -1] -= (larger.conj() * forces).imag.sum() / grip.arm
    return rates


def _bound_displacement(grip: HeldGrip, tubes: LoadedTubes, change: Array) -> Criteria:
    """Return four conditions that bound the object's displacement from its measured pose."""
    body, measured, normals = grip.body, grip.statics.body, grip.state.normals
    turns = tubes.changes.spins + change[grip.state.places.inclinations]
    normal_rates = 1j * normals[:, None] * turns
    # Along and across the chord of the normals, which turns.
    chord, chord_rates = normals[0] - normals[-1], normal_rates[0] - normal_rates[-1]
    axis = chord / abs(chord)
    displacement = (body.middle - measured.middle) / axis
    rates = change[0] + 1j * change[1] + 1j * (body.middle - body.center) * change[ANGLE]
    x, y, angle = tubes.changes.place
    rates -= x + 1j * y + 1j * (measured.middle - measured.center) * angle
    rates = rates / axis - 1j * (chord_rates / chord).imag * displacement
    along = np.append(displacement, rates)
    values = np.array([-along.real, -along.imag, along.real, along.imag])
    values[:, 0] += MAX_DISPLACEMENT * grip.config.robot.description.tube_diameter
    return Criteria(4 * ('far from the given pose',), values[:, 0], values[:, 1:])


def _rolled(grip: HeldGrip, tubes: LoadedTubes) -> Array:
    """Return the derivatives (k, p) of the rolling invariants at constant unknowns."""
    state, statics, contacts = grip.state, grip.statics, grip.contacts
    rolling = statics.rolling_rows(state.unknowns, state.normals)
    rates = rolling[:, state.places.inclinations] @ tubes.changes.spins
    rates[:, : len(grip.config.roller_positions)] += statics.anchor_rates
    rates[:, -1] -= grip.body.shape.unroll(grip.angles, contacts.corners)
    return rates


@functools.lru_cache(maxsize=8)
def scaled(body: ConvexObject, factor: float) -> ConvexObject:
    """Return an object of another size; its centroid does not move, its fields are lengths."""
    shape: Any = body.shape
    lengths = {field.name: np.array(getattr(shape, field.name)) for field in fields(shape)}
    larger = replace(shape, **{name: (factor * x).tolist() for name, x in lengths.items()})
    moved = body.turn * shape.centroid * (1.0 - factor)
    pose = np.add(body.pose, (moved.real, moved.imag, 0.0))
    return replace(body, shape=larger).moved_to(pose)


def _criteria(grip: HeldGrip, friction: float, tubes: LoadedTubes, change: Array) -> Criteria:
    """Return the criteria for changes (3 + 4k, p) of the unknowns."""
    indices, contacts, config = grip.state.places, grip.contacts, grip.config
    touched, count = grip.members, change.shape[1]
    normal, presses = grip.normal_forces, contacts.sum_by_member(change[indices.normal])
    rubs = contacts.sum_by_member(change[indices.friction])
    needed = grip.friction_forces / normal
    needs = (rubs - needed[:, None] * presses) / normal[:, None]
    by_friction = np.eye(1, count, GraspParameters.of(config).friction)
    used, utilised = tubes.utilisation(tubes.respond(change))
    feet, slid, members = grip.state.feet, change[indices.feet], contacts.members
    room = grip.statics.bent.lines.length - feet
    rollers = np.eye(len(config.roller_positions), count)
    lengthened = config.robot.topology.incidence[members] @ rollers - slid
    others, depths = depths_in_others(grip)
    distances = collision_model(config.robot).body_distances(config, grip.body, others)
    receding = distances[1] @ config.node_jacobian @ rollers + distances[2] @ change[:3]
    groups = [
        ('slip at', touched, friction - needed, by_friction - needs),
        ('slip at', touched, friction + needed, by_friction + needs),
        ('no contact at', touched, normal, presses),
        ('wrinkling of', np.arange(len(used)), 1.0 - used, -utilised),
        ('contact beyond the start of', members, feet, slid),
        ('contact beyond the end of', members, room, lengthened),
        ('contact with', others, -depths, receding),
    ]
    names = config.robot.member_names
    labels = [f'{what} {names[i]}' for what, where, *_ in groups for i in where.tolist()]
    values, rates = (np.concatenate([group[i] for group in groups]) for i in (2, 3))
    return Criteria(tuple(labels), values, rates)
