# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page "An afternoon of measurements" states what `studies.measured_runs` finds."""

from pathlib import Path

import pytest

pytest.importorskip('mujoco')
from studies.measured_runs import compare, SEEDS, TRUTHS  # noqa: E402,I100

PAGE = Path(__file__).parents[2] / 'docs' / 'afternoon.md'


@pytest.mark.nightly
@pytest.mark.parametrize('wrong', TRUTHS)
def test_page_states_the_named_deviation_of_a_run_in_mujoco(wrong):
    named = compare(wrong, SEEDS[0]).named
    assert f'| {wrong} | {named} |' in PAGE.read_text(encoding='utf-8')
