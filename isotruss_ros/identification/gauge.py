# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forces of a gauge during a run, from a CSV file."""

from __future__ import annotations

import csv
from dataclasses import dataclass
import math
from pathlib import Path

from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

TIME, SQUEEZE, PULL = 'time_s', 'squeeze_N', ('pull_x_N', 'pull_y_N')
GRAVITY = 'gravity_x_m_s2', 'gravity_y_m_s2'
COLUMNS = f'{TIME}, and {SQUEEZE}, {" and ".join(PULL)}, {" and ".join(GRAVITY)}, or several'
#: Largest force, as the largest squeeze in the settings of the control loop [N].
MAX_FORCE = 1e3
#: Largest gravity in the plane of the robot [m/s^2].
MAX_GRAVITY = 10.0
#: Smallest share of the run in which the gauge must have readings [-]. With less than half, most
#: of the comparison would rest on the first and the last reading.
MIN_OVERLAP = 0.5


@dataclass(frozen=True, eq=False)
class Gauge:
    """Readings of force gauges on the clock of the run."""

    source: str  #: path of the file
    times: Array  #: (k,) increasing times [s]
    squeeze: Array | None = None  #: (k,) mean normal force of the grasping members [N]
    #: (k, 2) force on the object besides its weight, robot frame [N]
    pull: Array | None = None
    gravity: Array | None = None  #: (k, 2) gravity in the plane of the robot [m/s^2]

    def check_overlap(self, begin: float, end: float) -> None:
        """Raise MeasurementError unless the readings cover most of a run between two times [s]."""
        first, last = float(self.times[0]), float(self.times[-1])
        if min(last, end) - max(first, begin) < MIN_OVERLAP * (end - begin):
            raise MeasurementError(
                f'{self.source}: {TIME} from {first:.3f} to {last:.3f} s: must cover at least '
                f'half of the run, which is from {begin:.3f} to {end:.3f} s; --gauge-zero gives '
                'the time of the run at which the clock of the gauge is zero'
            )


def read_gauge(path: Path, zero: float = 0.0) -> Gauge:
    """
    Read a CSV file with a column `time_s`, and columns of forces whose names have the unit.

    :param zero: time of the run at which the times of the file are zero [s].
    :raises MeasurementError: a column is missing, or a value is invalid.
    """
    try:
        with path.open(encoding='utf-8-sig', newline='') as file:
            reader = csv.DictReader(file, skipinitialspace=True)
            names = [name.strip() for name in reader.fieldnames or ()]
            reader.fieldnames = names
            columns = _find_columns(path, names)
            rows = [[_read(path, reader.line_num, c, row[c]) for c in columns] for row in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise MeasurementError(f'{path}: cannot be read: {error}') from error
    if len(rows) < 2:
        raise MeasurementError(f'{path}: {len(rows)} rows: must be at least 2')
    table = dict(zip(columns, np.array(rows).T, strict=True))
    steps = np.diff(table[TIME])
    if steps.min() <= 0.0:
        line = int(steps.argmin()) + 3
        raise MeasurementError(
            f'{path}: line {line}: {TIME} {table[TIME][line - 2]:g}: must be later than the '
            f'{table[TIME][line - 3]:g} s of the line above'
        )
    vectors = [
        np.stack([table[name] for name in pair], axis=1) if pair[0] in table else None
        for pair in (PULL, GRAVITY)
    ]
    return Gauge(str(path), table[TIME] + zero, table.get(SQUEEZE), *vectors)


def _find_columns(path: Path, names: list[str]) -> list[str]:
    """Return the names of the used columns; raise MeasurementError if one is missing."""
    used = [name for name in (TIME, SQUEEZE, *PULL, *GRAVITY) if names.count(name) == 1]
    is_half = any(sum(name in used for name in pair) == 1 for pair in (PULL, GRAVITY))
    if TIME not in used or len(used) < 2 or is_half:
        shown = ','.join(names)
        shown = shown if len(shown) <= 60 else f'{shown[:57]}...'
        raise MeasurementError(
            f'{path}: the first line is {shown!r}: must name once each {COLUMNS}; times in s, '
            'forces in N, accelerations in m/s^2'
        )
    return used


def _read(path: Path, line: int, name: str, text: str | None) -> float:
    """Return a number of the table; raise MeasurementError unless it is within its range."""
    try:
        value = float(text or '')
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise MeasurementError(f'{path}: line {line}: {name} {text!r}: must be a finite number')
    if name == TIME:
        return value
    if name in GRAVITY:
        if abs(value) <= MAX_GRAVITY:
            return value
        raise MeasurementError(
            f'{path}: line {line}: {name} {value:g}: must be at most {MAX_GRAVITY:g} m/s^2'
        )
    low = 0.0 if name == SQUEEZE else -MAX_FORCE
    # A gauge without load may read slightly less than zero.
    if not low - 0.01 * MAX_FORCE <= value <= MAX_FORCE:
        raise MeasurementError(
            f'{path}: line {line}: {name} {value:g}: must be from {low:g} to {MAX_FORCE:g} N; '
            f'if it is in mN, it is {1e-3 * value:g} N'
        )
    return value
