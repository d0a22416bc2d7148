# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every benchmark runs, in its shortest form."""

import os
from pathlib import Path
import subprocess
import sys

import pytest
from studies.benchmarks.__main__ import NAMES

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
