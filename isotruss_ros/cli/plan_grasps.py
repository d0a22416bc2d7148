# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Executable `plan_grasps`, which searches for grasps of a free object and paths to the grasps."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
import contextlib
import json
from pathlib import Path
import signal
import sys
from types import FrameType
from typing import TYPE_CHECKING

from isotruss_ros import core
from isotruss_ros.cli.exit_codes import run_program
from isotruss_ros.cli.plan_options import add_requirements, add_search, duration, requirements
from isotruss_ros.workers import Stop, WorkerPool

if TYPE_CHECKING:
    from isotruss_ros.core.planning.grasp_plan import GraspPlan

#: Exit codes of a completed search.
FOUND, NONE_FOUND = 0, 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Search for grasps and print them; return the exit code."""
    options = _parser().parse_args(arguments)
    return run_program('plan_grasps', lambda: _run(options))


def _run(options: argparse.Namespace) -> int:
    from isotruss_ros.cli.plan_report import as_json

    robot = core.load_robot(options.robot)
    config = robot.home
    if options.rollers is not None:
        config = robot.configuration(options.rollers)
    body, needs = _read_object(options), requirements(options)
    if options.json is not None:
        options.json.touch()  # fail before the search rather than after it
    plan = _search(config, body, needs, options)
    _tell(plan, needs)
    if options.json is not None:
        text = json.dumps(as_json(plan, robot), indent=2, allow_nan=False)
        options.json.write_text(f'{text}\n', encoding='utf-8')
    return FOUND if plan.grasps else NONE_FOUND


def _read_object(options: argparse.Namespace) -> core.ConvexObject:
    """Return the object that the options describe, at its pose."""
    if options.object is None:
        return core.ConvexObject.disc(tuple(options.center), options.diameter)
    return core.read_object(options.object).placed_at((*options.center, options.angle))


def _search(
    config: core.Configuration,
    body: core.ConvexObject,
    needs: core.GraspRequirements,
    options: argparse.Namespace,
) -> GraspPlan:
    """Search in parallel processes until the search is finished, interrupted or timed out."""
    from isotruss_ros.cli.progress_bar import show_progress

    stop = Stop(options.time_limit)
    uncertainty = None
    if options.uncertainty is not None:
        uncertainty = core.Uncertainty.of(config.robot, body, options.uncertainty)
    # A single worker is also a separate process: the last digits depend on the BLAS threads.
    with WorkerPool(options.workers) as pool, show_progress() as show, _interruptible(stop):
        return core.plan_grasps(
            config,
            body,
            needs,
            options.seed,
            pool.executor,
            show,
            stop,
            uncertainty=uncertainty,
        )


@contextlib.contextmanager
def _interruptible(stop: Stop) -> Iterator[None]:
    """End the search at the first Ctrl-C, with the grasps so far; the process at the second."""

    def ask(_signal: int, _frame: FrameType | None) -> None:
        stop.requested = True
        signal.signal(signal.SIGINT, before)

    before = signal.signal(signal.SIGINT, ask)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _tell(plan: GraspPlan, needs: core.GraspRequirements) -> None:
    from isotruss_ros.cli.plan_report import table
    from isotruss_ros.core.planning.grasp_plan import plan_in_words
    from rich.console import Console

    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = max(console.width, 160)  # full width for files and pipes
    if plan.grasps:
        console.print(table(plan, needs))
    console.print(plan_in_words(plan), soft_wrap=True)
    ended = '' if plan.complete else '; stopped before its end'
    console.print(
        f'{plan.evaluations} evaluations, {plan.analyses} of them analyses, '
        f'in {plan.computing_time:.1f} s{ended}'
    )


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='isotruss plan_grasps',
        description='Search for grasps of a free object inside a loop of the robot.',
        epilog='exit codes: 0 found, 1 none found, 2 bad arguments, 3 the search failed',
    )
    parser.add_argument(
        '--robot',
        default='nine_member',
        help='name of a preset, or path of a robot file (default %(default)s)',
    )
    parser.add_argument(
        '--rollers',
        type=float,
        nargs='+',
        metavar='PHI',
        help='current travel of each roller since home [m]; default: home',
    )
    parser.add_argument(
        '--center',
        type=float,
        nargs=2,
        required=True,
        metavar=('X', 'Y'),
        help='centre of the object [m]',
    )
    shape = parser.add_mutually_exclusive_group(required=True)
    shape.add_argument('--diameter', type=float, help='diameter of a disc [m]')
    shape.add_argument(
        '--object', metavar='YAML', help='path of an object file, or YAML text in braces'
    )
    parser.add_argument(
        '--angle', type=float, default=0.0, help='angle of this object [rad] (default 0)'
    )
    add_requirements(parser)
    parser.add_argument(
        '--uncertainty',
        nargs='?',
        const='{}',
        metavar='YAML',
        help='rank by the chance that the object is held; standard deviations as YAML text in '
        'braces, which precede those of the object and the robot file',
    )
    group = add_search(parser)
    group.add_argument(
        '--time-limit',
        type=duration,
        default=0.0,
        metavar='S',
        help='time limit, at which the grasps found so far are printed [s]; 0 (default): none',
    )
    group.add_argument('--json', type=Path, metavar='FILE', help='file for all results')
    return parser


if __name__ == '__main__':
    sys.exit(main())
