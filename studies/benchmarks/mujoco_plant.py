# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Processor share of the plant `mujoco`, with the default mesh and commands at 200 Hz.

The table has the CPU time of the plant's thread with an object pressed into the grip at home, with
rollers at rest and moving.
"""

from __future__ import annotations

from collections.abc import Iterator

from isotruss_ros.core import ConvexObject, load_robot, RollerFaults, tangent_center
from isotruss_ros.mujoco_plant.driven_robot import DrivenRobot
from isotruss_ros.mujoco_plant.options import PlantOptions
import numpy as np
from studies.benchmarks.measuring import SHARE, Table, timed

RATE, DURATION = 200.0, max(0.1, 5.0 * SHARE)
DIAMETER, SHIFT, FRICTION = 0.3, 0.02, 0.8
#: Speed of the rollers, to and fro [m/s].
SPEEDS = 0.02 * np.array([1.0, -1.0, 0.5, 0.3, -0.4, 0.2])


def driven(options: PlantOptions) -> DrivenRobot:
    """Return a robot in MuJoCo in contact with an object."""
    robot = load_robot('nine_member')
    center = tangent_center(robot.home, 'north/Z', DIAMETER, SHIFT)
    return DrivenRobot(robot, ConvexObject.disc(center, DIAMETER), False, options, RollerFaults())


def plant_row(name: str, options: PlantOptions, speeds: np.ndarray) -> list[str]:
    """Return the CPU time of a simulated second, and the longest cycle."""
    robot, cycles = driven(options), round(RATE * DURATION)
    times = []
    for k in range(cycles):
        robot.command(speeds if k < 0.5 * cycles else -speeds)
        times.append(timed(lambda: robot.advance(1.0 / RATE))[0])
    assert sum(force.normal > 0.0 for force in robot.plant.contact_forces().values()) == 2
    share = sum(times) / DURATION
    late = 1e3 * float(np.percentile(times, 99))
    return [name, str(robot.plant.model.nv), f'{share:.2f}', f'{1.0 / share:.1f}', f'{late:.1f}']


def tables() -> Iterator[Table]:
    """Yield the tables of the case."""
    still = np.zeros_like(SPEEDS)
    fine = PlantOptions(friction=FRICTION, segments=16)
    rows = [
        plant_row('at rest', PlantOptions(friction=FRICTION), still),
        plant_row('rollers moving', PlantOptions(friction=FRICTION), SPEEDS),
        plant_row('twice as many segments', fine, SPEEDS),
    ]
    header = (
        'plant',
        'coordinates',
        'core / simulated s',
        'times real time',
        '99 % of cycles [ms]',
    )
    yield Table('', header, rows)
