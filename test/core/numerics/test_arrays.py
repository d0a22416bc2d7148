# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers that callers hand over: taken as they are, or refused with what was given."""

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.numerics.arrays import as_xy, finite_array
import numpy as np
import pytest


@pytest.mark.parametrize('values', [(1, 2.0), np.uint8([1, 2]), np.arange(1.0, 3.0)])
def test_real_numbers_become_a_new_array_of_floats(values):
    array = finite_array(values, 2, 'center', GraspError)
    assert array.dtype == np.float64
    assert array.tolist() == [1.0, 2.0]
    array[0] = 5.0
    assert values[0] == 1


NO_PAIRS = [[1.0], [1.0, 2.0, 3.0], [[1.0, 2.0]], [1.0, np.nan], [1.0, np.inf], None]
NO_PAIRS += [[1.0, 2j], ['1', '2'], [True, False], [[1.0], [1.0, 2.0]]]


@pytest.mark.parametrize('values', NO_PAIRS)
def test_anything_else_is_refused(values):
    with pytest.raises(GraspError, match='must be 2 finite numbers'):
        finite_array(values, 2, 'center', GraspError)


def test_invalid_input_is_shown_up_to_80_characters():
    for length, shown in ((78, repr('a' * 78)), (79, "'" + 'a' * 76 + '...')):
        with pytest.raises(GraspError) as refused:
            finite_array('a' * length, 2, 'center', GraspError)
        assert str(refused.value) == f'center: {shown}: must be 2 finite numbers'


def test_vectors_become_rows_of_x_and_y():
    assert as_xy(np.array([1 + 2j, 3 + 4j, 5 + 6j])[::2]).tolist() == [[1.0, 2.0], [5.0, 6.0]]
    assert as_xy(np.zeros(0, dtype=complex)).shape == (0, 2)
