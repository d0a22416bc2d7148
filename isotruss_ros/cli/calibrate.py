# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Executables `calibrate_home` and `calibrate_stiffness`.

They fit parameters to measured joint positions of a robot without an object, and write these
parameters to a robot file.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from isotruss_ros.calibration.measurements import JOINT_COLUMNS, MeasurementError
from isotruss_ros.core import IsotrussError

if TYPE_CHECKING:
    from isotruss_ros.calibration.home_fit import Posture


def home(arguments: Sequence[str] | None = None) -> int:
    """
    Fit and print the roller offsets, and write the robot file with the corrected home.

    :return: exit code, 1 if the joints do not determine the result.
    """
    parser = _parser('calibrate_home', 'Fit the roller offsets to measured joints.')
    parser.add_argument('joints', type=Path, help=_FILE)
    return _run(parser, arguments, _calibrate_home)


def stiffness(arguments: Sequence[str] | None = None) -> int:
    """
    Fit and print the factor on the tube stiffness, and write it to the robot file.

    :return: exit code, 1 if the joints do not determine the result.
    """
    parser = _parser('calibrate_stiffness', 'Find how stiff the tubes are, from a known pull.')
    parser.add_argument('before', type=Path, help=f'joints without the force: {_FILE}')
    parser.add_argument('under', type=Path, help='the same joints under the force')
    parser.add_argument('--joint', required=True, help='joint on which the force acts')
    parser.add_argument(
        '--force', required=True, nargs=2, type=float, metavar=('FX', 'FY'), help='force [N]'
    )
    return _run(parser, arguments, _calibrate_stiffness)


_FILE = f'CSV file with the columns {",".join(JOINT_COLUMNS)} and one for each roller [m]'


def _parser(name: str, description: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=f'isotruss {name}', description=description)
    parser.add_argument('--robot', default='nine_member', help='name of a preset, or path')
    parser.add_argument('--output', type=Path, help='robot file to write')
    parser.add_argument(
        '--deviation',
        type=float,
        default=1e-3,
        help='standard deviation of a measured coordinate [m] (default %(default)s)',
    )
    return parser


def _run(
    parser: argparse.ArgumentParser,
    arguments: Sequence[str] | None,
    calibrate: Callable[[argparse.Namespace], None],
) -> int:
    """Run a calibration, print the reason if it fails, and return the exit code."""
    options = parser.parse_args(arguments)
    try:
        calibrate(options)
    except IsotrussError as error:
        print(f'{parser.prog}: {error}', file=sys.stderr)
        return 1
    return 0


def _calibrate_home(options: argparse.Namespace) -> None:
    from isotruss_ros.calibration.home import calibrate_home
    from isotruss_ros.calibration.robot_files import read_postures, write_robot_file
    from isotruss_ros.core import load_robot
    import numpy as np

    robot = load_robot(options.robot)
    calibrated = calibrate_home(robot, read_postures(options.joints, robot), options.deviation)
    print('roller    offset [mm]')
    for name, offset, sure in zip(
        robot.roller_names, calibrated.offsets, calibrated.deviations, strict=True
    ):
        print(f'{name:10s} {1e3 * offset:+7.2f} +- {1e3 * sure:.2f}')
    rms = float(np.sqrt((calibrated.residuals**2).mean()))
    print(f'residual of the joint positions: {1e3 * rms:.2f} mm (RMS)')
    if options.output:
        write_robot_file(robot, options.output, home=calibrated)
        print(f'{options.output}: written; at home all encoders read zero')


def _calibrate_stiffness(options: argparse.Namespace) -> None:
    from isotruss_ros.calibration.robot_files import read_postures, write_robot_file
    from isotruss_ros.calibration.stiffness_scale import calibrate_stiffness
    from isotruss_ros.core import load_robot
    import numpy as np

    robot = load_robot(options.robot)
    before, under = (
        _only_posture(path, read_postures(path, robot)) for path in (options.before, options.under)
    )
    if not np.array_equal(before.roller_positions, under.roller_positions):
        raise MeasurementError(
            f'{options.under}: encoder readings must be equal to those of {options.before}'
        )
    calibrated = calibrate_stiffness(
        robot.configuration(before.roller_positions),
        {options.joint: tuple(options.force)},
        before.joints,
        under.joints,
        options.deviation,
    )
    print(f'stiffness relative to the model: {calibrated.scale:.3f} +- {calibrated.deviation:.3f}')
    if options.output:
        write_robot_file(robot, options.output, stiffness=calibrated)
        print(f'{options.output}: written; tube.stiffness_scale is {calibrated.scale:.4g}')


def _only_posture(path: Path, postures: Sequence[Posture]) -> Posture:
    """Return the posture of a file that must contain a single posture."""
    if len(postures) != 1:
        raise MeasurementError(f'{path}: {len(postures)} postures: must be one')
    return postures[0]
