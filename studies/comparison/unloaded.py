# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes without loads, compared with forward kinematics (3), (12), (13)."""

from __future__ import annotations

from isotruss_ros.core import load_robot
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
from pressed_plants import mesh, move_to
from studies.comparison.section import Check, Section
from studies.paper.tables import number, Table

#: Presets with random configurations.
ROBOTS = ('nine_member', 'triangle')
#: Largest travel of a roller [m], and rest after it [s].
TRAVEL, REST = 0.15, 4.0
MICROMETRE = 1e-6


def compare(shapes: int = 3) -> Section:
    """
    Compare the nodes of two presets in random configurations.

    :param shapes: number of configurations of each preset.
    """
    rows, worst = [], 0.0
    for name in ROBOTS:
        robot, random = load_robot(name), np.random.default_rng(3)
        plant, errors, way = MujocoPlant(robot, segments=mesh(robot, [])), [], 0.0
        for _ in range(shapes):
            travel = TRAVEL * random.uniform(-1.0, 1.0, len(robot.roller_names))
            move_to(plant, travel)
            plant.settle(REST)
            nodes = robot.configuration(travel).nodes
            errors.append(float(np.abs(plant.nodes - nodes).max()))
            way = max(way, float(np.abs(nodes - robot.home.nodes).max()))
        worst = max(worst, *errors)
        rows.append((name, str(shapes), number(way), number(max(errors) / MICROMETRE, 2)))
    check = Check(
        'unloaded nodes',
        worst / MICROMETRE,
        1.0,
        'µm',
        'the motion of soft members decays slowly by drag and losses',
    )
    return Section(
        'Unloaded nodes',
        f'Rollers travel at random, up to {TRAVEL:g} m. MuJoCo moves the robot to each '
        'configuration; `Robot.configuration` computes it directly.',
        (check,),
        (
            Table(
                'unloaded',
                'Largest difference of a coordinate of any node',
                ('robot', 'shapes', 'farthest from home [m]', 'difference [µm]'),
                rows,
                shown=False,
            ),
        ),
    )
