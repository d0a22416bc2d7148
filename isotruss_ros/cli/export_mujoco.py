# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Executable `export_mujoco`, which exports a robot as a self-contained MuJoCo model."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys

from isotruss_ros import core
from isotruss_ros.core.errors import IsotrussError, ObjectFileError

WRITTEN, BAD_ARGUMENTS = 0, 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the model to a file, and return the exit code."""
    options = _parser().parse_args(arguments)
    from isotruss_ros.mujoco_plant.mjcf import export_mjcf
    from isotruss_ros.mujoco_plant.options import PlantOptions

    try:
        objects = [core.ConvexObject.disc((x, y), diameter) for x, y, diameter in options.object]
        objects += [_place(*given) for given in options.shape]
        settings = PlantOptions(friction=options.friction)
        text = export_mjcf(core.load_robot(options.robot), objects, settings, actuated=True)
        options.model.write_text(text, encoding='utf-8')
    except (IsotrussError, OSError) as error:
        print(f'export_mujoco: {error}', file=sys.stderr)
        return BAD_ARGUMENTS
    print(f'{options.model}: open it with python -m mujoco.viewer --mjcf={options.model}')
    return WRITTEN


def _place(file: str, *pose: str) -> core.ConvexObject:
    """Return the object of an object file at the pose in the command line."""
    try:
        x, y, angle = map(float, pose)
    except ValueError as error:
        raise ObjectFileError(f'--shape {file} {" ".join(pose)}: {error}') from error
    return core.read_object(file).placed_at(core.Pose(x, y, angle))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='isotruss export_mujoco',
        description='Write a robot at home as a MuJoCo model (MJCF).',
        epilog='exit codes: 0 written, 2 bad arguments',
    )
    parser.add_argument('robot', help='name of a preset, or path of a robot file')
    parser.add_argument('model', type=Path, help='file to write')
    parser.add_argument(
        '--object',
        type=float,
        nargs=3,
        action='append',
        default=[],
        metavar=('X', 'Y', 'D'),
        help='centre and diameter of a disc [m]; may be repeated',
    )
    parser.add_argument(
        '--shape',
        nargs=4,
        action='append',
        default=[],
        metavar=('FILE', 'X', 'Y', 'ANGLE'),
        help='object file and pose of an object [m, rad]; may be repeated',
    )
    parser.add_argument(
        '--friction', type=float, default=0.5, help='coefficient of friction (default %(default)s)'
    )
    return parser


if __name__ == '__main__':
    sys.exit(main())
