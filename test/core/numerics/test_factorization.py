# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arrays that callers pass, and factors of small matrices."""

from hypothesis import given, strategies
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.numerics.arrays import finite_array
from isotruss_ros.core.numerics.factorization import (
    count_negative_pivots,
    estimate_condition,
    factorize,
)
import numpy as np
import pytest
import robots
from scipy.sparse import csc_matrix

KINDS = pytest.mark.parametrize('kind', [np.array, csc_matrix])
#: Its inverse is [[-2, 1], [1.5, -0.5]]: maximum norms 7 and 3, the greatest sums of a row.
MATRIX = [[1.0, 2.0], [3.0, 4.0]]


@KINDS
def test_condition_number_is_estimated_from_below(kind):
    matrix = [[1.0, 1.0, 1.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]]
    for exact, given_matrix in ((7.0 * 3.0, MATRIX), (3.0 * 2.0, matrix)):
        assert 0.1 * exact <= estimate_condition(kind(given_matrix)) <= exact


@KINDS
def test_exactly_singular_matrix_has_no_factor(kind):
    singular = kind([[1.0, 0.0], [0.0, 0.0]])
    assert estimate_condition(singular) == np.inf
    with pytest.raises(np.linalg.LinAlgError):
        factorize(singular)


@KINDS
def test_number_of_negative_pivots_is_that_of_negative_eigenvalues(kind):
    # A constraint beside a stiffness: one eigenvalue is negative, whose diagonal entry is zero.
    assert count_negative_pivots(kind([[0.0, 1.0], [1.0, 0.0]])) == 1
    assert count_negative_pivots(kind(np.diag([1.0, -2.0, 3.0, -4.0]))) == 2


@KINDS
@robots.examples(60)
@given(robots.generators(), strategies.integers(1, 40), strategies.integers(1, 3))
def test_factors_solve_like_numpy_for_any_size(kind, rng, n, columns):
    left, right = (np.linalg.qr(rng.standard_normal((n, n)))[0] for _ in range(2))
    gains = rng.uniform(0.1, 10.0, n)
    matrix = left * gains @ right
    factor = factorize(kind(matrix))
    given_sides = rng.standard_normal((n, columns))
    for sides in (given_sides, given_sides[:, 0].copy()):
        wanted = np.linalg.solve(matrix, sides)
        assert factor.solve(sides) == pytest.approx(wanted, rel=1e-9, abs=1e-10)
        wanted = np.linalg.solve(matrix.T, sides)
        assert factor.solve(sides, transposed=True) == pytest.approx(wanted, rel=1e-9, abs=1e-10)


@pytest.mark.parametrize('values', [(1, 2.0), np.uint8([1, 2]), np.arange(1.0, 3.0)])
def test_real_numbers_become_a_new_array_of_floats(values):
    array = finite_array(values, 2, 'center', GraspError)
    assert array.dtype == np.float64
    assert array.tolist() == [1.0, 2.0]
    array[0] = 5.0
    assert values[0] == 1


NO_PAIRS = [
    *([1.0], [[1.0, 2.0]], [1.0, np.inf], np.float32([1.0, np.inf]), None, [1.0, 2j], ['1', '2']),
    [[1.0], [1.0, 2.0]],
]


@pytest.mark.parametrize('values', NO_PAIRS)
def test_anything_else_is_refused(values):
    with pytest.raises(GraspError, match='must be 2 finite numbers'):
        finite_array(values, 2, 'center', GraspError)
