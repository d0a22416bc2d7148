# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Executable `compare`, which compares a recorded run with the model and names what deviates."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from isotruss_ros.core import IsotrussError
from isotruss_ros.extras import MissingPackageError
from isotruss_ros.identification.gauge import COLUMNS, read_gauge

if TYPE_CHECKING:
    from isotruss_ros.core.recording.recorded_cycle import RecordedCycle


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Compare a recorded run with the model; print tables, and a block to paste.

    :return: exit code, 1 if the run cannot be compared.
    """
    options = _parser().parse_args(arguments)
    try:
        _compare(options)
    except ModuleNotFoundError as error:
        print(f'compare: {MissingPackageError(error)}', file=sys.stderr)
        return 1
    except (IsotrussError, OSError) as error:
        print(f'compare: {error}', file=sys.stderr)
        return 1
    return 0


def _compare(options: argparse.Namespace) -> None:
    from isotruss_ros.core import load_robot
    from isotruss_ros.identification.hypotheses import compare_run
    from isotruss_ros.identification.read_run import read_run
    from isotruss_ros.identification.report import block, describe
    from isotruss_ros.viewer.recorded_cycles import find_cycles, read_told_squeeze

    gauge = None if options.forces is None else read_gauge(options.forces, options.gauge_zero)
    robot = load_robot(options.robot)
    cycles = find_cycles(options.file, robot, options.diameter)
    run = read_run(_until_damage(cycles), robot, gauge)
    compared = compare_run(run)
    for line in describe(compared, read_told_squeeze(options.file)):
        print(line)
    print(f'\n{block(compared)}')
    if options.picture is not None:
        from isotruss_ros.plotting.run_figure import draw_run

        draw_run(compared, options.picture)


def _until_damage(cycles: Iterator[RecordedCycle]) -> Iterator[RecordedCycle]:
    """Yield the cycles of a recording up to a damage, which is printed."""
    from isotruss_ros.viewer.recording import BrokenRecordingError

    try:
        yield from cycles
    except BrokenRecordingError as error:
        print(f'compare: {error}', file=sys.stderr)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='isotruss compare', description=__doc__)
    parser.add_argument('file', type=Path, help='MCAP file of the node record')
    parser.add_argument(
        '--forces',
        type=Path,
        metavar='CSV',
        help=f'readings of gauges: a file with the columns {COLUMNS}',
    )
    parser.add_argument(
        '--gauge-zero',
        type=float,
        default=0.0,
        metavar='TIME',
        help='time on the clock of the run at which time_s of the gauge is 0 [s] (default 0)',
    )
    parser.add_argument('--picture', type=Path, metavar='FILE', help='file for a picture')
    parser.add_argument(
        '--robot',
        default='nine_member',
        help='name of a preset, or path of a robot file, for recordings without one',
    )
    parser.add_argument(
        '--diameter',
        type=float,
        default=0.3,
        help='diameter of the object in recordings without settings [m] (default 0.3)',
    )
    return parser


if __name__ == '__main__':
    sys.exit(main())
