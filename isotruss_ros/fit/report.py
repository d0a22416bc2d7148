"""What is printed: the rows that were not used, the table, the block for the robot file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import itertools

from isotruss_ros.core.power_law import PowerLaw
from isotruss_ros.fit.analysis import Analysis
from isotruss_ros.fit.measurements import MODES, Unused
import numpy as np
from rich.table import Table

#: Units of C p^a L^b by mode.
UNITS = {'axial': 'N/m', 'transverse': 'N/m', 'rotary': 'N m/rad'}


def unused_rows(unused: Unused, rows: int) -> Iterator[str]:
    """Yield lines that name and count the rows that were not used."""
    if not unused.count:
        yield f'all {rows} rows used'
        return
    yield f'{unused.count} of {rows} rows not used:'
    for reason, lines in unused.lines.items():
        yield f'  {reason}: {len(lines)}, line {stretches(sorted(lines))}'


def stretches(lines: Sequence[int]) -> str:
    """Return sorted line numbers as 3-7, 9, 12-14."""
    names = []
    for _, run in itertools.groupby(enumerate(lines), lambda pair: pair[1] - pair[0]):
        numbers = [line for _, line in run]
        names.append(str(numbers[0]) if len(numbers) == 1 else f'{numbers[0]}-{numbers[-1]}')
    return ', '.join(names)


def table(analysis: Analysis) -> Table:
    """Return the laws in the manner of Table I, the confidence intervals below the constants."""
    result = Table(
        title='k = C p^a L^b in SI units, with 95 % confidence intervals',
        title_justify='left',
        box=None,
        pad_edge=False,
    )
    result.add_column('mode', no_wrap=True)
    for heading in ('C', 'a', 'b', 'R²', 'groups', 'points'):
        result.add_column(heading, justify='right', no_wrap=True)
    for mode, fitted in analysis.laws.items():
        law, low, high = fitted.law, fitted.low, fitted.high
        result.add_row(
            f'{mode}\n{UNITS[mode]}',
            # The interval of C is not symmetric: it is that of ln C.
            f'{law.C:.4g}\n{low.C:.4g} to {high.C:.4g}',
            f'{law.a:.4f}\n± {high.a - law.a:.2g}',
            f'{law.b:.4f}\n± {high.b - law.b:.2g}',
            '-' if np.isnan(fitted.r_squared) else f'{fitted.r_squared:.4f}',
            str(fitted.count),
            str(analysis.points(mode)),
        )
    return result


def block(model: PowerLaw) -> str:
    """Return the block `stiffness` of a robot file, indented to go under the key `tube`."""
    lines = ['  stiffness:  # goes under the key tube', '    model: power_law']
    for mode in MODES:
        law = getattr(model, mode)
        # In this notation both YAML 1.1 and 1.2 read a number.
        lines.append(f'    {mode}: {{C: {law.C:.8e}, a: {law.a:.8f}, b: {law.b:.8f}}}')
    return '\n'.join(lines)
