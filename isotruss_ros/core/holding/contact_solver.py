# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Equilibria of objects with given contacts near their measured poses.

Objects with the same contacts, and tubes that are divided alike, are solved together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

from isotruss_ros.core.errors import StructureError
from isotruss_ros.core.holding.build_statics import (
    build_statics,
    find_feet,
    start_unknowns,
    statics_of,
)
from isotruss_ros.core.holding.contact_search import ContactSet
from isotruss_ros.core.holding.contact_statics import ContactConditions
from isotruss_ros.core.holding.held_grip import GraspInputs, HeldGrip, scaled_wrench
from isotruss_ros.core.holding.least_friction import least_friction_conditions
from isotruss_ros.core.holding.newton import Accuracy, find_equilibria, Iteration, SETTLED
from isotruss_ros.core.holding.pressed_contacts import PressedContacts
from isotruss_ros.core.model.object_samples import ObjectSamples
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.samples import take
from isotruss_ros.core.numerics.tolerances import MAX_SEARCH_STEPS
from isotruss_ros.core.statics.load_points import group_cuts
from isotruss_ros.core.statics.structure import Structure, structures_under
import numpy as np

#: Equilibrium, and unknowns near it (3 + 4k,) at which an iteration starts.
Start = tuple[HeldGrip, Array]
#: Equilibrium of an object; None if its contacts have none, an error without a structural model.
Solved: TypeAlias = HeldGrip | StructureError | None


class _Objects(NamedTuple):
    """Some of n objects, with all that their equilibria depend on but their contacts."""

    numbers: Indices  #: (q,) numbers of the objects
    structure: Structure
    bodies: ObjectSamples
    wrench: Array  #: (q, 3) external wrenches, see `HeldGrip.wrench` [N]


class ContactGroupSolver:
    """
    Solver of equilibria of n objects near their measured poses, with unknown contact history.

    An iteration makes at most `steps`. It begins at the first of the `starts` of its object that
    has the same contacts, if any.
    """

    def __init__(
        self,
        inputs: Sequence[GraspInputs],
        steps: int = MAX_SEARCH_STEPS,
        starts: Sequence[Sequence[Start]] = (),
        accuracy: Accuracy = SETTLED,
    ) -> None:
        self._inputs, self._steps, self._starts = inputs, steps, starts
        self._accuracy = accuracy
        self._wrenches = [scaled_wrench(given.wrench, given.body.arm) for given in inputs]

    def solve(self, asked: Mapping[int, ContactSet]) -> dict[int, Solved]:
        """Return the equilibria of the sets of contacts that are asked for some objects."""
        groups: dict[tuple[object, ...], list[int]] = {}
        for i, chosen in asked.items():
            contacts, is_loaded = chosen.contacts, bool(self._wrenches[i].any())
            arrays = contacts.members.tobytes(), contacts.corners.tobytes()
            groups.setdefault((*arrays, chosen.grazing, is_loaded), []).append(i)
        solved: dict[int, Solved] = dict.fromkeys(asked)
        for key, numbers in groups.items():
            self._solve_group(numbers, asked[numbers[0]], bool(key[-1]), solved)
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
        wrench, contacts = np.array([self._wrenches[i] for i in numbers]), chosen.contacts
        try:
            structure = structures_under(configs, pressures, stiffness, is_loaded)
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
        is_left = np.array([solved[i] is None for i in numbers])
        if near and is_left.any():
            straight = _begin_straight(take(objects, is_left), contacts, is_loaded)
            self._solve_from(straight, conditions, solved)

    def _solve_from(
        self,
        begins: Sequence[Iteration],
        conditions: ContactConditions,
        solved: dict[int, Solved],
    ) -> None:
        """Add the equilibria that iterations find."""
        for found in find_equilibria(begins, conditions, self._steps, self._accuracy):
            wrench = np.array([self._wrenches[i] for i in found.samples.tolist()])
            grips = HeldGrip.of(found.statics, found.state, wrench)
            for k, i in enumerate(found.samples.tolist()):
                solved[i] = HeldGrip.sample(grips, k)

    def _begin_near(self, objects: _Objects, contacts: PressedContacts) -> list[Iteration]:
        """Return the iterations that begin near other equilibria."""
        begins = []
        for k, i in enumerate(objects.numbers.tolist() if self._starts else ()):
            for grip, unknowns in self._starts[i]:
                if np.array_equal(grip.contacts.corners, contacts.corners):
                    one = take(objects, [k])
                    bent = grip.statics.bent_under(unknowns, take(one.structure, 0))
                    near = statics_of(take(bent, None), one.bodies, contacts)
                    begins.append(Iteration.of(near, one.numbers, unknowns[None], one.wrench))
                    break
        return begins


def _begin_straight(
    objects: _Objects, contacts: PressedContacts, is_loaded: bool
) -> list[Iteration]:
    """Return the iterations that begin with straight tubes at the measured poses."""
    begins, count = [], len(objects.numbers)
    feet = find_feet(objects.structure, objects.bodies, contacts)
    for rows in group_cuts(objects.structure, contacts.members, feet) if count else ():
        group, at = (objects, feet) if len(rows) == count else take((objects, feet), rows)
        statics = build_statics(group.structure, group.bodies, contacts, at, is_loaded)
        begins.append(Iteration.of(statics, group.numbers, start_unknowns(statics), group.wrench))
    return begins
