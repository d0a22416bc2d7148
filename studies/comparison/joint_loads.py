# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Displacements under loads at joints, compared with `deform` (1), (2), (4)."""

from __future__ import annotations

from isotruss_ros.core import Configuration, deform
from isotruss_ros.core.safety.margins import shape_margins
from isotruss_ros.mujoco_plant.plant import MujocoPlant
import numpy as np
from pressed_plants import mesh, move_to, round_robot, STILL
from studies.comparison.section import Check, Section
from studies.paper.tables import number, Table

#: Loads that are applied to each free joint [N].
SMALL, LARGE = (0.05, 0.03), (2.0, 1.2)
#: Largest roller travel of random configurations [m], and number of them [-].
TRAVEL, TRIALS = 0.25, 60
#: Rest after a motion and after a load [s].
REST = 4.0


def compare(soft: int = 2) -> Section:
    """
    Compare displacements at home and in soft configurations.

    :param soft: number of soft configurations.
    """
    robot = round_robot()
    topology = robot.topology
    held = {int(place) // 2 for place in topology.grounded}
    free = [name for node, name in enumerate(topology.joint_names) if node not in held]
    rows, worst = [], 0.0
    for label, config in [('home', robot.home), *_soft_shapes(soft)]:
        plant = MujocoPlant(robot, None, STILL, mesh(robot, []))
        if config is not robot.home:
            move_to(plant, config.roller_positions)
            plant.settle(REST)
        before = plant.nodes
        for joint in free:
            off, most = _difference(plant, config, joint, SMALL, before)
            large, _ = _difference(plant, config, joint, LARGE, before)
            worst = max(worst, off, large)
            rigidity = number(shape_margins(config).rigidity, 2)
            give = number(1e3 * most / np.hypot(*SMALL), 3)
            cells = (number(100.0 * off, 2), number(100.0 * large, 2))
            rows.append((label, rigidity, joint, give, *cells))
    check = Check(
        'displacements under joint loads',
        100.0 * worst,
        0.2,
        '%',
        "MuJoCo's tubes bend only between segments",
    )
    small, large = np.hypot(*SMALL), np.hypot(*LARGE)
    return Section(
        'Displacements under joint loads',
        f'A force of {small:.2g} N, then a force of {large:.2g} N, acts on each joint.',
        (check,),
        (
            Table(
                'joint_loads',
                'All shapes, joints and differences',
                (
                    'shape',
                    'rigidity index',
                    'joint',
                    'largest give [mm/N]',
                    'small load [%]',
                    'large load [%]',
                ),
                rows,
                shown=False,
            ),
        ),
    )


def _soft_shapes(count: int) -> list[tuple[str, Configuration]]:
    """Return the softest of some random configurations of the robot."""
    robot, random = round_robot(), np.random.default_rng(0)
    found = []
    for _ in range(TRIALS):
        travel = TRAVEL * random.uniform(-1.0, 1.0, len(robot.roller_names))
        config = robot.configuration(travel)
        margins = shape_margins(config)
        if margins.clearance > 0.0:
            found.append((margins.rigidity, config))
    found.sort(key=lambda pair: pair[0])
    return [(f'soft {k + 1}', config) for k, (_, config) in enumerate(found[:count])]


def _difference(
    plant: MujocoPlant,
    config: Configuration,
    joint: str,
    load: tuple[float, float],
    before: np.ndarray,
) -> tuple[float, float]:
    """Return the relative difference of the displacements, and the largest displacement [m]."""
    plant.load_joint(joint, load)
    plant.settle(REST)
    expected = deform(config, {joint: load})
    moved = np.array([expected.displacement(node)[:2] for node in config.robot.node_names])
    found = plant.nodes - before
    plant.load_joint(joint, (0.0, 0.0))
    plant.settle(REST)
    most = float(np.abs(moved).max())
    return float(np.abs(found - moved).max()) / most, most
