# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cases of a long proof, some of which run with all tests and the others nightly."""

import pytest


def some_now(cases, now=1):
    """Return cases of a parametrised test; only the first `now` run with all tests."""
    rows = [case if isinstance(case, tuple) else (case,) for case in cases]
    marks = [[]] * min(now, len(rows)) + [pytest.mark.nightly] * (len(rows) - now)
    return [pytest.param(*row, marks=mark) for row, mark in zip(rows, marks, strict=True)]
