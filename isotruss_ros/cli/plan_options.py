# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Command-line options for the requirements of a grasp."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import fields
import math
import sys
from typing import Any

from isotruss_ros import core
from isotruss_ros.core.model.obstacle import Obstacle
from isotruss_ros.core.planning.requirements import GraspRequirements, Measure
from isotruss_ros.workers import MAX_WORKERS

#: Placeholder of the value, and help text, of the option for each requirement.
OPTIONS = {
    'friction': ('MU', 'coefficient of friction between tubes and object (default %(default)s)'),
    'external_wrench': (
        ('FX', 'FY', 'M'),
        'external wrench on the object about the origin of its frame [N, N m]',
    ),
    'module': ('T/J', 'module at which two grasping members meet; default: any'),
    'members': ('T/J-K', 'two or three grasping members, instead of a module'),
    'squeeze': ('N', 'normal force of each grasping member [N]; default: optimal for the measure'),
    'min_slip_margin': ('N', 'smallest slip margin of the free object [N]'),
    'max_contact_force': ('N', 'largest normal force of one member [N]'),
    'max_total_force': ('N', 'largest sum of the normal forces [N]'),
    'max_utilisation': (
        'U',
        'largest ratio of bending moment to wrinkling moment (default %(default)s)',
    ),
    'min_rigidity': ('R', 'smallest rigidity index along the path (default %(default)s)'),
    'min_length': ('M', 'smallest member length [m]'),
    'max_length': ('M', 'largest member length [m]'),
    'measure': (None, 'criterion by which grasps are ranked (default slip_margin)'),
    'direction': (
        ('DX', 'DY', 'DTHETA'),
        'motion of the object for the measure stiffness [m, m, rad]',
    ),
    'obstacles': ('YAML', 'path of a file with obstacles, or YAML text in braces'),
    'min_obstacle_clearance': (
        'M',
        'smallest distance of the robot from obstacles along the path [m] (default %(default)s)',
    ),
    'count': ('N', 'largest number of distinct grasps (default %(default)s)'),
}


def add_requirements(parser: argparse.ArgumentParser) -> None:
    """Add a command-line option for each requirement."""
    group = parser.add_argument_group('requirements')
    for field in fields(GraspRequirements):
        if field.name not in OPTIONS:
            continue
        metavar, said = OPTIONS[field.name]
        kind: dict[str, Any] = {'type': float, 'metavar': metavar}
        if field.name == 'measure':
            kind = {'choices': [measure.value for measure in Measure]}
        elif field.name == 'count':
            kind['type'] = int
        elif field.name in ('module', 'members'):
            kind['type'] = str
        if field.name == 'obstacles':
            kind['type'] = _read_obstacles
        elif field.type.startswith('tuple'):
            kind['nargs'] = len(metavar) if isinstance(metavar, tuple) else '+'
        option = f'--{field.name.replace("_", "-")}'
        group.add_argument(option, default=field.default, help=said, **kind)


def add_search(parser: argparse.ArgumentParser) -> argparse._ArgumentGroup:
    """Add the options of a search (random seed, number of processes), and return their group."""
    group = parser.add_argument_group('search')
    group.add_argument('--seed', type=_seed, default=0, help='random seed of the search')
    group.add_argument(
        '--workers',
        type=_worker_count,
        default=0,
        metavar='N',
        help='number of processes on this machine; 0 (default): one for each core',
    )
    return group


def add_cluster(group: argparse._ArgumentGroup) -> None:
    """Add the option of a Dask cluster."""
    group.add_argument(
        '--scheduler', metavar='ADDRESS', help='address of a Dask cluster; default: this machine'
    )


def requirements(options: argparse.Namespace) -> GraspRequirements:
    """Return the requirements of a grasp that the options specify."""
    return GraspRequirements(**{name: getattr(options, name) for name in OPTIONS})


def _read_obstacles(text: str) -> tuple[Obstacle, ...]:
    try:
        return core.read_obstacles(text)
    except core.IsotrussError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _read_number(kind: type, high: float, words: str) -> Callable[[str], float]:
    """Return a function that converts a text to a number between 0 and a largest value."""

    def read(text: str) -> float:
        try:
            value = kind(text)
        except ValueError:
            value = -1
        if not 0 <= value <= high:
            raise argparse.ArgumentTypeError(f'{text!r}: must be {words}')
        return value

    return read


_worker_count = _read_number(
    int, MAX_WORKERS, f'from 0 (as many as there are cores) to {MAX_WORKERS}'
)
_seed = _read_number(int, math.inf, 'an integer, not negative')
duration = _read_number(float, sys.float_info.max, 'a number of seconds, not negative')
