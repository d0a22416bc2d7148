# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Executable `grasp_dataset`, which writes a data set of random grasps for learning."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from concurrent.futures import Executor
import contextlib
from pathlib import Path
import sys
import time

from isotruss_ros import core
from isotruss_ros.cli.exit_codes import run_program
from isotruss_ros.cli.plan_options import add_cluster, add_search
from isotruss_ros.core.errors import quote, suggest
from isotruss_ros.dataset.columns import COLUMNS
from isotruss_ros.dataset.random_grasps import DatasetError, GraspDistribution, KINDS
from isotruss_ros.workers import dask_client, WorkerPool

#: Exit code of a complete data set.
WRITTEN = 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Write a data set, and return the exit code."""
    options = _parser().parse_args(arguments)
    resumes = f'stopped; the same command resumes {options.out}'
    return run_program('grasp_dataset', lambda: _run(options), resumes)


def _run(options: argparse.Namespace) -> int:
    from isotruss_ros.dataset.grasp_dataset import DatasetRun, write_dataset
    from rich.console import Console
    from rich.progress import Progress

    items = [_read_item(name) for name in options.objects]
    distribution = GraspDistribution(
        tuple(items),
        tuple(options.sizes),
        tuple(options.friction),
        tuple(options.depth),
        options.travel,
        options.force,
        options.moment,
    )
    run = DatasetRun(
        core.load_robot(options.robot), options.count, distribution, options.seed, options.columns
    )
    console = Console(stderr=True)
    bar = Progress(console=console, transient=True, disable=not console.is_terminal)
    with contextlib.ExitStack() as stack:
        if options.scheduler is None:
            executor: Executor = stack.enter_context(WorkerPool(options.workers)).executor
        else:
            executor = stack.enter_context(dask_client(options.scheduler)).get_executor(pure=False)
        stack.enter_context(bar)
        task, begin, begun = bar.add_task('', total=options.count), time.monotonic(), list[int]()

        def report(stored: int) -> None:
            """Draw the progress; the time left follows from the rows of this run alone."""
            begun.append(stored)
            rate = (stored - begun[0]) / max(time.monotonic() - begin, 1e-3)
            bar.update(task, completed=stored, description=f'{rate:.1f} rows/s')

        is_new = write_dataset(run, options.out, executor, report)
    words = 'written' if is_new else 'complete already'
    print(f'{options.out}: {options.count} grasps, {len(run.columns)} columns: {words}')
    return WRITTEN


def _read_item(name: str) -> str | core.ConvexObject:
    """Return a kind of random shapes, or the object of an object file."""
    if name in KINDS:
        return name
    if not name.lstrip().startswith('{') and not Path(name).exists():
        hint = suggest(name, KINDS)
        raise DatasetError(
            f'objects: {quote(name)}: {hint}must be one of {", ".join(KINDS)}, or an object file'
        )
    return core.read_object(name)


def _parser() -> argparse.ArgumentParser:
    defaults = GraspDistribution()
    parser = argparse.ArgumentParser(
        prog='isotruss grasp_dataset',
        description='Settle random grasps and write a table. The row of a grasp depends only on '
        'its number and the options. If the command is interrupted, the same command resumes.',
        epilog=_describe_columns(),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('robot', help='name of a preset, or path of a robot file')
    parser.add_argument(
        '--objects',
        nargs='+',
        default=KINDS,
        metavar='KIND',
        help=f'kinds of random shapes ({", ".join(KINDS)}), and paths of object files, whose '
        'shape and friction are used (default: all kinds)',
    )
    parser.add_argument('--count', type=int, required=True, metavar='N', help='number of grasps')
    parser.add_argument(
        '--out', type=Path, required=True, metavar='FILE', help='.npz or .parquet file to write'
    )
    parser.add_argument(
        '--columns', nargs='+', default=(), metavar='NAME', help='columns (default: all)'
    )
    group = parser.add_argument_group('ranges of random quantities, which are uniform')
    for name, words in {
        'sizes': 'diameters or long axes of random shapes [m]',
        'friction': 'coefficients of friction, of objects without their own',
        'depth': 'penetrations of the straight members into the object [m]',
    }.items():
        group.add_argument(
            f'--{name}',
            type=float,
            nargs=2,
            default=getattr(defaults, name),
            metavar=('MIN', 'MAX'),
            help=f'{words} (default %(default)s)',
        )
    for name, words in {
        'travel': 'largest travel of a roller since home [m]',
        'force': 'largest external force along x and along y [N]',
        'moment': 'largest external moment [N m]',
    }.items():
        group.add_argument(
            f'--{name}',
            type=float,
            default=getattr(defaults, name),
            metavar='MAX',
            help=f'{words} (default %(default)s)',
        )
    add_cluster(add_search(parser))
    return parser


def _describe_columns() -> str:
    """Return a list of the columns with their units."""
    lines = ['columns, with the number of values for each grasp:']
    for name, column in COLUMNS.items():
        axis = f' ({column.axis})' if column.axis else ''
        unit = '' if column.unit == '-' else f' [{column.unit}]'
        lines.append(f'  {name}{axis}: {column.words}{unit}')
    lines.append('exit codes: 0 written, 2 bad arguments, 3 a process died, 130 interrupted')
    return '\n'.join(lines)


if __name__ == '__main__':
    sys.exit(main())
