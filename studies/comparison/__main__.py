# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Comparison of our model with MuJoCo's; writes docs/plant.md and docs/plant/."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from concurrent.futures import as_completed
from pathlib import Path
import sys
import time

from isotruss_ros.core import IsotrussError
from isotruss_ros.workers import WorkerPool
from rich.console import Console
from studies.comparison.page import FOLDER, page
from studies.comparison.section import Section
from studies.comparison.sections import make, SECTIONS
from studies.paper.style import save
from studies.paper.tables import write_csv


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Compute all comparisons in parallel on all cores, and write the page of all cases.

    :param arguments: arguments of the command line; None: those of the process.
    :return: 0 if all differences are within their bounds, else 1.
    """
    parser = argparse.ArgumentParser(prog='python -m studies.comparison', description=__doc__)
    parser.add_argument(
        '--output', type=Path, default=Path('docs'), help='folder of the page (default: docs)'
    )
    parser.add_argument(
        '--some', action='store_true', help='check some cases of each comparison; write nothing'
    )
    options = parser.parse_args(arguments)
    console = Console()
    found: dict[str, Section] = {}
    begin = time.monotonic()
    try:
        with WorkerPool() as pool, console.status('comparing') as status:
            # The last ones take longest.
            tasks = {
                pool.executor.submit(make, name, options.some): name for name in reversed(SECTIONS)
            }
            for task in as_completed(tasks):
                found[tasks[task]] = task.result()
                left = ', '.join(name for name in SECTIONS if name not in found)
                status.update(f'comparing {left}')
                console.print(f'{tasks[task]}: {time.monotonic() - begin:.0f} s')
    except IsotrussError as error:
        console.print(f'comparison failed: {error}', style='red', markup=False)
        return 1
    sections = [found[name] for name in SECTIONS]
    if not options.some:
        write(sections, options.output)
        console.print(f'written: {options.output / "plant.md"}, {options.output / FOLDER}')
    broken = [check for section in sections for check in section.checks if not check.kept]
    for check in broken:
        console.print(': '.join(check.row()), style='red', markup=False)
    return 1 if broken else 0


def write(sections: Sequence[Section], output: Path) -> None:
    """
    Write the page, its figures and its tables.

    :param sections: sections in order.
    :param output: folder of the page.
    """
    folder = output / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    for section in sections:
        if section.figure is not None:
            save(section.figure, folder / f'{section.tables[0].name}.png')
        for table in section.tables:
            write_csv(table, folder)
    (output / 'plant.md').write_text(page(sections), encoding='utf-8')


if __name__ == '__main__':
    sys.exit(main())
