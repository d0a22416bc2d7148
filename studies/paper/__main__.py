# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compute and draw every table and figure of the paper; write docs/paper.md and docs/paper/."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys
from typing import Any

from isotruss_ros.core import IsotrussError
from matplotlib import rc_context
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from studies.paper.item import Item, Report
from studies.paper.items import ITEMS
from studies.paper.page import FOLDER, page
from studies.paper.style import save, SETTINGS
from studies.paper.tables import write_csv


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute and draw all items, one after the other."""
    parser = argparse.ArgumentParser(prog='python -m studies.paper', description=__doc__)
    parser.add_argument(
        '--output', type=Path, default=Path('docs'), help='folder of the page (default: docs)'
    )
    options = parser.parse_args(arguments)
    folder = options.output / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    console = Console()
    columns = (TextColumn('{task.description:12}'), BarColumn(), TimeElapsedColumn())
    reports: list[tuple[Item, Report]] = []
    try:
        with Progress(*columns, console=console) as progress:
            tasks = [progress.add_task(item.name, start=False, total=1.0) for item in ITEMS]
            for item, task in zip(ITEMS, tasks, strict=True):
                progress.start_task(task)
                result = item.compute(
                    lambda done, task=task: progress.update(task, completed=0.95 * done)
                )
                reports.append((item, _write(item, result, folder)))
                progress.update(task, completed=1.0)
    except IsotrussError as error:
        console.print(f'{ITEMS[len(reports)].name}: {error}', style='red', markup=False)
        return 1
    path = options.output / 'paper.md'
    path.write_text(page(reports), encoding='utf-8')
    console.print(f'written: {path}, {folder}')
    return 0


def _write(item: Item, result: Any, folder: Path) -> Report:
    """Write figure and tables of an item."""
    if item.draw:
        with rc_context(SETTINGS):
            save(item.draw(result), folder / f'{item.name}.png')
    report = item.report(result)
    for table in report.tables:
        write_csv(table, folder)
    return report


if __name__ == '__main__':
    sys.exit(main())
