# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Cases of a long proof, some of which run with all tests and the others nightly."""

import pytest


def some_now(cases, now=1):
    """
    Return the cases of a parametrised test.

    :param now: how many of them, the first ones, run with all tests; the others run nightly.
    """
    rows = [case if isinstance(case, tuple) else (case,) for case in cases]
    marks = [[]] * min(now, len(rows)) + [pytest.mark.nightly] * (len(rows) - now)
    return [pytest.param(*row, marks=mark) for row, mark in zip(rows, marks, strict=True)]
