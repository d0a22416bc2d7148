# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reading of measured points from a CSV file, in groups, with reasons why rows are unused."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
import csv
from dataclasses import dataclass, replace
import io
import math
from pathlib import Path

from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.model.units import likely_unit
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, MAX_MAGNITUDE
import numpy as np

#: Modes in which the end of a tube is loaded, in the order of Fig. 2.
MODES = ('axial', 'transverse', 'rotary')
#: Mode of a cylinder pressed into the side of the tube, as in Fig. 6; its rows need the cylinder's
#: diameter.
INTERFERENCE = 'interference'
DIAMETER = 'diameter'
NUMBER_COLUMNS = ('pressure', 'length', 'displacement', 'load')
COLUMNS = ('mode', *NUMBER_COLUMNS)
TRIAL = 'trial'
#: First columns of a table of measured joints; a column for each roller follows.
JOINT_COLUMNS = ('posture', 'joint', 'x', 'y')
#: Diameter of the tubes of the paper and of the presets [m].
DEFAULT_DIAMETER = 0.102
#: Valid ranges of the values of a row: pressure as in a robot file [Pa], diameter from hand-sized
#: to house-sized tubes [m], length [m].
RANGES = {
    'pressure': (1e3, 3e5, 'Pa'),
    'length': (0.02, 10.0, 'm'),
    DIAMETER: (1e-3, 1.0, 'm'),
}
#: Largest angle of the rotary mode [rad]; in the other modes the length bounds the displacement.
MAX_ANGLE = math.pi
#: Largest share of the rows of one mode that may have too large displacements by mistake [-]. Of
#: rotations up to 4 degrees, a fifth exceeds half a turn if read as rad.
MAX_FAR_SHARE = 0.2
#: Largest size of a file [bytes], about a million points.
MAX_FILE_SIZE = 50_000_000


class MeasurementError(IsotrussError, ValueError):
    """Error: measurements are unreadable, invalid, or insufficient for a fit."""


@dataclass(frozen=True, eq=False)
class Group:
    """Measured points of one deformation mode at one pressure and one length."""

    mode: str  #: mode of the load: axial, transverse or rotary
    pressure: float  #: gauge pressure [Pa]
    length: float  #: unloaded length between pinch points (axial) or guide rings (others) [m]
    lines: Indices  #: (n,) line numbers in the file
    trials: Indices  #: (n,) index of each point's trial, 0 ... t - 1
    displacements: Array  #: (n,) displacements [m]; in the rotary mode rotations [rad]
    loads: Array  #: (n,) forces [N]; in the rotary mode moments [N m]

    def only(self, chosen: Flags) -> Group:
        """
        Return the group with some of its points; the trials keep their indices.

        :param chosen: (n,) mask of the points.
        """
        names = ('lines', 'trials', 'displacements', 'loads')
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})

    @property
    def name(self) -> str:
        """Return a name of the group of points for error messages."""
        return f'{self.mode}, {self.pressure:g} Pa, {self.length:g} m'


@dataclass(frozen=True, eq=False)
class Presses:
    """Measured points, each from a test that presses a cylinder into a clamped tube's middle."""

    pressures: Array  #: (n,) gauge pressures [Pa]
    lengths: Array  #: (n,) lengths of the tube between the clamps [m]
    cylinders: Array  #: (n,) diameters of the cylinders [m]
    depths: Array  #: (n,) depths below the skin of the undeformed tube, positive [m]
    loads: Array  #: (n,) loads, positive [N]


@dataclass(frozen=True)
class Measurements:
    """Content of a file of measured points."""

    #: points measured at ends of tubes, grouped by mode, pressure and length
    groups: tuple[Group, ...]
    presses: Presses  #: points of the mode interference
    unused: Mapping[str, list[int]]  #: line numbers of unused rows, by reason
    #: for each mode whose displacements look like another unit, the reason
    wrong_units: Mapping[str, str]
    rows: int  #: number of rows in the file without the header
    ignored_columns: tuple[str, ...]  #: names of unknown columns


def read_measurements(path: Path) -> Measurements:
    """
    Read a CSV file with the columns mode, pressure, length, displacement, load.

    An optional column trial distinguishes repetitions. Rows with the mode interference need a
    column diameter with the diameter of the cylinder.

    :param path: path of the file.
    :raises MeasurementError: the file cannot be read, or a column is missing.
    """
    unused: dict[str, list[int]] = {}
    valid: dict[str, list[tuple[int, dict[str, str]]]] = {}
    rows = 0
    try:
        reader = csv.reader(io.StringIO(_text(path), newline=''), skipinitialspace=True)
        header = [name.strip() for name in next(reader, [])]
        ignored = _check_header(path, header)
        for row in reader:
            if not row:
                continue  # an empty line
            rows += 1
            cells = [cell.strip() for cell in row]
            complaint = '; '.join(_find_complaints(header, cells))
            if complaint:
                unused.setdefault(complaint, []).append(reader.line_num)
                continue
            values = dict(zip(header, cells, strict=True))
            valid.setdefault(values['mode'], []).append((reader.line_num, values))
    except UnicodeDecodeError as error:
        raise MeasurementError(f'{path}: byte {error.start}: not UTF-8 text') from error
    except csv.Error as error:
        raise MeasurementError(f'{path}: line {reader.line_num}: not CSV: {error}') from error
    wrong_units = _drop_far_rows(valid, unused)
    points: dict[tuple[int, float, float], list[tuple[int, str, float, float]]] = {}
    presses: list[tuple[float, ...]] = []
    for mode, lines in valid.items():
        for line, values in lines:
            pressure, length, displacement, load = (float(values[name]) for name in NUMBER_COLUMNS)
            if mode == INTERFERENCE:
                presses.append((pressure, length, float(values[DIAMETER]), displacement, load))
            else:
                point = (line, values.get(TRIAL, ''), displacement, load)
                points.setdefault((MODES.index(mode), pressure, length), []).append(point)
    groups = tuple(_group(*key, points[key]) for key in sorted(points))
    pressed = Presses(*np.array(presses).reshape(-1, 5).T)
    return Measurements(groups, pressed, unused, wrong_units, rows, ignored)


def _drop_far_rows(
    valid: dict[str, list[tuple[int, dict[str, str]]]], unused: dict[str, list[int]]
) -> dict[str, str]:
    """
    Move rows with too large displacements to `unused`, all rows of a mode if many are too large.

    Small displacements in another unit are within the range, so they are wrong as well.

    :param valid: line number and values of each row, by mode.
    :param unused: line numbers by reason.
    :return: for each mode of which all rows were moved, the reason.
    """
    wrong_units = {}
    for mode, rows in valid.items():
        faults = {line: _too_far(values) for line, values in rows}
        far = [line for line, fault in faults.items() if fault]
        if len(far) > MAX_FAR_SHARE * len(rows):
            reason = f'mode {mode}: {len(far)} of {len(rows)} rows with a {faults[far[0]]}'
            wrong_units[mode] = reason
            unused.setdefault(reason, []).extend(faults)
            valid[mode] = []
        else:
            for line in far:
                unused.setdefault(faults[line], []).append(line)
            valid[mode] = [row for row in rows if not faults[row[0]]]
    return wrong_units


def _text(path: Path) -> str:
    try:
        with path.open('rb') as file:
            data = file.read(MAX_FILE_SIZE + 1)
    except OSError as error:
        raise MeasurementError(f'{path}: cannot be read: {error.strerror}') from error
    if len(data) > MAX_FILE_SIZE:
        raise MeasurementError(f'{path}: too long; must have at most {MAX_FILE_SIZE} bytes')
    return data.decode('utf-8-sig')


def _check_header(path: Path, header: Sequence[str]) -> tuple[str, ...]:
    """Return the names of unknown columns; raise MeasurementError for a missing column."""
    missing = [name for name in COLUMNS if header.count(name) != 1]
    if missing or header.count(TRIAL) > 1 or header.count(DIAMETER) > 1:
        found = ','.join(header)
        found = found if len(found) <= 60 else found[:57] + '...'
        raise MeasurementError(
            f'{path}: the first line is {found!r}: must name each of the columns '
            f'{",".join(COLUMNS)} once, and maybe {TRIAL} and {DIAMETER}'
        )
    return tuple(name for name in header if name not in (*COLUMNS, TRIAL, DIAMETER))


def _too_far(values: Mapping[str, str]) -> str:
    """Return the fault of a row if its displacement is implausibly large; else empty."""
    moved = abs(float(values['displacement']))
    if values['mode'] == 'rotary' and moved > MAX_ANGLE:
        return 'displacement of more than half a turn: must be in rad; these may be degrees'
    if values['mode'] != 'rotary' and moved > float(values['length']):
        return 'displacement of more than the length of the tube: must be in m; these may be mm'
    return ''


def _find_complaints(header: Sequence[str], cells: Sequence[str]) -> Iterator[str]:
    """Yield the faults of a row of the file of measurements."""
    if len(cells) != len(header):
        yield f'{len(cells)} values for {len(header)} columns'
        return
    pressed = INTERFERENCE in cells
    positive: tuple[str, ...] = ('pressure', 'length')
    if pressed:
        positive = (*positive, 'displacement', 'load', DIAMETER)
        if DIAMETER not in header:
            yield f'mode {INTERFERENCE}: needs a column {DIAMETER}, that of the cylinder [m]'
    for name, cell in zip(header, cells, strict=True):
        shown = repr(cell if len(cell) <= 30 else cell[:27] + '...')
        if name == 'mode' and cell not in (*MODES, INTERFERENCE):
            yield f'mode {shown}: must be one of {", ".join((*MODES, INTERFERENCE))}'
        elif name in NUMBER_COLUMNS or (pressed and name == DIAMETER):
            try:
                value = float(cell)
            except ValueError:
                yield f'{name} {shown}: must be a number'
                continue
            # Numbers beyond the range of a robot file are errors and overflow in products; so do
            # reciprocals.
            if not abs(value) <= MAX_MAGNITUDE:
                yield f'{name} {shown}: must be finite, at most {MAX_MAGNITUDE:g}'
            elif name in positive and value < 1.0 / MAX_MAGNITUDE:
                yield f'{name} {shown}: must be positive, at least {1.0 / MAX_MAGNITUDE:g}'
            elif name in RANGES and not RANGES[name][0] <= value <= RANGES[name][1]:
                low, high, unit = RANGES[name]
                hint = likely_unit(value, unit, low, high)
                yield f'{name} {shown}: must be from {low:g} to {high:g} {unit}{hint}'


def _group(
    mode: int, pressure: float, length: float, points: Sequence[tuple[int, str, float, float]]
) -> Group:
    lines, trials, displacements, loads = zip(*points, strict=True)
    numbers: dict[str, int] = {}
    return Group(
        MODES[mode],
        pressure,
        length,
        np.array(lines),
        np.array([numbers.setdefault(trial, len(numbers)) for trial in trials]),
        np.array(displacements),
        np.array(loads),
    )
