# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Violations of requirements by grasp candidates, as numbers and as text."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
from dataclasses import dataclass
import math
from typing import Any

from isotruss_ros.core.errors import distinct_numbers, IsotrussError

#: Sentence for each violated requirement, in the order in which the search tests them; a candidate
#: that violates a later requirement is closer to a grasp.
SENTENCES_BY_REQUIREMENT = {
    'free': 'the robot overlaps the object: the gap is {value} m; must be at least {bound} m: '
    'move the object away from the robot, or open the grip',
    'enclosed': 'no members enclose the object',
    'members': '{value} of the {bound} required members are visible from the object',
    'opposed': 'no near directions of the members balance within their friction cones',
    'facing': 'the members stay {value} rad from directions with force closure',
    'reach': 'a member stays {value} m short of the object',
    'rigidity': 'the rigidity index on the path is {value}; must be at least {bound}',
    'self_clearance': 'along the path the clearance of the robot from itself is {value} m',
    'object_clearance': 'a part outside of the grip comes within {value} m of the object',
    'obstacle_clearance': '{name} are {value} m apart; must be at least {bound} m',
    'in_place': 'closing displaces the object by {value} m; must be at most {bound} m',
    'turned': 'the release turns the object by {value} rad; must be at most {bound}',
    'squeeze': 'limits end the closing at {value} N of each member; must be {bound} N',
    'held': 'no pose near the object balances the forces of the members',
}
#: Sentence for each requirement of the last stage of the search. Violations of these requirements
#: are compared by their relative size.
BOUNDS = {
    'min_slip_margin': 'the slip margin is {value} N; must be at least {bound} N',
    'force_closure': 'the required friction is {value}; must be at most {bound}',
    'max_contact_force': 'one member presses with {value} N; must be at most {bound} N',
    'max_total_force': 'all members press with {value} N; must be at most {bound} N',
    'max_utilisation': 'the utilisation of a tube is {value}; must be at most {bound}',
    'carry': 'the object slips or is out of reach after {share:.0%} of its path',
}


@dataclass(frozen=True)
class Violation:
    """Requirement that a grasp candidate violates."""

    requirement: str  #: name of the requirement
    value: float  #: value of the bounded quantity for the candidate
    bound: float  #: bound of the requirement on this quantity
    name: str = ''  #: names of the part and of the obstacle whose distance is the quantity

    @property
    def distance(self) -> float:
        """Return the size of the violation [-], larger for requirements of earlier stages."""
        if self.requirement in BOUNDS:
            low, high = sorted((max(self.value, 0.0), self.bound))
            return 1.0 - low / high if high > 0.0 else 1.0
        names = list(SENTENCES_BY_REQUIREMENT)
        if self.requirement not in names:
            return math.inf
        return 1.0 + len(names) - names.index(self.requirement)

    def __str__(self) -> str:
        """Return a sentence that describes the violation."""
        sentence = (SENTENCES_BY_REQUIREMENT | BOUNDS).get(self.requirement)
        if sentence is None:
            return f'the closest grasp candidate cannot be computed: {self.requirement}'
        value, bound = distinct_numbers(self.value, self.bound)
        words = sentence.format(value=value, bound=bound, share=self.value, name=self.name)
        return f'{self.requirement}: {words}'


class RequirementError(IsotrussError):
    """Error: a candidate violates a requirement. The arguments are the fields of a `Violation`."""


@dataclass
class SearchTally:
    """Counts of a search, and the violation that was closest to an admissible grasp."""

    evaluations: int = 0  #: number of computed configurations
    analyses: int = 0  #: number of assessed equilibria
    #: violation of the candidate closest to an admissible grasp; if there are several, the first
    closest: Violation | None = None

    def record(self, violation: Violation) -> None:
        """Store a violation if it is closer to an admissible grasp than the stored violation."""
        if self.closest is None or violation.distance < self.closest.distance:
            self.closest = violation

    @contextlib.contextmanager
    def recording(self) -> Iterator[None]:
        """Catch a RequirementError raised inside a `with` block, and record its violation."""
        try:
            yield
        except RequirementError as error:
            self.record(Violation(*error.args))

    def add(self, other: SearchTally) -> None:
        """Add the counts of another candidate, and record the violation of that candidate."""
        self.evaluations += other.evaluations
        self.analyses += other.analyses
        if other.closest is not None:
            self.record(other.closest)


def export_violation(violation: Violation | None) -> dict[str, Any]:
    """Return a violated requirement with its value and bound as a dictionary; empty for None."""
    if violation is None:
        return {}
    return {
        'violated_requirement': violation.requirement,
        'violation_value': float(violation.value),
        'violation_bound': float(violation.bound),
    }


def violation_in_words(violation: Violation | None) -> str:
    """Return a sentence that describes the violation of a requirement."""
    return 'there was no grasp candidate' if violation is None else str(violation)
