# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Grasp quality of Ferrari and Canny against closed forms and a linear program."""

import math

from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core.contact.wrench_space import wrench_space
from isotruss_ros.core.errors import GraspError
import numpy as np
import pytest
import robots
from scipy.optimize import linprog


def on_disc(*angles):
    """Return contacts on a disc of radius 1 and their normals, at angles in degrees."""
    turn = np.radians(angles)
    around = np.column_stack([np.cos(turn), np.sin(turn)])
    return around, around


@pytest.mark.parametrize(('friction', 'radius'), [(0.1, 1.0), (0.5, 0.15), (2.0, 1.0)])
def test_epsilon_of_antipodal_contacts_has_a_closed_form(friction, radius):
    # The wrenches span a tetrahedron with two orthogonal edges at distance 2.
    points, normals = on_disc(0.0, 180.0)
    space = wrench_space(radius * points, normals, friction, radius)
    assert space.epsilon == pytest.approx(friction / math.hypot(friction, math.sqrt(2.0)))
    assert space.volume == pytest.approx(8.0 * friction**2 / 3.0)


@pytest.mark.parametrize(('angle', 'closed'), [(1.0, True), (-1.0, False)])
def test_two_contacts_close_if_the_chord_is_in_both_cones(angle, closed):
    # Nguyen (1988): the chord between contacts at an angle of 180 degrees - 2 a is inclined by a.
    friction = 0.5
    inclined = math.degrees(math.atan(friction)) - angle
    space = wrench_space(*on_disc(0.0, 180.0 - 2.0 * inclined), friction, 1.0)
    assert space.closed is closed


def largest_load(points, normals, friction, direction, norm):
    """Return the largest load in a direction that the contacts balance, by a linear program."""
    tangents = np.column_stack([-normals[:, 1], normals[:, 0]])
    forces = np.concatenate([friction * tangents - normals, -friction * tangents - normals])
    arms = np.concatenate([points, points])
    moments = arms[:, 0] * forces[:, 1] - arms[:, 1] * forces[:, 0]
    wrenches = np.column_stack([forces, moments]).T
    count = len(points)
    cones = np.hstack([np.eye(count), np.eye(count)])
    limits = cones.sum(axis=0, keepdims=True) if norm == 'L1' else cones
    solution = linprog(
        np.append(np.zeros(2 * count), -1.0),
        A_ub=np.column_stack([limits, np.zeros(len(limits))]),
        b_ub=np.ones(len(limits)),
        A_eq=np.column_stack([wrenches, -direction]),
        b_eq=np.zeros(3),
    )
    return solution.x[-1]


@robots.examples(100)
@given(st.integers(0, 10_000), st.sampled_from(['L1', 'Linf']))
def test_no_load_of_size_epsilon_exceeds_the_contacts(seed, norm):
    random = np.random.default_rng(seed)
    points, normals = on_disc(*random.uniform(0.0, 360.0, 3))
    points = points * random.uniform(0.5, 1.5, (3, 1))
    space = wrench_space(points, normals, 0.6, 1.0, norm)
    directions = random.normal(size=(20, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for direction in directions:
        assert largest_load(points, normals, 0.6, direction, norm) >= space.epsilon - 1e-9


@pytest.mark.parametrize(
    ('changed', 'message'),
    [
        ({'normals': [(5.0, 0.0), (-5.0, 0.0)]}, 'normal 0 has the length 5: must be 1'),
        ({'normals': [(1.0, 0.0)]}, '2 points and 1 normals: must be equal numbers, 1 or more'),
        ({'points': [(1.0, 0.0), (math.nan, 0.0)]}, 'points .* must be 2 x 2 finite numbers'),
        ({'arm': 0.0}, r'characteristic radius 0.0 m: must be from '),
        ({'norm': 'L2'}, "'L2': must be 'L1' or 'Linf'"),
    ],
)
def test_invalid_contacts_are_refused_with_the_valid_form(changed, message):
    points, normals = on_disc(0.0, 180.0)
    values = {'points': points, 'normals': normals, 'friction': 0.5, 'arm': 1.0}
    with pytest.raises(GraspError, match=message):
        wrench_space(**values | changed)
