# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Benchmarks in their shortest form, a part of the comparison with MuJoCo, and its page."""

import os
from pathlib import Path
import subprocess
import sys

from mujoco_worlds import needs_mujoco
import pytest
from studies.benchmarks.__main__ import NAMES
from studies.comparison.friction import lose
from studies.comparison.friction_cases import CASES
from studies.comparison.page import FOLDER
from studies.comparison.sections import SECTIONS

DOCS = Path(__file__).resolve().parents[2] / 'docs'


@needs_mujoco
def test_a_box_on_a_face_uses_more_friction_than_that_at_which_it_slides():
    loss = lose(CASES[13])
    assert loss.used > 1.3 * loss.ours.necessary
    assert loss.outside < 0.03


def test_all_values_of_the_committed_page_are_within_bounds():
    text = (DOCS / 'plant.md').read_text(encoding='utf-8')
    bounds = text.split('## Bounds')[1].split('\n## ')[0]
    assert '**' not in bounds
    assert text.count('\n## ') == 1 + len(SECTIONS)
    tables = {path.stem for path in (DOCS / FOLDER).glob('*.csv')}
    assert tables == {name for name in tables if f'({FOLDER}/{name}.csv)' in text}


ROOT = Path(__file__).parents[2]


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
