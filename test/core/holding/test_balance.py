# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Newton's method for the balance of a held object, on equations whose solution is known."""

from types import SimpleNamespace

from isotruss_ros.core.holding.contact_forces import ANGLE, CENTER, ContactForces, Places
from isotruss_ros.core.holding.contact_statics import ContactStatics, MAX_TURN
from isotruss_ros.core.numerics.tolerances import MAX_NEWTON_ITERATIONS
import numpy as np
import pytest

PLACES = Places.of(1)
ARM = 0.2
START = np.zeros(PLACES.size)


def solve_balance(equations, arm):
    """Solve made-up equations of one contact."""
    statics = SimpleNamespace(places=PLACES, sides=np.ones(1), body=SimpleNamespace(arm=arm))
    statics.equations = lambda unknowns, _wrench, _closure: equations(unknowns)
    return ContactStatics.solve(statics, START, None, None)


def linear(goal, matrix, tried):
    """Return linear equations with a solution, which record where they are asked."""

    def equations(unknowns):
        tried.append(unknowns)
        return matrix @ (unknowns - goal), ContactForces(unknowns, None, None, matrix)

    return equations


def goal_of(**parts):
    """Return unknowns, of which some are given; the contact presses."""
    goal = START.copy()
    goal[PLACES.normal] = 10.0
    for name, values in parts.items():
        goal[{'center': CENTER, 'angle': ANGLE}.get(name) or getattr(PLACES, name)] = values
    return goal


@pytest.mark.parametrize(
    ('parts', 'steps'),
    [
        ({'center': (0.0, -1.0)}, 10),
        ({'feet': 0.5}, 5),
        ({'angle': -3.0 * MAX_TURN}, 3),
        ({'inclinations': 0.4}, 2),
    ],
)
def test_newton_steps_are_bounded(parts, steps):
    tried = []
    goal = goal_of(**parts)
    found = solve_balance(linear(goal, np.eye(PLACES.size), tried), ARM)
    assert found.unknowns == pytest.approx(goal)
    assert np.array(tried) == pytest.approx(np.linspace(0.0, 1.0, steps + 1)[:, None] * goal)


def test_equations_without_an_unfolded_solution_return_none():
    singular = np.diag([1.0, 1.0, 1.0, 1.0, 0.0, 1.0, 1.0])
    infinite = np.full((PLACES.size, PLACES.size), np.nan)
    for matrix in (singular, infinite):

        def equations(unknowns, matrix=matrix):
            return np.ones(PLACES.size), ContactForces(unknowns, None, None, matrix)

        assert solve_balance(equations, ARM) is None
    for inclination in (0.51, -0.51):
        folded = linear(goal_of(inclinations=inclination), np.eye(PLACES.size), [])
        assert solve_balance(folded, ARM) is None
    tried = []
    far = linear(goal_of(feet=ARM * MAX_NEWTON_ITERATIONS), np.eye(PLACES.size), tried)
    assert solve_balance(far, ARM) is None
    assert len(tried) == MAX_NEWTON_ITERATIONS
