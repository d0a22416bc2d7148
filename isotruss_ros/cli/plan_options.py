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

from isotruss_ros.core import GraspRequirements
from isotruss_ros.core.planning.requirements import Measure
from isotruss_ros.core.planning.workers import MAX_WORKERS

#: Placeholder of the value, and help text, of the option for each requirement.
OPTIONS = {
    'friction': ('MU', 'between tubes and object (default %(default)s)'),
    'external_wrench': (('FX', 'FY', 'M'), 'on the object about its centre [N, N m]'),
    'module': ('T/J', 'the module that is to grip; any if left out'),
    'members': ('T/J-K', 'the two or three members that are to grip, in place of a module'),
    'squeeze': ('N', 'normal force of each grasping member [N]; the best one if left out'),
    'min_slip_margin': ('N', 'wrench at which a member slips, the object free [N]'),
    'min_margin': ('N', 'smallest closure margin of the fixed object [N]; any if left out'),
    'max_contact_force': ('N', 'of one member on the object [N]'),
    'max_total_force': ('N', 'of all members [N]'),
    'max_utilisation': ('U', 'bending over wrinkling moment of any member (default %(default)s)'),
    'min_rigidity': ('R', 'on the whole path, against 1 at home (default %(default)s)'),
    'min_length': ('M', 'of members [m]'),
    'max_length': ('M', 'of members [m]'),
    'measure': (None, 'what the grasps are ranked by (default slip_margin)'),
    'direction': (
        ('DX', 'DY', 'DTHETA'),
        'for the measure stiffness: along what motion of the object [m, m, rad]',
    ),
    'count': ('N', 'of distinct grasps (default %(default)s)'),
}


def add_requirements(parser: argparse.ArgumentParser) -> None:
    """
    Add a command-line option for each requirement.

    :param parser: parser of the options.
    """
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
        if field.type.startswith('tuple'):
            kind['nargs'] = len(metavar) if isinstance(metavar, tuple) else '+'
        option = f'--{field.name.replace("_", "-")}'
        group.add_argument(option, default=field.default, help=said, **kind)


def add_search(parser: argparse.ArgumentParser) -> argparse._ArgumentGroup:
    """
    Add the options of a search (random seed, number of processes), and return their group.

    :param parser: parser of the options.
    """
    group = parser.add_argument_group('search')
    group.add_argument('--seed', type=_seed, default=0, help='the same seed, the same answer')
    group.add_argument(
        '--workers',
        type=_worker_count,
        default=0,
        metavar='N',
        help='processes on this machine; as many as there are cores if 0 (default)',
    )
    return group


def requirements(options: argparse.Namespace) -> GraspRequirements:
    """
    Return the requirements of a grasp that the options specify.

    :param options: parsed command line.
    :raises GraspError: a value is invalid; the message names it and its valid range.
    """
    return GraspRequirements(**{name: getattr(options, name) for name in OPTIONS})


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
