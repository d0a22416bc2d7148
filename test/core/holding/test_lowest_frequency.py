# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Lowest natural frequency of a held object against differences of equilibria."""

from dataclasses import replace
import gc
import weakref

from isotruss_ros.core import ConvexObject, deform, place_between, Polygon, Robot
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.held_shape import lowest_frequency
from isotruss_ros.core.holding.roll_grip import roll_grip
import numpy as np
import pytest
from robots import preset
import scipy.linalg
from skin_depths import contact_loads

FILE = preset('nine_member').description
BOX = Polygon([(-0.12, -0.1), (0.14, -0.1), (0.12, 0.1), (-0.12, 0.1)], 0.02)
MEMBERS = ('north/P-Z', 'north/Z-R')
STEP = 1e-3


def grip_of(module_mass, tube_mass, **options):
    """Return the equilibrium of a box of 2 kg between two tubes."""
    module = replace(FILE.module, mass=module_mass)
    robot = Robot(replace(FILE, module=module, mass_per_length=tube_mass))
    body = place_between(robot.home, MEMBERS, BOX, 0.4, 0.01).body
    return attach_grip(robot.home, ConvexObject(BOX, body.pose, mass=2.0, **options))


def moved_parts(grip, wrench):
    """Return the pose of an object, and the displacements of pinch points, under a wrench."""
    rolled = roll_grip(grip, grip.config, wrench)
    bent, points = deform(grip.config, {}, tube_loads=contact_loads(rolled)), {}
    for name in grip.config.robot.module_names:
        for node in 'BC':
            points[f'{name}/{node}'] = bent.displacement(f'{name}/{node}')[:2]
    return rolled.state.unknowns[:3], points


def frequency(grip):
    """Return the lowest frequency by differences of rolled equilibria, with masses at points."""
    robot, body, flexibility, columns = grip.config.robot, grip.body, [], []
    for unit in np.eye(3):
        (ahead, points), (behind, before) = (
            moved_parts(grip, sign * STEP * unit) for sign in (1.0, -1.0)
        )
        pose = (ahead - behind) / (2.0 * STEP)
        flexibility.append(pose)
        moved = {name: (points[name] - before[name]) / (2.0 * STEP) for name in points}
        own = body.shape.centroid if body.center_of_mass is None else complex(*body.center_of_mass)
        away = body.turn * own
        column = [np.sqrt(body.mass) * (pose[:2] + pose[2] * np.array([-away.imag, away.real]))]
        column.append(np.sqrt(body.mass) * body.shape.gyration * pose[2:])
        for name in robot.module_names:
            middle = 0.5 * (moved[f'{name}/B'] + moved[f'{name}/C'])
            column.append(np.sqrt(robot.description.module.mass) * middle)
        for name, length in zip(robot.member_names, grip.config.member_lengths, strict=True):
            tube, _, joints = name.partition('/')
            half = np.sqrt(0.5 * robot.description.mass_per_length * length)
            for joint, node in zip(joints.split('-'), 'BC', strict=True):
                column.append(half * moved[f'{tube}/{joint}/{node}'])
        columns.append(np.concatenate(column))
    energy, work = np.array(columns) @ np.array(columns).T, np.array(flexibility)
    return np.sqrt(scipy.linalg.eigvalsh(0.5 * (work + work.T), energy)[0])


@pytest.mark.parametrize(
    ('masses', 'options'),
    [((1.5, 0.6), {'center_of_mass': (0.05, -0.04)}), ((1e-9, 1e-9), {})],
    ids=['robot-off', 'object alone-even'],
)
def test_lowest_frequency_agrees_with_differences_of_equilibria(masses, options):
    grip = grip_of(*masses, **options)
    assert lowest_frequency(grip) == pytest.approx(frequency(grip), rel=1e-3)


def test_without_masses_there_is_no_lowest_frequency():
    grip = attach_grip(Robot(FILE).home, place_between(Robot(FILE).home, MEMBERS, BOX).body)
    assert lowest_frequency(grip) is None


def test_a_computed_frequency_keeps_no_grip_in_memory():
    grip = grip_of(1.5, 0.6)
    assert lowest_frequency(grip) > 0.0
    reference = weakref.ref(grip)
    del grip
    gc.collect()
    assert reference() is None
