# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Through how many files of the core a twist, a closure and a flag pass."""

from pathlib import Path
import subprocess
import sys

import pytest

ROOT = Path(__file__).parents[2]
#: Largest numbers of files and of moves between them.
BOUNDS = {
    'twist to roller command': (17, 132),
    'tick of the node: twist': (37, 215),
    'closure by (10)': (26, 160),
    'flag of the node: held': (43, 608),
}


@pytest.fixture(scope='module')
def counted():
    """Return the counts of the benchmark call_path, without the caches of other tests."""
    told = subprocess.run(
        [sys.executable, '-m', 'studies.benchmarks', 'call_path'],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    rows = [[cell.strip() for cell in line.split('|')[1:]] for line in told.stdout.splitlines()]
    return {row[0]: (int(row[1]), int(row[2])) for row in rows if row and row[0] in BOUNDS}


@pytest.mark.parametrize('name', BOUNDS)
def test_no_more_files_and_moves_than_these(name, counted):
    files, moves = counted[name]
    most_files, most_moves = BOUNDS[name]
    assert files <= most_files
    assert moves <= most_moves
