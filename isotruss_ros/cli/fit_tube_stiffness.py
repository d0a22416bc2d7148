# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Executable `fit_tube_stiffness`, which fits models of a tube to measured points."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import math
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from isotruss_ros.calibration.linear_range import TOLERANCE
from isotruss_ros.calibration.measurements import (
    COLUMNS,
    DEFAULT_DIAMETER,
    MeasurementError,
    MODES,
    read_measurements,
)
from isotruss_ros.core.errors import IsotrussError

if TYPE_CHECKING:
    from isotruss_ros.calibration.analysis import Analysis


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Fit a tube's stiffness to measured points; print tables and a block for the robot file.

    :return: exit code, 1 if no block for the robot file could be computed.
    """
    options = _parser().parse_args(arguments)
    try:
        return _run(options)
    except IsotrussError as error:
        print(f'fit_tube_stiffness: {error}', file=sys.stderr)
        return 1


def _run(options: argparse.Namespace) -> int:
    from isotruss_ros.calibration import report
    from isotruss_ros.calibration.analysis import analyse
    from rich.console import Console

    measurements = read_measurements(options.points)
    if not measurements.rows:
        raise MeasurementError(
            f'{options.points}: no points below the header; must have four groups or more'
        )
    ranges = dict(options.max_displacement)
    analysis = analyse(measurements, options.diameter, options.tolerance, ranges)
    if measurements.ignored_columns:
        print(f'columns not used: {", ".join(measurements.ignored_columns)}')
    for line in report.unused_rows(analysis.unused, measurements.rows):
        print(line)
    print()
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = max(console.width, 100)  # full width for files and pipes
    if analysis.fitted:
        console.print(report.beam_table(analysis.fitted), '')
    if local := report.local_line(analysis):
        print(local, end='\n\n')
    if any(analysis.slopes.values()):
        console.print(report.law_table(analysis), '')
    for line in report.missed_modes(analysis):
        print(line)
    for mode, reason in analysis.missing.items():
        print(f'no power law for mode {mode}: {reason}')
    if options.figure:
        from isotruss_ros.plotting.fit_figure import draw

        draw(analysis, options.figure)
    return _finish(analysis, options.block)


def _finish(analysis: Analysis, path: Path | None) -> int:
    """Print the block for the robot file, or the reason why it could not be computed."""
    if analysis.fitted is None or analysis.refusal:
        print(
            f'fit_tube_stiffness: no block for the robot file: {analysis.refusal}', file=sys.stderr
        )
        return 1
    from isotruss_ros.calibration.report import block

    text = block(analysis.fitted, analysis.local)
    print(text)
    if path:
        try:
            path.write_text(f'{text}\n', encoding='utf-8')
        except OSError as error:
            raise MeasurementError(f'{path}: cannot be written: {error.strerror}') from error
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='isotruss fit_tube_stiffness', description=__doc__)
    parser.add_argument(
        'points',
        type=Path,
        help=f'CSV file with the columns {",".join(COLUMNS)}; optional: trial, and the diameter '
        'of the cylinder for the mode interference',
    )
    parser.add_argument(
        '--diameter',
        type=_positive,
        default=DEFAULT_DIAMETER,
        help='diameter of the tube [m] (default %(default)s)',
    )
    parser.add_argument('--figure', type=Path, help='file for a figure of points and fits')
    parser.add_argument('--block', type=Path, help='file for the block of the robot file')
    parser.add_argument(
        '--tolerance',
        type=_positive,
        default=TOLERANCE,
        help='largest deviation of a cubic from a line in the linear range, relative to the rise '
        'of the line (default %(default)s)',
    )
    parser.add_argument(
        '--max-displacement',
        type=_range,
        action='append',
        default=[],
        metavar='MODE=VALUE',
        help='end of the linear range of a mode [m or rad]; may be repeated',
    )
    return parser


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f'{text!r}: must be a positive number')
    return value


def _range(text: str) -> tuple[str, float]:
    mode, _, value = text.partition('=')
    if mode not in MODES:
        raise argparse.ArgumentTypeError(
            f'{text!r}: must be MODE=VALUE, MODE one of {", ".join(MODES)}'
        )
    return mode, _positive(value)


if __name__ == '__main__':
    sys.exit(main())
