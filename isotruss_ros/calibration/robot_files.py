# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reading of measured joint positions from CSV files, and writing of calibrated robot files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import contextlib
import csv
from pathlib import Path

from isotruss_ros.calibration.home import HomeCalibration
from isotruss_ros.calibration.home_fit import Posture
from isotruss_ros.calibration.measurements import JOINT_COLUMNS, MeasurementError
from isotruss_ros.calibration.stiffness_scale import StiffnessCalibration
from isotruss_ros.core.kinematics.robot import Robot
import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq


def read_postures(path: Path, robot: Robot) -> list[Posture]:
    """
    Read measured joint positions and encoder readings from a CSV file with a row per joint.

    :param path: path of the file; its columns are `JOINT_COLUMNS` and one for each roller, by its
        name. A row contains one joint and all encoder readings. All lengths are in metres.
    :param robot: the robot.
    :raises MeasurementError: a value is invalid; the message names the line, the value and the
        valid range.
    """
    rollers = robot.roller_names
    try:
        with path.open(newline='', encoding='utf-8') as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise MeasurementError(f'{path}: cannot be read: {error}') from error
    missing = [name for name in (*JOINT_COLUMNS, *rollers) if not rows or name not in rows[0]]
    if missing:
        raise MeasurementError(
            f'{path}: columns {", ".join(missing)} are missing; must be posture, joint, x, y and '
            f'one for each roller, {", ".join(rollers)}'
        )
    postures: dict[str, Posture] = {}
    for line, row in enumerate(rows, 2):
        numbers = [_read_number(path, line, name, row[name]) for name in ('x', 'y', *rollers)]
        place, encoders = tuple(numbers[:2]), np.array(numbers[2:])
        posture = postures.setdefault(row['posture'], Posture(encoders, {}))
        if row['joint'] in posture.joints or not np.array_equal(
            encoders, posture.roller_positions
        ):
            raise MeasurementError(
                f'{path}: line {line}: joint {row["joint"]!r} of posture {row["posture"]!r}: must '
                'come once in a posture, in which the rollers are in one place'
            )
        posture.joints[row['joint']] = place  # type: ignore[index]
    return list(postures.values())


def _read_number(path: Path, line: int, name: str, text: str | None) -> float:
    """Return a number of a table; raise MeasurementError if it is not finite."""
    try:
        number = float(text or '')
    except ValueError:
        number = float('nan')
    if not np.isfinite(number):
        raise MeasurementError(
            f'{path}: line {line}: {name} {text!r}: must be a finite number [m]'
        )
    return number


def write_robot_file(
    robot: Robot,
    path: Path,
    home: HomeCalibration | None = None,
    stiffness: StiffnessCalibration | None = None,
) -> None:
    """
    Write a copy of the robot file with calibrated values; comments are preserved.

    :param robot: robot of the robot file.
    :param path: path of the new file, which may be the path of the old file.
    :param home: calibrated home.
    :param stiffness: calibrated stiffness of the tubes.
    :raises MeasurementError: a file cannot be read or written.
    """
    with _changing(robot, path) as content:
        known = content.setdefault('calibration', {})
        if home is not None:
            for joint, place in home.description.joints.items():
                content['joints'][joint] = _in_one_line(place)
            sure = zip(robot.roller_names, home.deviations.tolist(), strict=True)
            known['zero_deviations'] = {name: float(f'{value:.3g}') for name, value in sure}
        if stiffness is not None:
            content['tube']['stiffness_scale'] = float(f'{stiffness.scale:.4g}')
            known['stiffness_deviation'] = float(f'{stiffness.deviation:.2g}')


def write_checked_rollers(robot: Robot, path: Path, names: Sequence[str]) -> None:
    """
    Write a copy of the robot file with the names of the rollers whose motion was checked.

    :param robot: robot of the robot file.
    :param path: path of the new file, which may be the path of the old file.
    :param names: names of the checked rollers.
    :raises MeasurementError: a file cannot be read or written.
    """
    with _changing(robot, path) as content:
        content.setdefault('calibration', {})['checked_rollers'] = _in_one_line(names)


@contextlib.contextmanager
def _changing(robot: Robot, path: Path) -> Iterator[CommentedMap]:
    """Read a robot file, yield its content for changes, and write the result to another file."""
    yaml = YAML()
    yaml.preserve_quotes = True  # type: ignore[assignment]
    yaml.width = 200  # type: ignore[assignment]
    try:
        content = yaml.load(Path(robot.description.source).read_text(encoding='utf-8'))
        yield content
        with path.open('w', encoding='utf-8') as file:
            yaml.dump(content, file)
    except OSError as error:
        raise MeasurementError(f'{path}: {error.strerror}') from error


def _in_one_line(values: Sequence[float | str]) -> CommentedSeq:
    """Return a list that YAML writes on one line (flow style)."""
    found = CommentedSeq(values)
    found.fa.set_flow_style()
    return found
