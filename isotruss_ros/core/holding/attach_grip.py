# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Equilibrium of an object near its measured pose, with unknown contact history.

The equilibrium with the least friction is assumed. In directions in which the grip is stiff, the
equilibrium determines the pose; in the others, the measured pose is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.holding.contact_search import (
    add_corner,
    ContactSearch,
    run_search,
    search_contacts,
)
from isotruss_ros.core.holding.contact_solver import ContactGroupSolver, Start
from isotruss_ros.core.holding.free_corners import find_free_corners
from isotruss_ros.core.holding.held_grip import GraspInputs, HeldGrip, HoldStatus, NotHeldError
from isotruss_ros.core.holding.newton import Accuracy, SETTLED
from isotruss_ros.core.holding.pressed_contacts import find_pressed
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.manipulation.grip import GRIP_SIZES
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.object_samples import ObjectSamples
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.tolerances import MAX_NEWTON_ITERATIONS, MAX_SEARCH_STEPS
from isotruss_ros.core.statics.section import Pressure, tube_pressures
from isotruss_ros.core.statics.structure import ConfigurationSamples
import numpy as np

#: Largest number of sets of contacts in a quick search [-]. It finds 315 of the 318 equilibria of
#: random polygons that the whole search finds; with 2 sets it finds 291, and with 8 it finds all
#: and takes up to 1.5 times as long.
QUICK_SETS = 4
#: Equilibrium of an object, or the error that it has none.
Attached: TypeAlias = HeldGrip | NotHeldError | StructureError


def attach_grip(
    config: Configuration,
    body: ConvexObject,
    members: Indices | None = None,
    external_wrench: Array | None = None,
    pressure: Pressure | None = None,
    stiffness: float = 1.0,
    quick: bool = False,
    starts: Sequence[Start] = (),
) -> HeldGrip:
    """
    Find the equilibrium of an object near its measured pose, with unknown contact history.

    The grasping members are given by their indices (m,), or are those that the object overlaps; if
    it overlaps fewer than two, the two nearest. The wrench (fx, fy, m) is about the origin of the
    object's frame [N, N m]; `stiffness` is a factor on EA, EI and GA of the tubes [-]. A `quick`
    search fits in a control cycle. The iteration begins at the first of `starts` that has the same
    contacts, if any.
    """
    body = body.smoothed(0.5 * config.robot.description.tube_diameter)
    pressures = tube_pressures(config.robot.description, pressure)
    wrench = np.zeros(3) if external_wrench is None else np.asarray(external_wrench)
    inputs = GraspInputs(config, body, members, wrench, pressures, stiffness)
    (attached,) = attach_grips([inputs], quick, starts)
    if isinstance(attached, HeldGrip):
        return attached
    raise attached


def attach_grips(
    inputs: Sequence[GraspInputs],
    quick: bool = False,
    starts: Sequence[Start] = (),
    accuracy: Accuracy = SETTLED,
    samples: bool = False,
) -> list[Attached]:
    """
    Find the equilibria of n objects, see `attach_grip`; an object without one has its error.

    For `starts` and `samples` see `ContactGroupSolver`.
    """
    # A quick search has fewer sets of contacts, and fewer iterations for each of them, to end
    # within a control cycle.
    limit = QUICK_SETS if quick else MAX_SEARCH_STEPS
    steps = MAX_SEARCH_STEPS if quick else MAX_NEWTON_ITERATIONS
    results: list[Attached] = [NotHeldError(HoldStatus.NO_BALANCE)] * len(inputs)
    searches: dict[int, ContactSearch] = {}
    solver = ContactGroupSolver(inputs, steps, starts, accuracy, samples)
    configs: Any = [given.config for given in inputs]
    bodies: Any = [given.body for given in inputs]
    shapes = [body.shape for body in bodies]
    if solver.is_single:
        (configs,), (bodies,) = configs, bodies
    else:
        configs, bodies = ConfigurationSamples(configs), ObjectSamples(bodies)
    members = dict[int, Indices]()
    for i, depths in enumerate(np.atleast_2d(member_depths(configs, bodies))):
        try:
            members[i] = _grasping_members(inputs[i], depths)
        except NotHeldError as error:
            results[i] = error
    for i, contacts in find_pressed(configs, bodies, members, shapes).items():
        searches[i] = search_contacts(contacts, limit=limit)
    asked = {i: next(search)[0] for i, search in searches.items()}
    while asked:
        for i, answer in solver.solve(asked).items():
            del asked[i]
            if isinstance(answer, StructureError):
                results[i] = answer
                continue
            try:
                asked[i], _ = searches[i].send(answer)
            except StopIteration as end:
                results[i] = end.value or results[i]
    return results


def _grasping_members(inputs: GraspInputs, depths: Array) -> Indices:
    """
    Return the sorted indices (m,) of the grasping members; raise NotHeldError without them.

    For `depths` see `member_depths`.
    """
    diameter, members = inputs.config.robot.description.tube_diameter, inputs.members
    if members is None:
        # Those that overlap are the deepest; if these are fewer than two, the two nearest.
        count = max(int(np.count_nonzero(depths > 0.0)), 2)
        if count > GRIP_SIZES[-1]:
            raise NotHeldError(HoldStatus.OTHER_CONTACT)
        members = np.argsort(depths, kind='stable')[-count:]
    members = np.sort(np.asarray(members, dtype=np.intp))
    if depths[members].min() <= -diameter:
        raise NotHeldError(HoldStatus.NO_CONTACT)
    return members


def lay_faces(grip: HeldGrip, friction: float, gap: float) -> HeldGrip:
    """
    Return the equilibrium with a whole face in contact if the object is held only by this face.

    With wrong roller offsets the modelled tubes are inclined, so the model has a gap, at most
    `gap` [m], at one end of a face that is in contact.
    """
    if grip.required_friction <= friction:  # held as it is
        return grip
    solver = ContactGroupSolver([grip.inputs])
    for corner in sorted(find_free_corners(grip, gap), reverse=True):  # deepest first
        *_, whole_face = add_corner(grip, corner, rolls=False)
        search = search_contacts(whole_face.contacts, limit=QUICK_SETS)
        on_face = run_search(search, solver.solve_one)
        if on_face is not None and on_face.required_friction <= friction:
            return on_face
    return grip
