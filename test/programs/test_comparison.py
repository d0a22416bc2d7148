# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Studies in their shortest form, and pages that state what they measure."""

import os
from pathlib import Path
import subprocess
import sys

from mujoco_worlds import needs_mujoco
import pytest
from studies import limits, measured_runs
from studies.benchmarks.__main__ import NAMES
from studies.comparison.friction import lose
from studies.comparison.friction_cases import CASES
from studies.comparison.page import FOLDER
from studies.comparison.sections import SECTIONS
from studies.membrane import Membrane
from studies.paper.membrane import STIFFNESS
from studies.paper.parameters import CYLINDERS, PRESSURES

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / 'docs'


@needs_mujoco
@pytest.mark.nightly
@pytest.mark.parametrize('wrong', measured_runs.TRUTHS)
def test_page_states_the_named_deviation_of_a_run_in_mujoco(wrong):
    named = measured_runs.compare(wrong, measured_runs.SEEDS[0]).named
    assert f'| {wrong} | {named} |' in (DOCS / 'afternoon.md').read_text(encoding='utf-8')


@needs_mujoco
@pytest.mark.nightly
def test_a_box_on_a_face_uses_more_friction_than_that_at_which_it_slides():
    loss = lose(CASES[13])
    assert loss.used > 1.3 * loss.ours.necessary
    assert loss.outside(loss.slowly) < 0.03


def test_all_values_of_the_committed_page_are_within_bounds():
    text = (DOCS / 'plant.md').read_text(encoding='utf-8')
    bounds = text.split('## Bounds')[1].split('\n## ')[0]
    assert '**' not in bounds
    assert text.count('\n## ') == 1 + len(SECTIONS)
    tables = {path.stem for path in (DOCS / FOLDER).glob('*.csv')}
    assert tables == {name for name in tables if f'({FOLDER}/{name}.csv)' in text}


@pytest.mark.nightly
@pytest.mark.timeout(600)
@pytest.mark.parametrize('name', NAMES)
def test_benchmark_runs_in_its_shortest_form(name):
    ran = subprocess.run(
        [sys.executable, '-m', 'studies.benchmarks', name],
        cwd=ROOT,
        env=os.environ | {'BENCHMARK_SHARE': '0.001'},
        capture_output=True,
        text=True,
    )
    assert ran.returncode == 0, ran.stderr
    assert f'## {name}' in ran.stdout


#: Statement of limits.md about each change; the number is that of the grasps it loses.
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
    printed, page = capsys.readouterr().out, (DOCS / 'limits.md').read_text('utf-8')
    for name, statement in STATEMENTS.items():
        lost = next(line.split('|')[2].strip() for line in printed.splitlines() if name in line)
        assert statement.format(lost) in page
    assert 'flattening lowers the forces by 10 to 45 %' in printed
    assert 'flattening lowers forces by 10 to 45 %' in page


@pytest.mark.nightly
@pytest.mark.parametrize(('pressure', 'cylinder'), [(0, 1), (1, 0), (1, 2), (2, 1)])
def test_stiffness_is_that_of_the_page(pressure, cylinder):
    response = Membrane(PRESSURES[pressure]).press(CYLINDERS[cylinder])
    assert response.stiffness == pytest.approx(STIFFNESS[pressure, cylinder], rel=0.01)
