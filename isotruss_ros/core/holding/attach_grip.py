# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Equilibria of objects near their measured poses, with unknown contact history.

The equilibrium with the least friction is assumed. In directions in which the grip is stiff, the
equilibrium determines the pose; in the others, the measured pose is taken. One object is a batch
of one: the objects that need the same contacts are solved together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.holding.contact_search import (
    add_corner,
    ContactSearch,
    ContactSet,
    run_search,
    search_contacts,
)
from isotruss_ros.core.holding.contacts import find_pressed
from isotruss_ros.core.holding.equations import Grasps, measure_overlaps
from isotruss_ros.core.holding.held_grip import (
    Equilibria,
    GraspInputs,
    HeldGrip,
    HoldStatus,
    NotHeldError,
    scaled_wrench,
)
from isotruss_ros.core.holding.newton import (
    find_equilibria,
    FINE,
    finish,
    Iterate,
    Pace,
    QUICK,
    USUAL,
)
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.manipulation.grip import GRIP_SIZES
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.object_samples import ObjectSamples
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices
from isotruss_ros.core.numerics.samples import join, take
from isotruss_ros.core.numerics.tolerances import MAX_SEARCH_STEPS
from isotruss_ros.core.statics.structure import Structure, structures_under
from isotruss_ros.core.statics.tube_stiffness import Pressure, tube_pressures
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
    near: HeldGrip | None = None,
) -> HeldGrip:
    """
    Find the equilibrium of an object near its measured pose, with unknown contact history.

    The grasping members are given by their indices (m,), or are those that the object overlaps; if
    it overlaps fewer than two, the two nearest. The wrench (fx, fy, m) is about the origin of the
    object's frame [N, N m]; `stiffness` is a factor on EA, EI and GA of the tubes [-]. A `quick`
    search fits in a control cycle. The iteration begins at the equilibrium `near`, if it has the
    same contacts.
    """
    body = body.smoothed(0.5 * config.robot.description.tube_diameter)
    pressures = tube_pressures(config.robot.description, pressure)
    wrench = np.zeros(3) if external_wrench is None else np.asarray(external_wrench)
    inputs = GraspInputs(config, body, members, wrench, pressures, stiffness)
    (attached,) = attach_grips([inputs], quick, near)
    if isinstance(attached, HeldGrip):
        return attached
    raise attached


def attach_grips(
    inputs: Sequence[GraspInputs], quick: bool = False, near: HeldGrip | None = None
) -> list[Attached]:
    """Find the equilibria of n objects, see `attach_grip`; an object without one has its error."""
    try:
        return _attach_objects(_Objects.of(inputs), inputs, quick, near)
    except StructureError as error:
        if len(inputs) == 1:
            return [error]
    return [attached for one in inputs for attached in attach_grips([one], quick)]


class _Objects(NamedTuple):
    """Some of n objects, with all that their equilibria depend on but their contacts."""

    numbers: Indices  #: (q,) numbers of the objects
    structure: Structure
    bodies: ObjectSamples
    wrench: Array  #: (q, 3) external wrenches, see `HeldGrip.wrench` [N]
    is_loaded: Flags  #: (q,) whether there are wrenches, so that all tubes deform

    @classmethod
    def of(cls, inputs: Sequence[GraspInputs]) -> _Objects:
        """Return all objects."""
        configs, bodies, _, wrenches, pressures, stiffness = zip(*inputs, strict=True)
        arms = [body.arm for body in bodies]
        wrench = np.array(list(map(scaled_wrench, wrenches, arms)))
        is_loaded = wrench.any(axis=-1)
        structure = structures_under(configs, pressures, stiffness, bool(is_loaded.all()))
        return cls(np.arange(len(inputs)), structure, ObjectSamples(bodies), wrench, is_loaded)

    def chosen(self, numbers: Sequence[int]) -> _Objects:
        """Return some of all objects, by their numbers in ascending order."""
        return self if len(numbers) == len(self.numbers) else take(self, np.array(numbers))


def _attach_objects(
    every: _Objects, inputs: Sequence[GraspInputs], quick: bool, near: HeldGrip | None
) -> list[Attached]:
    """Return the equilibria of all objects, or errors; raise StructureError for any of them."""
    results: list[Attached] = [NotHeldError(HoldStatus.NO_BALANCE)] * len(inputs)
    config, members = every.structure.config, dict[int, Indices]()
    for i, depths in enumerate(member_depths(config, every.bodies)):
        try:
            members[i] = _grasping_members(inputs[i], depths)
        except NotHeldError as error:
            results[i] = error
    shapes = [given.body.shape for given in inputs]
    # A quick search has fewer sets of contacts, and fewer iterations for each of them, to end
    # within a control cycle.
    limit = QUICK_SETS if quick else MAX_SEARCH_STEPS
    searches: dict[int, ContactSearch] = {
        i: search_contacts(contacts, limit=limit)
        for i, contacts in find_pressed(config, every.bodies, members, shapes).items()
    }
    asked = {i: next(search)[0] for i, search in searches.items()}
    found: dict[int, HeldGrip] = {}
    while asked:
        numbers = _next_group(asked, every.is_loaded)
        answers = _solve(every.chosen(numbers), asked[numbers[0]], quick, near)
        for i in numbers:
            del asked[i]
            try:
                asked[i], _ = searches[i].send(answers.get(i))
            except StopIteration as end:
                if end.value is not None:
                    found[i] = end.value
    groups: dict[tuple[object, ...], list[int]] = {}
    for i, grip in sorted(found.items()):
        g = grip.samples.g
        key = g.contacts.key, g.grazing, bool(every.is_loaded[i])
        groups.setdefault(key, []).append(i)
    for numbers in groups.values():
        grips = _finish(every.chosen(numbers), [found[i] for i in numbers])
        for i, grip in zip(numbers, grips, strict=True):
            results[i] = grip
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


def _next_group(asked: Mapping[int, ContactSet], is_loaded: Flags) -> list[int]:
    """
    Return the ascending numbers of the objects that ask for one of the sets of contacts.

    It is one with the fewest contacts. More objects may ask for larger sets later, so fewer groups
    are solved: 71 instead of 88 in three chances of hexagons; if the set asked for most objects
    were the first one, 76.
    """
    groups: dict[tuple[object, ...], list[int]] = {}
    for i, chosen in sorted(asked.items()):
        key = chosen.contacts.key, chosen.grazing, bool(is_loaded[i])
        groups.setdefault(key, []).append(i)

    def order(numbers: list[int]) -> tuple[int, int]:
        """Return the number of contacts, and the negative number of objects."""
        return len(asked[numbers[0]].contacts.members), -len(numbers)

    return min(groups.values(), key=order)


def _solve(
    objects: _Objects, chosen: ContactSet, quick: bool, near: HeldGrip | None
) -> dict[int, HeldGrip]:
    """
    Return the equilibria of objects with given contacts, by the numbers of the objects.

    Newton's method is repeated with shorter steps where it finds no equilibrium, or one in which a
    member pulls, although all tubes overlap the object by less than their radius; not in a quick
    search.
    """
    g = Grasps.of(*objects[1:3], chosen.contacts, objects.wrench, chosen.grazing)
    straight, solved = Iterate.straight(g, bool(objects.is_loaded[0])), dict[int, HeldGrip]()
    if near is not None and near.contacts.key == chosen.contacts.key:
        _add_equilibria(objects, g, near.alone.iterate, USUAL, solved)
    if not solved:
        _add_equilibria(objects, g, straight, QUICK if quick else USUAL, solved)
    if quick:
        return solved
    overlaps = measure_overlaps(g)
    may_press = ((overlaps > 0.0) & (overlaps < g.structure.tube_radius)).all(axis=-1)
    is_pressed = [
        i in solved and bool((solved[i].normal_forces >= 0.0).all())
        for i in objects.numbers.tolist()
    ]
    rows = np.flatnonzero(may_press & ~np.array(is_pressed))
    if len(rows):
        _add_equilibria(*take((objects, g, straight), rows), FINE, solved)
    return solved


def _add_equilibria(
    objects: _Objects, g: Grasps, begin: Iterate, pace: Pace, solved: dict[int, HeldGrip]
) -> None:
    """Add the equilibria that an iteration finds; one in which a member pulls replaces none."""
    for found in find_equilibria(g, begin, pace=pace):
        samples = Equilibria(found.g, found.iterate, found.linear)
        pulls = (samples.normal_forces < 0.0).any(axis=-1).tolist()
        for row, i in enumerate(objects.numbers[found.samples].tolist()):
            if i not in solved or not pulls[row]:
                solved[i] = HeldGrip(samples, row)


def _finish(objects: _Objects, grips: Sequence[HeldGrip]) -> list[HeldGrip]:
    """Return equilibria with the same contacts after a last step, in the order of the objects."""
    first = grips[0].samples
    if len(grips) == 1:
        g, at = grips[0].alone.g, grips[0].alone.iterate
    else:
        contacts, grazing = first.g.contacts, first.g.grazing
        g = Grasps.of(*objects[1:3], contacts, objects.wrench, grazing)
        at = join(
            [take(grip.samples.iterate, slice(grip.number, grip.number + 1)) for grip in grips]
        )
    finished: dict[int, HeldGrip] = {}
    for found in finish(g, at):
        samples = Equilibria(found.g, found.iterate, found.linear)
        for row, i in enumerate(found.samples.tolist()):
            finished[i] = HeldGrip(samples, row)
    return [finished[i] for i in range(len(grips))]


def lay_faces(grip: HeldGrip, friction: float, gap: float) -> HeldGrip:
    """
    Return the equilibrium with a whole face in contact if the object is held only by this face.

    With wrong roller offsets the modelled tubes are inclined, so the model has a gap, at most
    `gap` [m], at one end of a face that is in contact.
    """
    if grip.required_friction <= friction:  # held as it is
        return grip
    objects = _Objects.of([grip.inputs])

    def solve(chosen: ContactSet, _: HeldGrip | None) -> HeldGrip | None:
        return _solve(objects, chosen, True, None).get(0)

    free = [corner for corner in grip.free_corners if corner.depth > -gap]
    for corner in sorted(free, reverse=True):  # deepest first
        *_, whole_face = add_corner(grip, corner, rolls=False)
        on_face = run_search(search_contacts(whole_face.contacts, limit=QUICK_SETS), solve)
        if on_face is not None and on_face.required_friction <= friction:
            return _finish(objects, [on_face])[0]
    return grip
