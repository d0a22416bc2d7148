# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Motion of a held object that rolls on the tubes of the moving robot.

Ends of faces lose and gain contact, and a third member may come into contact.
"""

from __future__ import annotations

from dataclasses import replace

from isotruss_ros.core.holding.build_statics import (
    build_statics,
    find_dents,
    find_feet,
    start_unknowns,
)
from isotruss_ros.core.holding.contact_search import ContactSet, run_search, search_contacts
from isotruss_ros.core.holding.contact_statics import (
    ContactConditions,
    ContactStatics,
    FRICTION_COMPLIANCE,
    object_angles,
)
from isotruss_ros.core.holding.held_grip import HeldGrip, scaled_wrench
from isotruss_ros.core.holding.newton import Accuracy, FOLLOWED, settle
from isotruss_ros.core.holding.pressed_contacts import Places, POSE
from isotruss_ros.core.holding.rolling_invariants import find_anchors, rolling_rows
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.factorization import solve_each
from isotruss_ros.core.numerics.tolerances import MAX_SEARCH_STEPS, NEGLIGIBLE_SHARE
from isotruss_ros.core.statics.section import tube_pressures
from isotruss_ros.core.statics.structure import structure_under
import numpy as np


def roll_grip(
    grip: HeldGrip,
    config: Configuration,
    external_wrench: Array | None = None,
    accuracy: Accuracy = FOLLOWED,
    is_begun: bool = False,
) -> HeldGrip | None:
    """
    Return a grip in a near configuration after its contacts have rolled; None: no equilibrium.

    The end of a face loses contact if it is in tension, and gains contact if it would penetrate
    the member. A third member is part of the grip while it is in compression. The wrench is about
    the origin of the object's frame [N, N m].

    :param is_begun: whether the grip is that of `begin_roll` in this configuration, so that the
        tubes are linearised already.
    """
    wrench = scaled_wrench(external_wrench, grip.arm)

    def solve(chosen: ContactSet, before: HeldGrip | None) -> HeldGrip | None:
        start, has_begun = (grip, is_begun) if before is None else (before, False)
        return roll_contacts(start, config, chosen, wrench, accuracy, has_begun)

    return run_search(search_contacts(grip.contacts, rolls=True), solve)


def begin_roll(grip: HeldGrip, config: Configuration) -> HeldGrip | None:
    """
    Return a grip without a load after a step of Newton's method in a near configuration.

    It is not in equilibrium: `roll_grip` finds that in the same configuration in fewer steps. None
    if the equations are singular.
    """
    travel = config.roller_positions - grip.config.roller_positions
    structure = structure_under(config, grip.pressures, grip.statics.bent.structure.stiffness)
    unknowns = grip.extrapolate(travel)
    statics = replace(grip.statics, bent=grip.statics.bent_under(unknowns, structure))
    conditions = rolling_conditions(grip.anchors, grip.angles, np.zeros(0, dtype=int))
    residual, state = statics.equations(unknowns, np.zeros(3), conditions)
    unknowns = unknowns - solve_each(state.jacobian[None], residual[None, :, None])[0, :, 0]
    if not np.isfinite(unknowns).all():
        return None
    motion = travel, unknowns - grip.state.unknowns
    state = replace(state, unknowns=unknowns)
    return replace(grip, statics=statics, state=state, motion=motion)


def roll_contacts(
    grip: HeldGrip,
    config: Configuration,
    chosen: ContactSet,
    wrench: Array,
    accuracy: Accuracy = FOLLOWED,
    is_begun: bool = False,
) -> HeldGrip | None:
    """Return the equilibrium with given rolling contacts, or None; new ones have no friction."""
    travel = config.roller_positions - grip.config.roller_positions
    are_same_contacts = chosen.contacts is grip.contacts
    # New contacts have the origin -1; their anchors and angles are replaced below.
    new_contacts = np.flatnonzero(chosen.origins < 0)
    anchors = grip.anchors[chosen.origins]
    previous_angles = grip.angles[chosen.origins]
    # Where Newton's method starts: at the bent tubes, or for other contacts at straight tubes.
    stiffness = grip.statics.bent.structure.stiffness
    structure = structure_under(config, grip.pressures, stiffness)
    if are_same_contacts:
        starts = [grip.extrapolate(travel), grip.state.unknowns]
        initial = grip.statics
        if not is_begun:
            initial = replace(initial, bent=initial.bent_under(starts[0], structure))
    else:
        feet = find_feet(structure, grip.body, chosen.contacts)
        initial = build_statics(structure, grip.body, chosen.contacts, feet, bool(wrench.any()))
        starts = [_start_from(grip, initial, chosen.origins)]
        angles = np.angle(initial.straight_normals / grip.body.turn)
        previous_angles[new_contacts] = angles[new_contacts]

    conditions = rolling_conditions(anchors, previous_angles, new_contacts)
    for start in starts:
        solution = settle(initial, start, wrench, conditions, MAX_SEARCH_STEPS, accuracy)
        if solution is None:
            continue
        statics, state = solution
        if len(new_contacts):
            all_anchors = find_anchors(statics, state.unknowns, state.normals, previous_angles)
            anchors[new_contacts] = all_anchors[new_contacts]
        angles = object_angles(state.unknowns, state.normals, previous_angles)
        motion = (travel, state.unknowns - grip.state.unknowns) if are_same_contacts else None
        return HeldGrip(anchors, angles, statics, state, wrench, motion)
    return None


def _start_from(grip: HeldGrip, statics: ContactStatics, origins: Indices) -> Array:
    """Return an initial guess of the unknowns (3 + 4k,) that follows from another equilibrium."""
    start, is_continued = start_unknowns(statics), origins >= 0
    # Rows: positions, inclinations, normal forces, friction forces.
    by_contact = start[POSE:].reshape(4, -1)
    previous = grip.state.unknowns[POSE:].reshape(4, -1)
    by_contact[:, is_continued] = previous[:, origins[is_continued]]
    # A new contact has almost no force: the iteration must not cross zero.
    start[statics.places.normal][~is_continued] = NEGLIGIBLE_SHARE * grip.squeeze
    return start


def rolling_conditions(anchors: Array, angles: Array, frictionless: Indices) -> ContactConditions:
    """
    Return the conditions of rolling without slip, which are the integral of (17) over time.

    The rolling invariants `find_anchors` are constant. The friction of `frictionless`
    contacts is zero instead.
    """
    friction = Places.of(len(anchors)).friction

    def conditions(
        statics: ContactStatics, unknowns: Array, normals: Points
    ) -> tuple[Array, Array]:
        derivative = rolling_rows(statics, unknowns, normals)
        residual = find_anchors(statics, unknowns, normals, angles) - anchors
        if len(frictionless):
            forces = unknowns[..., friction.start + frictionless]
            residual[..., frictionless] = FRICTION_COMPLIANCE * forces
            derivative[..., frictionless, :] = 0.0
            derivative[..., frictionless, friction.start + frictionless] = FRICTION_COMPLIANCE
        return residual, derivative

    return conditions


def with_pressures(grip: HeldGrip, pressures: tuple[float, ...] | None) -> HeldGrip:
    """
    Return a held grip with other tube pressures; its equilibrium must be found by `roll_grip`.

    Computing tables of dents for a pressure takes longer than a control cycle, so a control loop
    ignores small changes, see `steady_pressures`.
    """
    pressures = pressures or tube_pressures(grip.config.robot.description)
    if pressures == grip.pressures:
        return grip
    structure = structure_under(grip.config, pressures, grip.statics.bent.structure.stiffness)
    dents = find_dents(structure, grip.body, grip.contacts)
    bent = grip.statics.bent_under(grip.state.unknowns, structure)
    return replace(grip, statics=replace(grip.statics, bent=bent, dents=dents))
