# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page "An afternoon of measurements" states what `studies.measured_runs` finds."""

from pathlib import Path

import pytest

pytest.importorskip('mujoco')
from studies import measured_runs  # noqa: E402,I100

PAGE = Path(__file__).parents[2] / 'docs' / 'afternoon.md'


@pytest.mark.nightly
def test_page_states_the_named_deviations_of_runs_in_mujoco(capsys):
    measured_runs.main()
    page = PAGE.read_text(encoding='utf-8')
    _, _, *rows, last = capsys.readouterr().out.strip().splitlines()
    assert last in page
    for row in rows:
        wrong, named = row.split('|')[1:3]
        assert f'|{wrong}|{named}|' in page
