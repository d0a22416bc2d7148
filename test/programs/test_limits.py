# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page "Limits of validity" states what `studies.limits` measures."""

from pathlib import Path

import pytest
from studies import limits

PAGE = Path(__file__).parents[2] / 'docs' / 'limits.md'
#: Statement of the page about each change; the number is that of the grasps it loses.
STATEMENTS = {
    'friction 0.7': '0.7 instead of 0.8 loses {} of 12',
    'friction 0.6': '0.6 loses {} ',
    'stiffness -20 %': '20 % less loses {} of 12 |',
    'object turned by 2 degrees': '2° loses {} |',
    'object 2 mm aside': '2 mm aside loses {} of 12',
    'a roller 5 mm off': '5 mm at one roller loses {} of 12',
    'a roller 10 mm off': '10 mm loses {} |',
    'pressure -10 %': '10 % less loses {} of 12;',
    'air 10 K colder': '10 K are 13 % of the gauge pressure, and lose {} |',
}


def test_ten_kelvin_change_the_gauge_pressure_by_13_percent():
    assert limits.heated_pressure(10.0) / limits.PRESSURE == pytest.approx(1.13, abs=0.005)


@pytest.mark.nightly
def test_page_states_the_measured_losses(capsys):
    limits.main()
    printed, page = capsys.readouterr().out, PAGE.read_text(encoding='utf-8')
    for name, statement in STATEMENTS.items():
        lost = next(line.split('|')[2].strip() for line in printed.splitlines() if name in line)
        assert statement.format(lost) in page
    assert 'flattening lowers the forces by 10 to 45 %' in printed
    assert 'flattening lowers forces by 10 to 45 %' in page
