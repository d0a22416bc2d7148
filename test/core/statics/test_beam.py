# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stiffness of single members against closed forms, flexibilities and rigid motion."""

from frames import member_stiffness
from hypothesis import given
from isotruss_ros.core.statics.beam_column import local_stiffness
from isotruss_ros.core.statics.tangent import chord_motions
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


@given(generators())
@examples(20)
def test_stiffness_inverts_the_flexibility_of_a_cantilever(rng):
    for length, *rigidities in zip(*random_members(rng), strict=True):
        expected, _ = member_stiffness(length + 0j, *rigidities)
        scale = np.sqrt(np.diagonal(expected))
        difference = (member(length, *rigidities) - expected) / scale / scale[:, None]
        assert np.abs(difference).max() < 1e-9


@given(generators())
@examples(20)
def test_pins_of_one_member_leave_the_others_alone(rng):
    members = random_members(rng)
    start, end = rng.random((2, 8)) < 0.5
    pinned = local_stiffness(*members, pins=(start, end))
    for i, values in enumerate(zip(*members, strict=True)):
        alone = member(*values, (start[i], end[i]))
        np.testing.assert_allclose(pinned[i], alone, rtol=1e-12)


@given(generators())
@examples(20)
def test_pins_are_what_an_unloaded_rotation_condenses_to(rng):
    for values in zip(*random_members(rng), strict=True):
        length, _, flexural, shear = values
        matrix, lost = member(*values), 1.0 + 12.0 * flexural / (shear * length**2)
        for free in ([2], [5], [2, 5]):
            kept = [i for i in range(6) if i not in free]
            expected = matrix[np.ix_(kept, kept)] - matrix[np.ix_(kept, free)] @ np.linalg.solve(
                matrix[np.ix_(free, free)], matrix[np.ix_(free, kept)]
            )
            pinned = member(*values, (2 in free, 5 in free))
            # A bar carries exactly nothing across either.
            none = free if len(free) == 1 else [1, 2, 4, 5]
            np.testing.assert_array_equal(pinned[none], 0.0)
            np.testing.assert_array_equal(pinned[:, none], 0.0)
            largest = np.abs(matrix).max()
            assert np.abs(pinned[np.ix_(kept, kept)] - expected).max() < 1e-14 * lost * largest


def test_a_string_has_axial_stiffness_only():
    for pins in ((False, False), (True, False), (False, True), (True, True)):
        matrix = member(2.0, 10.0, 0.0, 5.0, pins)
        assert np.isfinite(matrix).all()
        assert matrix[0, 0] == 5.0
        assert np.abs(matrix).sum() == 20.0


def test_chord_motions_are_stretch_and_sway_to_the_left_and_turns():
    moved = np.array([3.0, 4.0, 0.5, -4.0, 3.0, -0.5])
    along = chord_motions(np.array([0.6 + 0.8j]))[0] @ moved
    np.testing.assert_allclose(along, [-5.0, 5.0, 0.5, -0.5], atol=1e-15)


def test_pins_of_the_softest_member_are_those_of_any_other():
    soft, stiff = (member(1.0, size, size, size, pinned=(True, False)) for size in (1e-3, 1.0))
    assert soft == pytest.approx(1e-3 * stiff, rel=1e-9)
