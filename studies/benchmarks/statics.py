# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Computing times of the analysis of a grasp, and their growth with the robot.

Grasps are at the top module of the nine-member preset, with contact points every 5 mm. A cold
analysis includes assembly, factorisation, contact, closure and wrinkling. A warm analysis is in
the same configuration with another pose of the object.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from isotruss_ros import core
from isotruss_ros.core.statics.structure import structure_of
import numpy as np
from studies.benchmarks.kinematics import unprepared
from studies.benchmarks.large_robots import nested_triangles, SIZES, top_module
from studies.benchmarks.measuring import median_time, part, Table, timed

STATES = part(500)
DIAMETER = 0.3
MODULE = 'north/Z'
#: Displacements of the object toward the corner [m].
DEPTHS = (0.002, 0.02)


def pressed(config: core.Configuration, module: str, depth: float) -> core.ConvexObject:
    """Return an object pressed toward the corner at a module."""
    robot = config.robot
    tangent = np.array(core.tangent_center(config, module, DIAMETER))
    pinch = [config.nodes[robot.node_names.index(f'{module}/{node}')] for node in 'BC']
    outward = np.mean(pinch, axis=0) - tangent
    return core.ConvexObject.disc(
        tuple(tangent + depth * outward / np.linalg.norm(outward)), DIAMETER
    )


def tables() -> Iterator[Table]:
    """Yield the tables of the case."""
    yield Table(f'{STATES} random states.', ('analysis', 'median [ms]', 'p99 [ms]'), grasp_rows())
    header = ('modules', 'displacements', 'cold [ms]', 'warm [ms]')
    yield Table('Growth with the robot.', header, growth_rows())


def grasp_rows() -> list[list[str]]:
    """Measure whole analyses of random states."""
    robot = core.load_robot('nine_member')
    random = np.random.default_rng(1)
    cold, warm = [], []
    for _ in range(STATES):
        config = robot.configuration(random.uniform(-0.15, 0.15, len(robot.roller_names)))
        cylinder = pressed(config, MODULE, random.uniform(*DEPTHS))
        cold.append(timed(partial(core.analyze_grasp, config, cylinder))[0])
        x, y, angle = cylinder.pose
        moved = cylinder.moved_to((x + 1e-4, y - 1e-4, angle))
        warm.append(timed(partial(core.analyze_grasp, config, moved))[0])
    return [
        [name, *(f'{1e3 * value:.2f}' for value in np.percentile(times, [50.0, 99.0]))]
        for name, times in (('cold', cold), ('warm', warm))
    ]


def growth_rows() -> list[list[str]]:
    """Measure the growth of the computing time with the robot, for the same contact."""
    rows = []
    for size in SIZES:
        description = nested_triangles(size)
        home = core.Robot(description).home
        cylinder = pressed(home, top_module(description), 0.01)

        def cold(
            home: core.Configuration = home, cylinder: core.ConvexObject = cylinder
        ) -> object:
            return core.analyze_grasp(unprepared(home), cylinder)

        times = (
            median_time(cold, 1.0),
            median_time(partial(core.analyze_grasp, home, cylinder), 1.0),
        )
        displacements = 3 * len(structure_of(home).node_names)
        rows.append([f'{size}', f'{displacements}', *(f'{1e3 * time:.2f}' for time in times)])
    return rows
