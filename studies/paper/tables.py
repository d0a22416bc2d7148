# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of the page: as Markdown, and as CSV."""

from __future__ import annotations

from collections.abc import Sequence
import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Table:
    """
    Table of texts.

    :ivar name: name of the table's file.
    :ivar caption: caption of the table.
    :ivar headings: headings of the columns, with units.
    :ivar rows: rows, with one cell for each heading.
    :ivar shown: whether the page shows the rows; the file has them in any case.
    """

    name: str
    caption: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    shown: bool = True


def number(value: float, digits: int = 3) -> str:
    """Return a number with a given number of significant digits, without an exponent."""
    if value == 0.0:
        return '0'
    return np.format_float_positional(
        value, precision=digits, unique=False, fractional=False, trim='-'
    )


def markdown(table: Table) -> str:
    """Return the table as Markdown, with numeric columns right-aligned."""
    columns = zip(*table.rows, strict=True)
    rule = ['---:' if all(map(_is_number, column)) else '---' for column in columns]
    lines = [table.headings, rule, *table.rows]
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)


def _is_number(cell: str) -> bool:
    """Return whether a cell is empty or begins with a number."""
    return cell.lstrip('-*')[:1].isdigit() or not cell


def write_csv(table: Table, folder: Path) -> None:
    """Write the table to a file named after it."""
    with (folder / f'{table.name}.csv').open('w', newline='', encoding='utf-8') as file:
        csv.writer(file, lineterminator='\n').writerows([table.headings, *table.rows])
