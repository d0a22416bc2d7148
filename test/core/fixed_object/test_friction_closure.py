# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Force closure against bounded least squares, linear programs and the wedge's closed form."""

import itertools

from hypothesis import given, strategies
from isotruss_ros.core.fixed_object.friction_closure import balance_by_friction
import numpy as np
import pytest
import robots
from scipy.optimize import linprog

coefficients = strategies.floats(0.0, 1.5)
generators = robots.generators()


def tangents_at(angles):
    """Return the counter-clockwise tangents of a disc at these angles of its surface."""
    return np.column_stack([-np.sin(angles), np.cos(angles)])


def random_contacts(rng, count):
    """Return tangents, normal forces (some of them zero) and a load of about their size."""
    tangents = tangents_at(rng.uniform(0.0, 2.0 * np.pi, count))
    forces = rng.uniform(0.1, 10.0, count) * (rng.random(count) < 0.8)
    load = wrenches(tangents, forces).T @ rng.uniform(-1.0, 1.0, count)
    return tangents, forces, load


def wrenches(tangents, forces, levers=1.0):
    """Return (k, 3): of friction N_i at each contact, moments over the arm."""
    return forces[:, None] * np.column_stack([tangents, np.full(len(forces), levers)])


def least_friction(tangents, forces, load, levers=1.0):
    """Return the smallest coefficient by a linear program; infinite if there is none."""
    k, size = len(forces), max(forces.max(initial=0.0), 1e-9)
    one = np.ones((k, 1))
    answer = linprog(
        np.append(np.zeros(k), 1.0),
        A_ub=np.block([[np.eye(k), -one], [-np.eye(k), -one]]),
        b_ub=np.zeros(2 * k),
        A_eq=np.column_stack([wrenches(tangents, forces, levers).T, np.zeros(3)]) / size,
        b_eq=-load / size,
        bounds=[(None, None)] * k + [(0.0, None)],
        method='highs',
    )
    return answer.x[-1] if answer.status == 0 else np.inf


def reach_along(tangents, forces, load, friction, direction, levers=1.0):
    """Return the largest extra load of this direction that friction balances, by a program."""
    k, size = len(forces), forces.max()
    answer = linprog(
        np.append(np.zeros(k), -1.0),
        A_eq=np.column_stack([wrenches(tangents, forces, levers).T / size, direction]),
        b_eq=-load / size,
        bounds=[(-friction, friction)] * k + [(None, None)],
        method='highs',
    )
    return answer.x[-1] * size


@robots.examples(60)
@given(generators, strategies.integers(3, 15), strategies.floats(0.05, 1.5))
def test_closure_margin_is_the_minimum_over_all_directions(rng, count, friction):
    tangents, forces, _ = random_contacts(rng, count)
    forces += 0.1
    shares = rng.uniform(-friction, friction, count)
    arms = rng.uniform(0.3, 1.5, count)
    load = -wrenches(tangents, forces, arms).T @ shares
    margin = balance_by_friction(tangents, forces, load, friction, arms).margin
    assert margin >= -1e-9
    directions = rng.normal(size=(40, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    reached = [reach_along(tangents, forces, load, friction, way, arms) for way in directions]
    assert min(reached) >= margin * (1.0 - 1e-6) - 1e-6
    # The shortest way is across a facet, a plane of two contacts: one of those reaches no further.
    pairs = itertools.combinations(wrenches(tangents, np.ones(count), arms), 2)
    facets = np.array([np.cross(*pair) for pair in pairs])
    facets = facets[np.linalg.norm(facets, axis=1) > 1e-6]
    facets /= np.linalg.norm(facets, axis=1)[:, None]
    spans = np.abs(facets @ wrenches(tangents, forces, arms).T).sum(axis=1)
    nearest = facets[(friction * spans - np.abs(facets @ load)).argmin()]
    ways = (nearest, -nearest)
    reached = [reach_along(tangents, forces, load, friction, way, arms) for way in ways]
    assert min(reached) == pytest.approx(margin, rel=1e-5, abs=1e-6)


# Objects that are no discs: friction has levers of its own.


@robots.examples(80)
@given(
    generators, strategies.integers(1, 15), coefficients, strategies.sampled_from([1e-6, 1.0, 1e6])
)
def test_required_friction_with_levers_agrees_with_a_linear_program(rng, count, friction, scale):
    tangents, forces, _ = random_contacts(rng, count)
    levers = rng.uniform(-0.5, 2.0, count)
    load = wrenches(tangents, forces, levers).T @ rng.uniform(-1.0, 1.0, count)
    expected = least_friction(tangents, forces, load, levers)
    forces, load = scale * forces, scale * load
    closure = balance_by_friction(tangents, forces, load, friction, levers)
    assert closure.required_friction == pytest.approx(expected, rel=1e-5, abs=1e-6)
    left = load + np.column_stack([tangents, levers]).T @ closure.friction_forces
    assert closure.residual == pytest.approx(np.linalg.norm(left), abs=1e-9 * forces.sum())
    assert closure.closed == (closure.residual <= closure.tolerance)
    if closure.required_friction <= friction:
        assert closure.closed
    else:
        # What is closed although it needs a little more friction is so within the tolerance.
        assert closure.margin <= 0.0
        assert closure.residual >= -closure.margin * (1.0 - 1e-9) - 1e-12 * forces.sum()


@pytest.mark.parametrize(('apart', 'closed'), [(1e-7, True), (1e-5, False)])
def test_opposite_contacts_have_closure_up_to_a_relative_tolerance_of_1e_6(apart, closed):
    tangents, forces = tangents_at(np.array([0.0, np.pi])), np.array([10.0, 10.0 * (1.0 + apart)])
    load = np.array([forces[1] - forces[0], 0.0, 0.0])
    closure = balance_by_friction(tangents, forces, load, 0.5, np.ones(2))
    assert closure.residual == pytest.approx(10.0 * apart, rel=1e-3)
    assert closure.closed is closed
    # No wrench across the plane of both contacts is balanced.
    assert closure.margin <= 0.0
