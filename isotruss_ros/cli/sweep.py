# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Executable `sweep`, which plans grasps for many robots and objects.

The results are written to a CSV file. Each pair of a robot and an object is a task of a Dask
cluster with two or more workers, on one machine or on several. The command needs `distributed`,
which the extra `sweep` of this package installs, but no ROS.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
import contextlib
import csv
import importlib
import itertools
from pathlib import Path
import sys
from typing import Any, TYPE_CHECKING, TypeAlias

from isotruss_ros import core
from isotruss_ros.cli.plan_options import add_cluster, add_requirements, add_search, requirements
from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.model.description import RobotDescription
from isotruss_ros.core.planning.requirements import GraspRequirements
from isotruss_ros.core.planning.violations import export_violation
from isotruss_ros.workers import dask_client

if TYPE_CHECKING:
    from distributed import Client

COLUMNS = (
    *('robot', 'object', 'name', 'x', 'y', 'diameter', 'found', 'module', 'members', 'score'),
    *('squeeze', 'slip_margin', 'required_friction', 'max_contact_force'),
    *('total_force', 'utilisation', 'nonlinearity', 'travel', 'rigidity', 'roller_positions'),
    *('violated_requirement', 'violation_value', 'violation_bound', 'evaluations', 'error'),
)
#: Indices of robot and object, the description of the robot, and the object.
Pair: TypeAlias = tuple[tuple[int, int], RobotDescription, ConvexObject]


def evaluate(pair: Pair, needs: GraspRequirements, seed: int) -> dict[str, Any]:
    """Return a row of the table with the best grasp of one object by one robot."""
    from isotruss_ros.core.planning.grasp_plan import export_figures

    (robot, item), description, body = pair
    row = {'robot': robot, 'object': item, 'name': description.name, 'diameter': 2.0 * body.arm}
    row |= dict(zip('xy', body.pose[:2], strict=True)) | {'found': 0, 'error': ''}
    try:
        plan = core.plan_grasps(core.Robot(description).home, body, needs, seed)
    except IsotrussError as error:
        return row | {'error': str(error)}  # an invalid robot does not end the sweep
    row |= {'found': len(plan.grasps), 'evaluations': plan.evaluations}
    found = export_figures(plan.grasps[0]) if plan.grasps else {}
    return row | export_violation(plan.closest_violation) | found


def sweep(
    client: Client,
    robots: Sequence[RobotDescription],
    objects: Sequence[ConvexObject],
    needs: GraspRequirements,
    seed: int = 0,
) -> Iterator[dict[str, Any]]:
    """Yield a row of the table for each pair of robot and object, as soon as it is computed."""
    from distributed import as_completed

    pairs = [
        ((i, j), robots[i], objects[j])
        for i, j in itertools.product(range(len(robots)), range(len(objects)))
    ]
    futures = client.map(evaluate, pairs, needs=needs, seed=seed, pure=False)
    try:
        for _, row in as_completed(futures, with_results=True):
            yield row
    finally:
        client.cancel(futures)


def read_objects(path: Path) -> list[ConvexObject]:
    """Read discs from a CSV file with the columns x, y and diameter [m], one disc in each row."""
    with path.open(encoding='utf-8', newline='') as file:
        rows = list(csv.DictReader(file))
    found = []
    for number, row in enumerate(rows, 2):
        try:
            x, y, diameter = (float(row[name]) for name in ('x', 'y', 'diameter'))
            found.append(ConvexObject.disc((x, y), diameter))
        except (KeyError, TypeError, ValueError) as error:
            raise IsotrussError(
                f'{path}: row {number}: {error}; must have numbers x, y, diameter'
            ) from error
    if not found:
        raise IsotrussError(f'{path}: no objects below the header; must have one or more')
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Plan grasps for all pairs, and write each row as soon as it is computed."""
    parser = argparse.ArgumentParser(prog='isotruss sweep', description=__doc__)
    parser.add_argument('robots', nargs='+', help='names of presets, or paths of robot files')
    parser.add_argument('--objects', type=Path, required=True, help='CSV file: x,y,diameter [m]')
    parser.add_argument('--output', type=Path, required=True, help='CSV file to write')
    add_requirements(parser)
    add_cluster(add_search(parser))
    options = parser.parse_args(arguments)
    try:
        _run(options)
    except (IsotrussError, OSError, UnicodeDecodeError, csv.Error) as error:
        print(f'sweep: {error}', file=sys.stderr)
        return 2
    return 0


def _run(options: argparse.Namespace) -> None:
    importlib.import_module('distributed')  # named as missing before the progress bar
    from isotruss_ros.core.model.robot_file import read_robot_file
    from rich.console import Console
    from rich.progress import Progress

    robots = [read_robot_file(name) for name in options.robots]
    objects, needs = read_objects(options.objects), requirements(options)
    count, found = len(robots) * len(objects), 0
    with contextlib.ExitStack() as stack:
        file = stack.enter_context(options.output.open('w', encoding='utf-8', newline=''))
        client = stack.enter_context(dask_client(options.scheduler, options.workers))
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        rows = sweep(client, robots, objects, needs, options.seed)
        bar = stack.enter_context(Progress(console=Console(stderr=True), transient=True))
        for row in bar.track(rows, total=count, description='sweeping'):
            lists = {key: ' '.join(map(str, v)) for key, v in row.items() if isinstance(v, list)}
            table.writerow(row | lists)
            file.flush()  # complete rows after an early end
            found += row['found'] > 0
    print(f'{count} pairs: {found} grasped')


if __name__ == '__main__':
    sys.exit(main())
