# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""`python -m isotruss_ros.cli.sweep`: search for grasps over many robots and objects, as CSV."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Sequence
import contextlib
import csv
from pathlib import Path
import sys

from distributed import Client, LocalCluster
from isotruss_ros.cli.plan_options import add_requirements, add_search, requirements
from isotruss_ros.cli.sweep.evaluation import SweepResult
from isotruss_ros.cli.sweep.sweeping import sweep
from isotruss_ros.cli.sweep.table import COLUMNS, read_objects, row
from isotruss_ros.core import IsotrussError
from isotruss_ros.core.model.robot_file import read_robot_file
from isotruss_ros.core.planning.workers import core_count
from rich.console import Console
from rich.progress import Progress

#: Exit codes.
DONE, BAD_ARGUMENTS, INTERRUPTED = 0, 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Sweep, write a row for each pair as it comes, and return the exit code.

    :param arguments: of the command line; those of the process if None.
    """
    options = _parser().parse_args(arguments)
    try:
        _run(options)
    except (IsotrussError, OSError) as error:
        print(f'sweep: {error}', file=sys.stderr)
        return BAD_ARGUMENTS
    except KeyboardInterrupt:
        return INTERRUPTED
    return DONE


def _run(options: argparse.Namespace) -> None:
    robots = [read_robot_file(name) for name in options.robots]
    objects = read_objects(options.objects)
    needs = requirements(options)
    with contextlib.ExitStack() as stack:
        file = stack.enter_context(options.output.open('w', encoding='utf-8', newline=''))
        client = stack.enter_context(_client(options.scheduler, options.workers))
        results = stack.enter_context(
            contextlib.closing(
                sweep(client, robots, objects, needs, options.seed)  # type: ignore[type-var]
            )
        )
        table = csv.writer(file)
        table.writerow(COLUMNS)
        found = failed = 0
        for result in _watched(results, len(robots) * len(objects)):
            table.writerow(row(result))
            file.flush()  # what is there when it ends early is whole
            found += result.found > 0
            failed += bool(result.error)
    print(f'{len(robots) * len(objects)} pairs: {found} grasped, {failed} could not be computed')


@contextlib.contextmanager
def _client(address: str | None, workers: int) -> Iterator[Client]:
    """Return a client of the scheduler at an address, or of a cluster on this machine."""
    if address is not None:
        with Client(address) as client:
            yield client
        return
    with (
        LocalCluster(
            n_workers=workers or core_count(),
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client


def _watched(results: Iterable[SweepResult], total: int) -> Iterator[SweepResult]:
    """Give the results as they come, with a progress bar where a terminal shows it."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield from results
        return
    with Progress(console=console, transient=True) as progress:
        yield from progress.track(results, total=total, description='sweeping')


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='python -m isotruss_ros.cli.sweep', description=__doc__)
    parser.add_argument('robots', nargs='+', help='presets or robot files')
    parser.add_argument(
        '--objects',
        type=Path,
        required=True,
        help='CSV file with the columns x, y, diameter [m], a disc in each row',
    )
    parser.add_argument('--output', type=Path, required=True, help='CSV file to write')
    add_requirements(parser)
    add_search(parser).add_argument(
        '--scheduler', metavar='ADDRESS', help='of a Dask cluster; one on this machine if left out'
    )
    return parser


if __name__ == '__main__':
    sys.exit(main())
