# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers that callers hand over: taken as they are, or refused with what was given."""

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.numerics.arrays import finite_array
import numpy as np
import pytest


@pytest.mark.parametrize('values', [(1, 2.0), np.uint8([1, 2]), np.arange(1.0, 3.0)])
def test_real_numbers_become_a_new_array_of_floats(values):
    array = finite_array(values, 2, 'center', GraspError)
    assert array.dtype == np.float64
    assert array.tolist() == [1.0, 2.0]
    array[0] = 5.0
    assert values[0] == 1


NO_PAIRS = [[1.0], [[1.0, 2.0]], [1.0, np.inf], None, [1.0, 2j], ['1', '2'], [[1.0], [1.0, 2.0]]]


@pytest.mark.parametrize('values', NO_PAIRS)
def test_anything_else_is_refused(values):
    with pytest.raises(GraspError, match='must be 2 finite numbers'):
        finite_array(values, 2, 'center', GraspError)
