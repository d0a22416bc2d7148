# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Command-line options that say what a grasp must fulfil."""

from __future__ import annotations

import argparse
import math

from isotruss_ros.core import GraspRequirements
from isotruss_ros.core.planning.requirements import Measure
from isotruss_ros.core.planning.workers import MAX_WORKERS


def add_requirements(parser: argparse.ArgumentParser) -> None:
    """
    Add an option for each requirement.

    :param parser: gets the options.
    """
    group = parser.add_argument_group('requirements')
    usual = GraspRequirements()
    group.add_argument('--friction', type=float, default=usual.friction, metavar='MU')
    group.add_argument(
        '--external-wrench',
        type=float,
        nargs=3,
        default=usual.external_wrench,
        metavar=('FX', 'FY', 'M'),
        help='on the object about its centre [N, N m]',
    )
    group.add_argument('--module', help='the module t/j that is to grip; any if left out')
    group.add_argument(
        '--members',
        nargs='+',
        metavar='T/J-K',
        help='the two or three members that are to grip, in place of a module',
    )
    group.add_argument(
        '--squeeze',
        type=float,
        metavar='N',
        help='normal force of each of two grasping members [N]; the best one if left out',
    )
    group.add_argument(
        '--min-slip-margin',
        type=float,
        default=usual.min_slip_margin,
        metavar='N',
        help='wrench at which a member slips, the object free [N]',
    )
    group.add_argument(
        '--min-margin',
        type=float,
        metavar='N',
        help='closure margin of the object held fast [N]; open grasps too if left out',
    )
    group.add_argument(
        '--max-contact-force',
        type=float,
        default=math.inf,
        metavar='N',
        help='of one member on the object [N]',
    )
    group.add_argument(
        '--max-total-force', type=float, default=math.inf, metavar='N', help='of all members [N]'
    )
    group.add_argument(
        '--max-utilisation',
        type=float,
        default=usual.max_utilisation,
        metavar='U',
        help='bending moment of any member over its wrinkling moment (default %(default)s)',
    )
    group.add_argument(
        '--min-rigidity',
        type=float,
        default=usual.min_rigidity,
        metavar='R',
        help='of every configuration of the motion, against 1 at home (default %(default)s)',
    )
    group.add_argument('--min-length', type=float, metavar='M', help='of members [m]')
    group.add_argument('--max-length', type=float, metavar='M', help='of members [m]')
    group.add_argument(
        '--measure',
        choices=[measure.value for measure in Measure],
        default=usual.measure.value,
        help='what the grasps are ranked by (default %(default)s)',
    )
    group.add_argument(
        '--direction',
        type=float,
        nargs=3,
        default=usual.direction,
        metavar=('DX', 'DY', 'DTHETA'),
        help='for the measure stiffness: along what motion of the object [m, m, rad]',
    )
    group.add_argument(
        '--count',
        type=int,
        default=usual.count,
        help='of distinct grasps (default %(default)s)',
    )


def requirements(options: argparse.Namespace) -> GraspRequirements:
    """
    Return the requirements that the options ask for.

    :param options: the parsed command line.
    :raises GraspError: a value is not usable; says which and what would be right.
    """
    return GraspRequirements(
        friction=options.friction,
        external_wrench=tuple(options.external_wrench),
        module=options.module,
        members=options.members,
        squeeze=options.squeeze,
        min_slip_margin=options.min_slip_margin,
        min_margin=options.min_margin,
        max_contact_force=options.max_contact_force,
        max_total_force=options.max_total_force,
        max_utilisation=options.max_utilisation,
        min_rigidity=options.min_rigidity,
        min_length=options.min_length,
        max_length=options.max_length,
        measure=options.measure,
        direction=tuple(options.direction),
        count=options.count,
    )


def worker_count(text: str) -> int:
    """
    Return a number of processes, 0 for as many as there are cores.

    :param text: the argument.
    """
    try:
        value = int(text)
    except ValueError:
        value = -1
    if not 0 <= value <= MAX_WORKERS:
        raise argparse.ArgumentTypeError(
            f'{text!r}: must be from 0 (as many as there are cores) to {MAX_WORKERS}'
        )
    return value


def seed(text: str) -> int:
    """
    Return a seed, an integer that is not negative.

    :param text: the argument.
    """
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f'seed {text!r}: must be an integer, not negative')
    return int(text)


def duration(text: str) -> float:
    """
    Return a time that is not negative [s].

    :param text: the argument [s].
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f'{text!r}: must be a number of seconds, not negative')
    return value
