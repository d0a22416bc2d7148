# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arrays that callers pass, factors of small matrices, and changes of frozen records."""

import dataclasses
from functools import cached_property

from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.numerics.arrays import finite_array
from isotruss_ros.core.numerics.factorization import factorize
from isotruss_ros.core.numerics.frozen import replace
import numpy as np
import pytest
import robots
from scipy.sparse import csc_matrix

KINDS = pytest.mark.parametrize('kind', [np.array, csc_matrix])


@KINDS
@robots.examples(60)
@given(robots.generators(), st.integers(1, 40), st.integers(1, 3))
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


@dataclasses.dataclass(frozen=True)
class Side:
    """Length of a square [m]."""

    length: float
    name: str = 'square'

    @cached_property
    def area(self):
        """Return the area [m^2]."""
        return self.length**2


def test_a_changed_record_has_its_own_cached_properties():
    side = Side(2.0, name='tile')
    assert side.area == 4.0
    changed = replace(side, length=3.0)
    assert changed == dataclasses.replace(side, length=3.0)
    assert (changed.area, side.area) == (9.0, 4.0)
