# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Criteria of holding an object, with their derivatives by the uncertain parameters.

The parameters are those of `GraspParameters`, and then the object's relative size. The criterion
of slip is mu - |T| / N, whose derivatives vary much less than those of the slip margin.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.contacts import ANGLE, POSE
from isotruss_ros.core.holding.grasp_gradient import GraspParameters, LoadedTubes
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.overlaps import MAX_DISPLACEMENT
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.numerics.arrays import Array
import numpy as np


class Criteria(NamedTuple):
    """Criteria of holding an object: quantities that are positive while it is held."""

    names: tuple[str, ...]  #: violation for which each criterion is negative
    values: Array  #: (c,) values [- or N or m]
    rates: Array  #: (c, p) derivatives by the parameters


def find_criteria(grips: Sequence[HeldGrip], friction: float) -> Criteria:
    """
    Return the criteria of holding an object on a path, from its equilibria along the path.

    The contacts have an unknown history at first, and then roll. The criteria are those of the
    first and last equilibrium, and of those with the smallest slip margin and most utilisation.
    """
    start, *later = grips
    weakest = sorted(later, key=lambda grip: grip.slip_margin(friction))[:1]
    most_used = sorted(later, key=lambda grip: -float(grip.sections.used.max()))[:1]
    critical = list(dict.fromkeys(weakest + most_used + later[-1:]))
    if any(grip.response is None for grip in (start, *critical)):
        raise GraspError('the equilibrium is neutral: it must resist every motion')
    rates, tubes = find_unknown_rates(start)
    parts = [_criteria(start, friction, tubes, rates), _bound_displacement(start, tubes, rates)]
    at_start = _invariant_rates(start, tubes) + start.rolling_rows @ rates
    # At later equilibria, the contacts that remain have the rolling invariants of the start.
    for grip in critical:
        old, new = start.contacts, grip.contacts
        # True where a contact (row) is a contact of the start (column).
        kept = (new.members[:, None] == old.members) & (new.corners[:, None] == old.corners)
        residuals, tubes = _equation_rates(grip, rolls=True)
        residuals[grip.state.places.conditions] = _invariant_rates(grip, tubes) - kept @ at_start
        parts.append(_criteria(grip, friction, tubes, grip.respond(residuals)))
    names, values, derivatives = zip(*parts, strict=True)
    return Criteria(sum(names, ()), np.concatenate(values), np.concatenate(derivatives))


def find_unknown_rates(grip: HeldGrip) -> tuple[Array, LoadedTubes]:
    """Return the derivatives (3 + 4k, p) of an equilibrium's unknowns, and its `LoadedTubes`."""
    rates, tubes = _equation_rates(grip)
    return -np.linalg.solve(tubes.linear.jacobian[0], rates), tubes


def _equation_rates(grip: HeldGrip, rolls: bool = False) -> tuple[Array, LoadedTubes]:
    """Return the derivatives (3 + 4k, p) of the equilibrium equations, and the `LoadedTubes`."""
    state, body, balance = grip.state, grip.body, grip.state.places.balance.start
    columns = GraspParameters.of(grip.config)
    tubes = LoadedTubes.of(grip, np.eye(columns.size, columns.size + 1), columns, exact=not rolls)
    rates = tubes.equation_rates(sticks=rolls)
    points, _ = body.shape.surface_at(grip.contacts.corners, state.normals / body.turn)
    # With the size, contact points move away from the centroid; the dents do not change.
    outward = body.turn * (points - body.shape.centroid)
    along_members = outward / tubes.tubes.lines.axis
    rates[0:balance:3, -1] -= along_members.real  # equations of touch along the members,
    rates[1:balance:3, -1] -= along_members.imag  # and across
    forces = (state.normal_forces + 1j * state.friction_forces) * state.normals
    rates[balance + 2, -1] -= (outward.conj() * forces).imag.sum() / grip.arm  # moment
    return rates, tubes


def _bound_displacement(grip: HeldGrip, tubes: LoadedTubes, rates: Array) -> Criteria:
    """Return four criteria that bound the object's displacement from its measured pose."""
    body, measured, normals = grip.body, grip.measured, grip.state.normals
    # The chord between the normals turns with them.
    turns = tubes.changes.spins + rates[grip.state.places.inclinations]
    normal_rates = 1j * normals[:, None] * turns
    chord, chord_rates = normals[0] - normals[-1], normal_rates[0] - normal_rates[-1]
    axis, chord_turns = chord / abs(chord), (chord_rates / chord).imag
    # Motions of the centroid, at its pose in equilibrium and at its measured pose.
    body_rates = rates[0] + 1j * rates[1] + 1j * (body.middle - body.center) * rates[ANGLE]
    x, y, angle = tubes.changes.place
    measured_rates = x + 1j * y + 1j * (measured.middle - measured.center) * angle
    # Displacement along + i across the chord; each component has a lower and an upper bound.
    displacement = (body.middle - measured.middle) / axis
    moved = (body_rates - measured_rates) / axis - 1j * chord_turns * displacement
    largest = MAX_DISPLACEMENT * grip.config.robot.description.tube_diameter
    values = [-displacement.real, -displacement.imag, displacement.real, displacement.imag]
    derivatives = np.array([-moved.real, -moved.imag, moved.real, moved.imag])
    return Criteria(4 * ('far from the given pose',), largest + np.array(values), derivatives)


def _invariant_rates(grip: HeldGrip, tubes: LoadedTubes) -> Array:
    """Return the derivatives (k, p) of the rolling invariants at constant unknowns."""
    rates = grip.rolling_rows[:, grip.state.places.inclinations] @ tubes.changes.spins
    rates[:, : len(grip.config.roller_positions)] += grip.anchor_rates
    rates[:, -1] -= grip.body.shape.unroll(grip.angles, grip.contacts.corners)
    return rates


def _criteria(grip: HeldGrip, friction: float, tubes: LoadedTubes, rates: Array) -> Criteria:
    """Return the criteria of one equilibrium, given the rates (3 + 4k, p) of its unknowns."""
    indices, contacts, config = grip.state.places, grip.contacts, grip.config
    columns, unit = GraspParameters.of(config), np.eye(rates.shape[1])
    by_friction, by_rollers = unit[columns.friction], unit[columns.rollers]

    # Mobilised coefficients of friction T / N of the grasping members.
    normal, normal_rates = grip.normal_forces, contacts.sum_by_member(rates[indices.normal])
    friction_rates = contacts.sum_by_member(rates[indices.friction])
    used = grip.friction_forces / normal
    used_rates = (friction_rates - used[:, None] * normal_rates) / normal[:, None]

    # Utilisation of all members.
    utilisation, utilisation_rates = tubes.utilisation(tubes.respond(rates))
    every_member = np.arange(len(utilisation))

    # Positions of the contacts along their members, and the lengths of these.
    feet, feet_rates, touched = grip.state.feet, rates[indices.feet], contacts.members
    lengths = tubes.tubes.lines.length
    length_rates = config.robot.topology.incidence[touched] @ by_rollers

    # Distances from other members.
    others, depths = grip.alone.depths_in_others
    _, by_nodes, by_twist = collision_model(config.robot).body_distances(config, grip.body, others)
    gap_rates = by_nodes @ config.node_jacobian @ by_rollers + by_twist @ rates[:POSE]

    # Violation, members, values and derivatives of each kind of criterion.
    groups = [
        ('slip at', grip.members, friction - used, by_friction - used_rates),
        ('slip at', grip.members, friction + used, by_friction + used_rates),
        ('no contact at', grip.members, normal, normal_rates),
        ('wrinkling of', every_member, 1.0 - utilisation, -utilisation_rates),
        ('contact beyond the start of', touched, feet, feet_rates),
        ('contact beyond the end of', touched, lengths - feet, length_rates - feet_rates),
        ('contact with', others, -depths[0], gap_rates),
    ]
    names = config.robot.member_names
    labels = [f'{kind} {names[i]}' for kind, members, *_ in groups for i in members.tolist()]
    _, _, values, derivatives = zip(*groups, strict=True)
    return Criteria(tuple(labels), np.concatenate(values), np.concatenate(derivatives))
