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
    'twist to roller command': (19, 132),
    'closure by (10)': (22, 122),
    'flag of the node: held': (38, 250),
}


@pytest.fixture(scope='module')
def counted():
    """Return what benchmarks/call_path.py counts, in a process without other tests' caches."""
    told = subprocess.run(
        [sys.executable, ROOT / 'benchmarks' / 'call_path.py'],
        capture_output=True,
        text=True,
        check=True,
    )
    rows = [line.rsplit(maxsplit=2) for line in told.stdout.splitlines() if line.strip()]
    return {
        name: (int(row[1]), int(row[2]))
        for name in BOUNDS
        for row in rows
        if len(row) == 3 and row[0].startswith(name) and row[1].isdigit()
    }


@pytest.mark.parametrize('name', BOUNDS)
def test_no_more_files_and_moves_than_these(name, counted):
    files, moves = counted[name]
    most_files, most_moves = BOUNDS[name]
    assert files <= most_files
    assert moves <= most_moves
