# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Stiffness of single members against closed forms, flexibilities and rigid motion."""

from hypothesis import given
from isotruss_ros.core.statics.beam import directions, local_stiffness
import numpy as np
import pytest
from robots import examples, generators


def random_members(rng, k=8, shear=True):
    """Return lengths and rigidities EA, EI, GA over four decades."""
    length, axial, flexural = 10.0 ** rng.uniform([[-2], [2], [-1]], [[1], [6], [3]], (3, k))
    stiffness = 10.0 ** rng.uniform(1.0, 6.0, k) if shear else np.full(k, np.inf)
    return length, axial, flexural, stiffness


def member(length, axial, flexural, shear=np.inf, pinned=(False, False)):
    """Return the (6, 6) matrix of one member."""
    values = (np.array([float(x)]) for x in (length, axial, flexural, shear))
    return local_stiffness(*values, pins=tuple(np.array([pin]) for pin in pinned))[0]


def flexibility(length, axial, flexural, shear):
    """Return how the free end of a cantilever gives: (ux, uy, theta) under unit loads."""
    return np.array(
        [
            [length / axial, 0.0, 0.0],
            [0.0, length**3 / (3.0 * flexural) + length / shear, length**2 / (2.0 * flexural)],
            [0.0, length**2 / (2.0 * flexural), length / flexural],
        ]
    )


@given(generators())
@examples(20)
def test_stiffness_inverts_the_flexibility_of_a_cantilever(rng):
    for length, axial, flexural, shear in zip(*random_members(rng), strict=True):
        give = flexibility(length, axial, flexural, shear)
        matrix = member(length, axial, flexural, shear)
        # What is pushed at the end is carried by the start: rows of equilibrium about it.
        carry = np.array([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, -length, -1.0]])
        end = np.linalg.inv(give)
        expected = np.block([[carry @ end @ carry.T, carry @ end], [end @ carry.T, end]])
        scale = np.sqrt(np.diagonal(expected))
        np.testing.assert_allclose(
            matrix / scale / scale[:, None], expected / scale / scale[:, None], atol=1e-9
        )


@given(generators())
@examples(20)
def test_a_bar_pinned_at_both_ends_carries_exactly_nothing_across(rng):
    length, axial, *others = random_members(rng)
    bars = local_stiffness(length, axial, *others, pins=(np.full(8, True), np.full(8, True)))
    expected = np.zeros((8, 6, 6))
    for i, k in enumerate(axial / length):
        expected[i, 0, 0] = expected[i, 3, 3] = k
        expected[i, 0, 3] = expected[i, 3, 0] = -k
    np.testing.assert_array_equal(bars, expected)


@given(generators())
@examples(20)
def test_pins_of_one_member_leave_the_others_alone(rng):
    members = random_members(rng)
    start, end = rng.random((2, 8)) < 0.5
    pinned = local_stiffness(*members, pins=(start, end))
    for i, values in enumerate(zip(*members, strict=True)):
        np.testing.assert_array_equal(pinned[i], member(*values, (start[i], end[i])))


@given(generators())
@examples(20)
def test_pins_are_what_an_unloaded_rotation_condenses_to(rng):
    for values in zip(*random_members(rng), strict=True):
        length, _, flexural, shear = values
        matrix, lost = member(*values), 1.0 + 12.0 * flexural / (shear * length**2)
        for free in ([2], [5]):
            kept = [i for i in range(6) if i not in free]
            expected = matrix[np.ix_(kept, kept)] - matrix[np.ix_(kept, free)] @ np.linalg.solve(
                matrix[np.ix_(free, free)], matrix[np.ix_(free, kept)]
            )
            pinned = member(*values, (2 in free, 5 in free))
            np.testing.assert_array_equal(pinned[free], 0.0)
            np.testing.assert_array_equal(pinned[:, free], 0.0)
            largest = np.abs(matrix).max()
            assert np.abs(pinned[np.ix_(kept, kept)] - expected).max() < 1e-14 * lost * largest


def test_a_string_has_axial_stiffness_only():
    for pins in ((False, False), (True, False), (False, True), (True, True)):
        matrix = member(2.0, 10.0, 0.0, 5.0, pins)
        assert np.isfinite(matrix).all()
        assert matrix[0, 0] == 5.0
        assert np.abs(matrix).sum() == 20.0


@given(generators())
@examples(20)
def test_directions_are_orthogonal_and_turn_like_the_plane(rng):
    angle, turn = rng.uniform(-np.pi, np.pi, 5), rng.uniform(-np.pi, np.pi)
    matrices = directions(np.exp(1j * angle))
    identity = np.broadcast_to(np.eye(6), (5, 6, 6))
    np.testing.assert_allclose(matrices @ matrices.transpose(0, 2, 1), identity, atol=1e-15)
    # Turning the member with its displacements changes nothing along and across it.
    together = directions(np.exp(1j * (angle + turn))) @ directions(np.exp([-1j * turn]))
    np.testing.assert_allclose(together, matrices, atol=1e-15)


def test_directions_measure_along_and_to_the_left_of_the_member():
    moved = np.array([3.0, 4.0, 0.5, -4.0, 3.0, -0.5])
    along = directions(np.array([0.6 + 0.8j]))[0] @ moved
    np.testing.assert_allclose(along, [5.0, 0.0, 0.5, 0.0, 5.0, -0.5], atol=1e-15)


def test_pins_of_the_softest_member_are_those_of_any_other():
    soft, stiff = (member(1.0, size, size, size, pinned=(True, False)) for size in (1e-3, 1.0))
    assert soft == pytest.approx(1e-3 * stiff, rel=1e-9)
