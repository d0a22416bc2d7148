# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Drawn lines, record and lowest frequency of a held object."""

from dataclasses import replace
import gc
import weakref

from held_grips import APART, BOX, CORNER, held, HOME
from isotruss_ros import core
from isotruss_ros.core.errors import GraspError, StructureError
from isotruss_ros.core.holding import held_shape
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.grip_record import GripRecord
from isotruss_ros.core.holding.roll_grip import roll_grip, with_pressures
from isotruss_ros.core.kinematics.depths import member_lines
import numpy as np
import pytest
from robots import preset
import scipy.linalg
from skin_depths import contact_loads

ROBOT = preset('nine_member')
DIAMETER = 0.3


@pytest.fixture(params=[0.0, 0.1], ids=['home', 'elsewhere'])
def grip(request):
    """Return the equilibrium of a disc, at home and in another configuration."""
    travel = request.param * np.linspace(-1.0, 1.0, len(ROBOT.roller_names))
    config = ROBOT.configuration(travel)
    center = core.tangent_center(config, 'north/Z', DIAMETER, 0.01)
    body = core.ConvexObject.disc(center, DIAMETER)
    return core.settle_grasp(config, body, 2.0, (0.5, -0.3, 0.0)).equilibrium


def test_drawn_ends_of_members_agree_with_the_deformation_under_the_contact_forces(grip):
    deformed = core.deform(grip.config, {}, tube_loads=contact_loads(grip))
    lines, straight = held_shape.deformed_lines(grip), member_lines(grip.config)
    for name, line, ends in zip(ROBOT.member_names, lines, straight, strict=True):
        tube, _, joints = name.partition('/')
        for joint, node, drawn, before in zip(
            joints.split('-'), 'BC', line[[0, -1]], ends, strict=True
        ):
            moved = deformed.displacement(f'{tube}/{joint}/{node}')[:2] @ (1.0, 1.0j)
            assert drawn - before == pytest.approx(moved, abs=1e-8)


def test_force_arrows_end_on_the_object_and_are_in_balance(grip):
    arrows = held_shape.force_lines(grip, 0.02)
    center = complex(*grip.pose[:2])
    assert np.abs(arrows[:, 1] - center) == pytest.approx(0.5 * DIAMETER)
    forces = np.diff(arrows)[:, 0] / 0.02
    assert forces.sum() == pytest.approx(-0.5 + 0.3j, abs=1e-8)
    assert np.abs(forces) == pytest.approx(np.hypot(grip.normal_forces, grip.friction_forces))


def test_regions_are_on_the_object_and_as_long_as_the_contact(grip):
    regions = held_shape.region_lines(grip)
    assert np.abs(regions - complex(*grip.pose[:2])) == pytest.approx(0.5 * DIAMETER)
    lengths = np.abs(np.diff(regions)).sum(axis=1)
    assert lengths == pytest.approx(grip.patches.lengths, rel=0.03)


FILE = preset('nine_member').description
TRAPEZOID = core.Polygon([(-0.12, -0.1), (0.14, -0.1), (0.12, 0.1), (-0.12, 0.1)], 0.02)
STEP = 1e-3


def grip_of(module_mass, tube_mass, **options):
    """Return the equilibrium of a box of 2 kg between two tubes."""
    module = replace(FILE.module, mass=module_mass)
    robot = core.Robot(replace(FILE, module=module, mass_per_length=tube_mass))
    config = robot.configuration(0.1 * np.linspace(-1.0, 1.0, 6))
    body = core.place_between(config, CORNER, TRAPEZOID, 0.4, 0.01).body
    return attach_grip(config, core.ConvexObject(TRAPEZOID, body.pose, mass=2.0, **options))


def moved_parts(grip, wrench):
    """Return the pose of an object, and the displacements of pinch points, under a wrench."""
    rolled = roll_grip(grip, grip.config, wrench)
    bent, points = core.deform(grip.config, {}, tube_loads=contact_loads(rolled)), {}
    for name in grip.config.robot.module_names:
        for node in 'BC':
            points[f'{name}/{node}'] = bent.displacement(f'{name}/{node}')[:2]
    return rolled.state.unknowns[:3], points


def frequency(grip):
    """Return the lowest frequency by differences of rolled equilibria, with masses at points."""
    robot, body, flexibility, columns = grip.config.robot, grip.body, [], []
    for unit in np.eye(3):
        ends = (moved_parts(grip, sign * STEP * unit) for sign in (1.0, -1.0))
        (ahead, points), (behind, before) = ends
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
    assert held_shape.lowest_frequency(grip) == pytest.approx(frequency(grip), rel=1e-3)


def test_without_masses_there_is_no_lowest_frequency():
    home = core.Robot(FILE).home
    grip = attach_grip(home, core.place_between(home, CORNER, TRAPEZOID).body)
    assert held_shape.lowest_frequency(grip) is None


def test_a_computed_frequency_keeps_no_grip_in_memory():
    grip = grip_of(1.5, 0.6)
    assert held_shape.lowest_frequency(grip) > 0.0
    reference = weakref.ref(grip)
    del grip
    gc.collect()
    assert reference() is None


TRAVEL = [0.0012, -0.002, 0.0008, 0.0016, 0.0004, -0.0008]
PRESSURES = (30e3, 31e3, 32e3)


@pytest.mark.parametrize(
    ('shape', 'angle', 'pressures'),
    [(core.Disc(0.3), 0.4, None), (BOX, 0.2, None), (BOX, 0.0, None), (BOX, 0.2, PRESSURES)],
)
def test_restored_grip_has_the_margins_of_the_original_and_rolls_as_it(shape, angle, pressures):
    grip = with_pressures(held(shape, angle, APART), pressures)
    for _ in range(4):  # so that its friction is not that of unknown history
        there = grip.config.roller_positions + TRAVEL
        grip = roll_grip(grip, grip.config.moved_to(there))
    restored = GripRecord.of(grip).restore(HOME, grip.body)
    assert restored.pressures == pytest.approx(grip.pressures)
    assert restored.pose == pytest.approx(grip.pose, abs=1e-12)
    assert restored.state.forces == pytest.approx(grip.state.forces, abs=1e-9)
    expected = held_shape.held_joints(grip)
    assert held_shape.held_joints(restored) == pytest.approx(expected, abs=1e-9)
    assert restored.sections.used == pytest.approx(grip.sections.used, abs=1e-5)
    assert restored.slip_margin(0.5) == pytest.approx(grip.slip_margin(0.5), rel=1e-3)
    there = grip.config.moved_to(grip.config.roller_positions + 0.003)
    original, copy = roll_grip(grip, there), roll_grip(restored, there)
    assert copy.pose == pytest.approx(original.pose, abs=1e-5)
    assert copy.squeeze == pytest.approx(original.squeeze, rel=1e-3)


def test_record_of_another_structure_or_object_is_refused():
    grip = held(BOX, 0.2, APART)
    record = GripRecord.of(grip)
    with pytest.raises(StructureError, match='must be 203'):
        record._replace(bent=record.bent[1:]).restore(HOME, grip.body)
    record.contacts.corners[:] = 7
    with pytest.raises(GraspError, match='no such corners'):
        record.restore(grip.config, grip.body)
