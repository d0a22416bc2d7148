# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Motion of a held object that rolls on the tubes of the moving robot.

Ends of faces lose and gain contact, and a third member may come into contact.
"""

from __future__ import annotations

from isotruss_ros.core.holding.contact_search import ContactSet, run_search, search_contacts
from isotruss_ros.core.holding.contacts import POSE
from isotruss_ros.core.holding.equations import (
    begin_straight,
    find_dents,
    Grasps,
    History,
)
from isotruss_ros.core.holding.held_grip import Equilibria, HeldGrip, scaled_wrench
from isotruss_ros.core.holding.newton import (
    Accuracy,
    find_equilibria,
    FOLLOWED,
    Iterate,
    linearize_at,
    QUICK,
    step,
)
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.model.object_samples import ObjectSamples
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.tolerances import NEGLIGIBLE_SHARE
from isotruss_ros.core.statics.bent_tubes import BentState, BentTubes
from isotruss_ros.core.statics.structure import Lines, Structure, structures_under
from isotruss_ros.core.statics.tube_stiffness import tube_pressures
import numpy as np


def roll_grip(
    grip: HeldGrip,
    config: Configuration,
    external_wrench: Array | None = None,
    accuracy: Accuracy = FOLLOWED,
    tubes: BentTubes | None = None,
) -> HeldGrip | None:
    """
    Return a grip in a near configuration after its contacts have rolled; None: no equilibrium.

    The end of a face loses contact if it is in tension, and gains contact if it would penetrate
    the member. A third member is part of the grip while it is in compression. The wrench is about
    the origin of the object's frame [N, N m]. `tubes` are linearised already, see `begin_roll`.
    """
    wrench = scaled_wrench(external_wrench, grip.arm)

    def solve(chosen: ContactSet, before: HeldGrip | None) -> HeldGrip | None:
        start, known = (grip, tubes) if before is None else (before, None)
        return roll_contacts(start, config, chosen, wrench, accuracy, known)

    return run_search(search_contacts(grip.contacts, rolls=True), solve)


def begin_roll(grip: HeldGrip, config: Configuration) -> HeldGrip | None:
    """
    Return a grip without a load after a step of Newton's method in a near configuration.

    It is not in equilibrium: `roll_grip` finds that in the same configuration in fewer steps, with
    its tubes. None if the equations are singular.
    """
    travel = config.roller_positions - grip.config.roller_positions
    g, begin = _begin(grip, config, grip.extrapolate(travel), np.zeros(3))
    linear = linearize_at(g, begin)
    after = step(g, linear, np.inf).iterate
    if not np.isfinite(after.unknowns).all():
        return None
    motion = travel, after.unknowns[0] - grip.unknowns
    return HeldGrip(Equilibria(g, after, linear), motion=motion)


def roll_contacts(
    grip: HeldGrip,
    config: Configuration,
    chosen: ContactSet,
    wrench: Array,
    accuracy: Accuracy = FOLLOWED,
    tubes: BentTubes | None = None,
) -> HeldGrip | None:
    """Return the equilibrium with given rolling contacts, or None; new ones have no friction."""
    travel = config.roller_positions - grip.config.roller_positions
    if chosen.contacts is not grip.contacts:
        return _solve(*_begin_with(grip, config, chosen, wrench), accuracy)
    before = grip.unknowns
    if tubes is not None:
        g = grip.alone.g._replace(wrench=wrench[None])
        rolled = _solve(g, grip.alone.iterate, accuracy, tubes)
    else:
        rolled = _solve(*_begin(grip, config, grip.extrapolate(travel), wrench), accuracy)
        if rolled is None and grip.motion is not None:
            rolled = _solve(*_begin(grip, config, before, wrench), accuracy)
    if rolled is None:
        return None
    return HeldGrip(rolled.samples, motion=(travel, rolled.unknowns - before))


def _solve(
    g: Grasps, begin: Iterate, accuracy: Accuracy, tubes: BentTubes | None = None
) -> HeldGrip | None:
    """Return the equilibrium of one sample near an iterate, or None."""
    for found in find_equilibria(g, begin, accuracy, QUICK, tubes):
        return HeldGrip(Equilibria(found.g, found.iterate, found.linear))
    return None


def _begin(
    grip: HeldGrip, config: Configuration, unknowns: Array, wrench: Array
) -> tuple[Grasps, Iterate]:
    """Return rolling grasps in another configuration, with tubes bent as at given unknowns."""
    one, structure = grip.alone, _structure(grip, config)
    lines = Lines.of(structure, one.g.contacts.members)
    g = one.g._replace(structure=structure, wrench=wrench[None], lines=lines, history=one.history)
    at, linear = unknowns[None], one.linear
    loads = linear.loads_after(at - linear.unknowns)
    bent, _ = linear.tubes.moved(loads, at[:, g.places.feet])
    return g, Iterate(at, linear.tubes.activate(bent))


def _begin_with(
    grip: HeldGrip, config: Configuration, chosen: ContactSet, wrench: Array
) -> tuple[Grasps, Iterate]:
    """Return rolling grasps with other contacts, and straight tubes with the forces before."""
    one, structure, origins = grip.alone, _structure(grip, config), chosen.origins
    # New contacts have the origin -1.
    new = np.flatnonzero(origins < 0)
    g = Grasps.of(structure, ObjectSamples([grip.body]), chosen.contacts, wrench[None])
    angles = one.history.angles[:, origins]
    angles[:, new] = np.angle(g.straight_normals / grip.body.turn)[:, new]
    history = History(one.history.anchors[:, origins], angles, tuple(new.tolist()))
    unknowns = begin_straight(g)
    # Rows: positions, inclinations, normal forces, friction forces.
    by_contact = unknowns[0, POSE:].reshape(4, -1)
    previous = grip.unknowns[POSE:].reshape(4, -1)
    by_contact[:, origins >= 0] = previous[:, origins[origins >= 0]]
    # A new contact has almost no force: the iteration must not cross zero.
    by_contact[2, new] = NEGLIGIBLE_SHARE * grip.squeeze
    feet = begin_straight(g)[:, g.places.feet]
    bent = BentState.straight(structure, feet, bool(wrench.any()))
    return g._replace(history=history), Iterate(unknowns, bent)


def _structure(grip: HeldGrip, config: Configuration) -> Structure:
    """Return the structural model with the tubes of a grip, as that of one sample."""
    return structures_under([config], [grip.pressures], [grip.stiffness])


def with_tubes(
    grip: HeldGrip, pressures: tuple[float, ...] | None, stiffness: float | None = None
) -> HeldGrip:
    """
    Return a held grip with other tubes; its equilibrium must be found by `roll_grip`.

    Computing tables of dents for a pressure takes longer than a control cycle, so a control loop
    ignores small changes, see `steady_pressures`. Without `stiffness` it is that of the grip.
    """
    pressures = pressures or tube_pressures(grip.config.robot.description)
    stiffness = grip.stiffness if stiffness is None else stiffness
    if pressures == grip.pressures and stiffness == grip.stiffness:
        return grip
    one = grip.alone
    structure = structures_under([grip.config], [pressures], [stiffness])
    g = one.g._replace(structure=structure, history=one.history)
    if pressures != grip.pressures:
        g = g._replace(dents=find_dents(structure, g.bodies, g.contacts))
    return HeldGrip(Equilibria(g, one.iterate), motion=grip.motion)
