# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Printed report of the fits: unused rows, tables, and the block for the robot file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
import itertools

from isotruss_ros.calibration.analysis import Analysis
from isotruss_ros.calibration.beam_fit import FittedBeam
from isotruss_ros.calibration.local_fit import FittedLocalStiffness
import numpy as np
from rich.table import Table

#: Unit of the stiffness C p^a L^b by mode.
UNITS = {'axial': 'N/m', 'transverse': 'N/m', 'rotary': 'N m/rad'}
#: Symbol and unit of each constant of a beam, by its key in the robot file.
SYMBOLS = {
    'membrane_modulus': 'E t [N/m]',
    'membrane_shear_modulus': 'G t [N/m]',
    'end_softening': 'c',
}

#: Smallest misfit of the beam in a mode that the report mentions [-].
REPORTED_MISFIT = 0.05


def unused_rows(unused: Mapping[str, Sequence[int]], rows: int) -> Iterator[str]:
    """
    Yield a line of text for each reason why rows are unused, with the rows' line numbers.

    :param unused: line numbers in the file for each reason.
    :param rows: number of rows in the file.
    """
    if not unused:
        yield f'all {rows} rows used'
        return
    yield f'{sum(map(len, unused.values()))} of {rows} rows not used:'
    for reason, lines in unused.items():
        yield f'  {reason}: {len(lines)}, line {_stretches(sorted(lines))}'


def _stretches(lines: Sequence[int]) -> str:
    """Return a text with sorted line numbers as ranges, for example 3-7, 9, 12-14."""
    names = []
    for _, run in itertools.groupby(enumerate(lines), lambda pair: pair[1] - pair[0]):
        numbers = [line for _, line in run]
        names.append(str(numbers[0]) if len(numbers) == 1 else f'{numbers[0]}-{numbers[-1]}')
    return ', '.join(names)


def beam_table(fitted: FittedBeam) -> Table:
    """
    Return a table of the beam's constants with confidence intervals.

    :param fitted: fitted beam.
    """
    result = _table(f'Inflatable beam, {2.0 * fitted.radius:g} m in diameter, all modes')
    result.add_column('constant', no_wrap=True)
    for heading in ('value', '95 % interval'):
        result.add_column(heading, justify='right', no_wrap=True)
    for name, value, low, high in zip(
        SYMBOLS, fitted.constants, fitted.low, fitted.high, strict=True
    ):
        result.add_row(
            f'{name}, {SYMBOLS[name]}',
            f'{value:.4g}',
            f'{low:.4g} to {high:.4g}' if np.isfinite(high) else 'not bounded by these points',
        )
    return result


def local_line(analysis: Analysis) -> str:
    """
    Return a sentence with the local stiffness or the reason of its absence; empty if unmeasured.

    :param analysis: results of the fits.
    """
    local = analysis.local
    if local is None:
        reason = analysis.local_refusal
        return f'no local stiffness: {reason}' if reason else ''
    return (
        f'local_stiffness: {local.value:.4g} of the theory, {local.low:.4g} to {local.high:.4g} '
        f'(95 %), {local.count} points, deviation {100.0 * local.misfit:.1f} %'
    )


def law_table(analysis: Analysis) -> Table:
    """
    Return a table of the power laws, as in Table I, with the beam's misfit in each mode.

    :param analysis: results of the fits, with slopes in at least one mode.
    """
    result = _table(
        'k = C p^a L^b in SI units, each mode on its own; last, the deviation of the beam'
    )
    result.add_column('mode', no_wrap=True)
    for heading in ('C', 'a', 'b', 'R²', 'groups', 'points', 'beam'):
        result.add_column(heading, justify='right', no_wrap=True)
    for mode, slopes in analysis.slopes.items():
        if not slopes:
            continue
        misfit = '-'
        if analysis.fitted:
            misfit = f'{100.0 * analysis.fitted.misfits[mode]:.1f} %'
        constants = ['-'] * 4
        if mode in analysis.laws:
            fitted = analysis.laws[mode]
            law, low, high = fitted.law, fitted.low, fitted.high
            constants = [
                # The interval of C is asymmetric, because ln C is fitted.
                f'{law.C:.4g}\n{low.C:.4g} to {high.C:.4g}',
                f'{law.a:.4f}\n± {high.a - law.a:.2g}',
                f'{law.b:.4f}\n± {high.b - law.b:.2g}',
                '-' if np.isnan(fitted.r_squared) else f'{fitted.r_squared:.4f}',
            ]
        result.add_row(
            f'{mode}\n{UNITS[mode]}',
            *constants,
            str(len(slopes)),
            str(analysis.points(mode)),
            misfit,
        )
    return result


def missed_modes(analysis: Analysis) -> Iterator[str]:
    """
    Yield a line of text for each mode in which the fitted beam is inaccurate.

    A power law has three constants for one mode; the beam has three constants for all modes. If
    the power law is accurate and the beam is not, the cause is the theory of the beam and not
    scatter of the points.

    :param analysis: results of the fits.
    """
    beam = analysis.fitted.misfits if analysis.fitted else {}
    for mode, law in analysis.laws.items():
        if beam.get(mode, 0.0) > max(REPORTED_MISFIT, 2.0 * law.misfit):
            yield (
                f'the beam misses the points of mode {mode} by {100.0 * beam[mode]:.0f} %, their '
                f'own power law by {100.0 * law.misfit:.0f} %: check the units, the diameter and '
                'where the lengths end; if they are right, this tube is no inflatable beam'
            )


def _table(title: str) -> Table:
    return Table(title=title, title_justify='left', box=None, pad_edge=False)


def block(fitted: FittedBeam, local: FittedLocalStiffness | None = None) -> str:
    """
    Return the text of the block `stiffness` of a robot file, indented as below the key `tube`.

    :param fitted: fitted beam.
    :param local: fitted local stiffness; None: omitted.
    """
    lines = [f'  local_stiffness: {local.value:.8e}'] if local else []
    lines += [
        f'  stiffness:  # goes under the key tube; diameter {2.0 * fitted.radius:g} m',
        '    model: inflatable_beam',
    ]
    for name, value in zip(SYMBOLS, fitted.constants, strict=True):
        # YAML 1.1 and 1.2 both read this notation as a number.
        lines.append(f'    {name}: {value:.8e}')
    return '\n'.join(lines)
