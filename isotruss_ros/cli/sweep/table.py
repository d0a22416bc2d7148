# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Objects from CSV, results to CSV."""

from __future__ import annotations

import csv
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any

from isotruss_ros.cli.sweep.evaluation import SweepResult
from isotruss_ros.core import ConvexObject, IsotrussError

COLUMNS = tuple(field.name for field in fields(SweepResult))
OBJECT_COLUMNS = ('x', 'y', 'diameter')


class TableError(IsotrussError, ValueError):
    """A table of objects cannot be read; says where and what would be right."""


def read_objects(path: Path) -> list[ConvexObject]:
    """
    Read discs, one a row, from a CSV file with the columns x, y and diameter [m].

    :param path: path of the CSV file.
    :raises TableError: names the file, the row and what would be right.
    """
    try:
        with path.open(encoding='utf-8', newline='') as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise TableError(f'{path}: cannot be read: {error}') from error
    found = []
    for number, row in enumerate(rows, 2):
        try:
            x, y, diameter = (float(row[name]) for name in OBJECT_COLUMNS)
            found.append(ConvexObject.disc((x, y), diameter))
        except KeyError as error:
            raise TableError(
                f'{path}: no column {error}; must have {", ".join(OBJECT_COLUMNS)}'
            ) from None
        except (TypeError, ValueError) as error:
            raise TableError(f'{path}: row {number}: {error}; must be three numbers') from None
    if not found:
        raise TableError(f'{path}: no objects below the header')
    return found


def row(result: SweepResult) -> list[Any]:
    """
    Return a result as a row of `COLUMNS`; what holds several values is separated by spaces.

    :param result: one result.
    """
    return [
        ' '.join(map(str, value)) if isinstance(value, tuple) else value
        for value in astuple(result)
    ]
