# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Run the benchmarks one after the other, and print one page.

    python -m benchmarks [NAME ...]

A name is that of a file beside this one. `BENCHMARK_SHARE=0.1` takes a tenth of the work.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import subprocess
import sys

HERE = Path(__file__).parent
HELPERS = {'__main__', 'measuring', 'large_robots'}
NAMES = sorted({path.stem for path in HERE.glob('*.py')} - HELPERS)


def main() -> int:
    """Run what is asked for; return 1 where a benchmark fails."""
    parser = argparse.ArgumentParser(prog='python -m benchmarks', description=__doc__)
    parser.add_argument('names', nargs='*', metavar='NAME', help=', '.join(NAMES))
    names = parser.parse_args().names or NAMES
    failed = []
    for name in names:
        print(f'\n## {name}\n', flush=True)
        if subprocess.run([sys.executable, HERE / f'{name}.py']).returncode:
            failed.append(name)
    if failed:
        print(f'failed: {", ".join(failed)}', file=sys.stderr)
    return int(bool(failed))


if __name__ == '__main__':
    sys.exit(main())
