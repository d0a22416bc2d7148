# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Equilibria of objects with given contacts near their measured poses.

Objects with the same contacts, and tubes that are divided alike, are solved together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.holding.build_statics import (
    build_statics,
    find_feet,
    measure_overlaps,
    start_unknowns,
    statics_of,
)
from isotruss_ros.core.holding.contact_search import ContactSet
from isotruss_ros.core.holding.contact_statics import ContactConditions
from isotruss_ros.core.holding.held_grip import GraspInputs, HeldGrip, scaled_wrench
from isotruss_ros.core.holding.least_friction import least_friction_conditions
from isotruss_ros.core.holding.newton import (
    Accuracy,
    choose,
    find_equilibria,
    FINE_TURN,
    Iteration,
    MAX_TURN,
    SETTLED,
)
from isotruss_ros.core.holding.pressed_contacts import PressedContacts
from isotruss_ros.core.model.object_samples import ObjectSamples
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.samples import take
from isotruss_ros.core.numerics.tolerances import MAX_NEWTON_ITERATIONS, MAX_SEARCH_STEPS
from isotruss_ros.core.statics.load_points import Cuts, group_samples
from isotruss_ros.core.statics.structure import Structure, structure_under, structures_under
import numpy as np

#: Equilibrium, and unknowns near it (3 + 4k,) at which an iteration starts.
Start = tuple[HeldGrip, Array]
#: Equilibrium of an object; None if its contacts have none, an error without a structural model.
Solved: TypeAlias = HeldGrip | StructureError | None


class _Objects(NamedTuple):
    """Some of n objects, with all that their equilibria depend on but their contacts."""

    numbers: Indices  #: (q,) numbers of the objects
    structure: Structure
    bodies: Any  #: `ObjectSamples`; of a single object a `ConvexObject`
    wrench: Array  #: (q, 3) external wrenches, see `HeldGrip.wrench` [N]


class ContactGroupSolver:
    """
    Solver of equilibria of n objects near their measured poses, with unknown contact history.

    An iteration makes at most `steps`. That of a single object, whose arrays lack the axis of the
    samples unless it is one of `samples`, begins at the first of the `starts` that has the same
    contacts, if any.

    :ivar is_single: whether the arrays lack the axis of the samples.
    """

    def __init__(
        self,
        inputs: Sequence[GraspInputs],
        steps: int = MAX_SEARCH_STEPS,
        starts: Sequence[Start] = (),
        accuracy: Accuracy = SETTLED,
        samples: bool = False,
    ) -> None:
        self._inputs, self._steps, self._starts = inputs, steps, starts
        self._accuracy, self.is_single = accuracy, not samples and len(inputs) == 1
        self._wrenches = [scaled_wrench(given.wrench, given.body.arm) for given in inputs]

    def solve(self, asked: Mapping[int, ContactSet]) -> dict[int, Solved]:
        """
        Return the equilibria of one of the sets of contacts that are asked for some objects.

        It is one with the fewest contacts. More objects may ask for larger sets later, so fewer
        groups are solved: 71 instead of 88 in three chances of hexagons; if the set asked for most
        objects were the first one, 76.
        """
        groups: dict[tuple[object, ...], list[int]] = {}
        for i, chosen in asked.items():
            contacts, is_loaded = chosen.contacts, bool(self._wrenches[i].any())
            arrays = contacts.members.tobytes(), contacts.corners.tobytes()
            groups.setdefault((*arrays, chosen.grazing, is_loaded), []).append(i)

        def order(numbers: list[int]) -> tuple[int, int]:
            """Return the number of contacts, and the negative number of objects."""
            return len(asked[numbers[0]].contacts.members), -len(numbers)

        numbers = min(groups.values(), key=order)
        solved: dict[int, Solved] = dict.fromkeys(numbers)
        is_loaded = bool(self._wrenches[numbers[0]].any())
        self._solve_group(numbers, asked[numbers[0]], is_loaded, solved)
        return solved

    def solve_one(self, chosen: ContactSet, _: HeldGrip | None = None) -> HeldGrip | None:
        """Return the equilibrium of the only object, see `ContactSolver`."""
        solved = self.solve({0: chosen})[0]
        if isinstance(solved, StructureError):
            raise solved
        return solved

    def _solve_group(
        self,
        numbers: Sequence[int],
        chosen: ContactSet,
        is_loaded: bool,
        solved: dict[int, Solved],
    ) -> None:
        """Add the equilibria of objects with the same contacts."""
        columns = zip(*(self._inputs[i] for i in numbers), strict=True)
        configs, bodies, _, _, pressures, stiffness = columns
        contacts = chosen.contacts
        try:
            if self.is_single:
                structure = structure_under(configs[0], pressures[0], stiffness[0])
                objects = _Objects(np.zeros(1, int), structure, bodies[0], self._wrenches[0])
            else:
                structure = structures_under(configs, pressures, stiffness, is_loaded)
                wrench = np.array([self._wrenches[i] for i in numbers])
                objects = _Objects(np.array(numbers), structure, ObjectSamples(bodies), wrench)
            near = self._begin_near(objects, contacts)
            straight = [] if near else _begin_straight(objects, contacts, is_loaded)
        except StructureError as error:
            if len(numbers) == 1:
                solved[numbers[0]] = error
                return
            for i in numbers:  # the others have a structural model
                self._solve_group([i], chosen, is_loaded, solved)
            return
        conditions = least_friction_conditions(contacts, chosen.grazing)
        self._solve_from(near or straight, conditions, solved)
        if near and solved[0] is None:
            self._solve_from(_begin_straight(objects, contacts, is_loaded), conditions, solved)

    def _solve_from(
        self,
        begins: Sequence[Iteration],
        conditions: ContactConditions,
        solved: dict[int, Solved],
    ) -> None:
        """
        Add the equilibria that iterations find.

        Those without one are repeated with shorter steps, unless the search is quick; so are those
        in which an object that overlaps its tubes is pulled by one.
        """
        turns = (MAX_TURN, FINE_TURN) if self._steps >= MAX_NEWTON_ITERATIONS else (MAX_TURN,)
        for max_turn in turns:
            pulled = set[int]()
            every = find_equilibria(begins, conditions, self._steps, self._accuracy, max_turn)
            for found in every:
                numbers, lead = found.samples.tolist(), found.state.unknowns.shape[:-1]
                wrench = np.array([self._wrenches[i] for i in numbers]).reshape(*lead, 3)
                grips = HeldGrip.of(found.statics, found.state, wrench)
                forces = found.statics.contacts.sum_by_member(found.state.normal_forces, axis=-1)
                is_pulled = np.atleast_1d((forces < 0.0).any(axis=-1))
                if is_pulled.any():
                    is_pulled &= (measure_overlaps(found.statics) > 0.0).all(axis=-1)
                for k, i in enumerate(numbers):
                    if is_pulled[k]:
                        pulled.add(i)
                    if solved[i] is None or not is_pulled[k]:
                        solved[i] = HeldGrip.sample(grips, k)
            begins = [
                part
                for begin in begins
                for part in choose(
                    begin, np.array([solved[i] is None or i in pulled for i in begin.samples])
                )
            ]
            if not begins:
                return

    def _begin_near(self, objects: _Objects, contacts: PressedContacts) -> list[Iteration]:
        """Return the iteration of a single object that begins near another equilibrium, if any."""
        for grip, unknowns in self._starts:
            if np.array_equal(grip.contacts.corners, contacts.corners):
                bent = grip.statics.bent_under(unknowns, objects.structure)
                near = statics_of(bent, objects.bodies, contacts)
                return [Iteration.of(near, objects.numbers, unknowns, objects.wrench)]
        return []


def _begin_straight(
    objects: _Objects, contacts: PressedContacts, is_loaded: bool
) -> list[Iteration]:
    """Return the iterations that begin with straight tubes at the measured poses."""
    begins, structure = [], objects.structure
    feet = find_feet(structure, objects.bodies, contacts)
    groups: Sequence[Indices | None] = [None]
    if feet.ndim > 1:
        groups = group_samples(structure, Cuts.of(structure, contacts.members, feet))
    for rows in groups:
        group, at = (objects, feet) if rows is None else take((objects, feet), rows)
        statics = build_statics(group.structure, group.bodies, contacts, at, is_loaded)
        begins.append(Iteration.of(statics, group.numbers, start_unknowns(statics), group.wrench))
    return begins
