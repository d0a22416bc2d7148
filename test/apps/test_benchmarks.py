# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every benchmark runs, in its shortest form."""

import os
from pathlib import Path
import subprocess
import sys

from nightly import some_now
import pytest

ROOT = Path(__file__).parents[2]
HELPERS = {'__main__', 'measuring', 'large_robots'}
NAMES = sorted({path.stem for path in (ROOT / 'benchmarks').glob('*.py')} - HELPERS)
#: What needs a browser, or packages that are not in requirements-extra.txt.
ENDLESS = {'viewer_load'}


@pytest.mark.timeout(600)
@pytest.mark.parametrize('name', some_now([name for name in NAMES if name not in ENDLESS], 2))
def test_benchmark_runs_in_its_shortest_form(name):
    ran = subprocess.run(
        [sys.executable, '-m', 'benchmarks', name],
        cwd=ROOT,
        env=os.environ | {'BENCHMARK_SHARE': '0.001'},
        capture_output=True,
        text=True,
    )
    assert ran.returncode == 0, ran.stderr
    assert f'## {name}' in ran.stdout
