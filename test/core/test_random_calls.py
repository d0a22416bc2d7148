# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random calls of the public API; `make calls` makes more."""

import os

from nightly import some_now
import pytest
import random_calls

CHUNK = 200
FIRST, CALLS = int(os.environ.get('FIRST_CALL', '0')), int(os.environ.get('CALLS', '2000'))


@pytest.mark.parametrize('first', some_now(range(FIRST, FIRST + CALLS, CHUNK), 2))
def test_random_calls_give_numbers_or_an_error_of_this_package(first, capfd):
    for seed in range(first, first + CHUNK):
        random_calls.call(seed)
    assert capfd.readouterr() == ('', '')
