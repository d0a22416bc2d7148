# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Run the benchmarks, each in a process of its own, and print one page.

    python -m studies.benchmarks [NAME ...]

A case is a file of this folder with a function `tables`, which yields its tables.
`BENCHMARK_SHARE=0.1` does a tenth of the work.
"""

from __future__ import annotations

import argparse
import importlib
import os
from pathlib import Path
import subprocess
import sys

HELPERS = {'__main__', 'measuring', 'large_robots', 'peer'}
NAMES = sorted({path.stem for path in Path(__file__).parent.glob('*.py')} - HELPERS)
#: Environment for one BLAS thread, set before NumPy is loaded.
ONE_THREAD = {'OPENBLAS_NUM_THREADS': '1', 'OMP_NUM_THREADS': '1'}


def run(name: str) -> None:
    """Run a case in this process and print its part of the page."""
    from studies.benchmarks.measuring import machine

    case = importlib.import_module(f'studies.benchmarks.{name}')
    print(f'\n## {name}\n\n{case.__doc__.strip()}\n\n{machine()}', flush=True)
    for table in case.tables():
        print(f'\n{table}', flush=True)


def main() -> int:
    """Run the named cases, or all; return 1 if a case fails."""
    parser = argparse.ArgumentParser(prog='python -m studies.benchmarks', description=__doc__)
    parser.add_argument(
        'names', nargs='*', metavar='NAME', choices=[*NAMES, []], help=', '.join(NAMES)
    )
    names = parser.parse_args().names or NAMES
    if len(names) == 1 and ONE_THREAD.items() <= os.environ.items():
        run(names[0])
        return 0
    environment, failed = os.environ | ONE_THREAD, []
    for name in names:
        command = [sys.executable, '-m', 'studies.benchmarks', name]
        if subprocess.run(command, env=environment, cwd=Path(__file__).parents[2]).returncode:
            failed.append(name)
    if failed:
        print(f'failed: {", ".join(failed)}', file=sys.stderr)
    return int(bool(failed))


if __name__ == '__main__':
    sys.exit(main())
