# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The analysis of a grasp: its contract, its parts against each other, refusals."""

import math

from grips import pressed_between, random_pressed
from hypothesis import given, strategies
from isotruss_ros.core import analyze_grasp, ConvexObject, deform, load_robot
from isotruss_ros.core.errors import GraspError
import numpy as np
import pytest
import robots

generators = robots.generators()


@pytest.fixture(scope='module')
def gripped():
    """Return a grasp of the nine-member robot whose two sides press by 10 mm."""
    return pressed_between(load_robot('nine_member'), 'north/Z', 0.5, 0.01)


@robots.examples(40)
@given(generators, strategies.floats(0.0, 1.5))
def test_wrench_forces_and_regions_are_consistent(rng, friction):
    config, cylinder = random_pressed(rng)
    size = 20.0 * 10.0 ** rng.uniform(-2.0, 0.0)
    external = rng.normal(size=3) * [size, size, size * cylinder.shape.diameter]
    analysis = analyze_grasp(config, cylinder, friction, external)
    forces, normals = analysis.normal_forces, analysis.normals
    assert forces.min() >= 0.0
    assert analysis.gaps.min() >= -1e-9
    assert (analysis.gaps * forces).max() <= 1e-9 * forces.max()
    # The tube pushes the object against the outward normals; all of them through its centre.
    arms = 0.5 * cylinder.shape.diameter * normals
    wrench = np.append(-forces @ normals, -np.cross(arms, forces[:, None] * normals).sum())
    assert analysis.normal_wrench == pytest.approx(wrench, abs=1e-9 * forces.sum())
    assert (np.abs(analysis.friction_forces) <= friction * forces * (1.0 + 1e-12)).all()
    # What is left when friction has acted at the object's surface is the residual.
    rubbing = analysis.friction_forces[:, None] * np.column_stack([-normals[:, 1], normals[:, 0]])
    total = wrench + external
    total += np.append(rubbing.sum(axis=0), np.cross(arms, rubbing).sum())
    total[2] /= 0.5 * cylinder.shape.diameter
    left = np.linalg.norm(total)
    slack = 1e-9 * (forces.sum() + np.abs(external).max())
    assert analysis.closure_residual == pytest.approx(left, abs=slack)
    assert analysis.closed_by_friction == (analysis.closure_residual <= analysis.closure_tolerance)


@robots.examples(20)
@given(generators)
def test_utilisation_agrees_with_the_linear_deformation_under_the_contact_forces(rng):
    config, cylinder = random_pressed(rng)
    analysis = analyze_grasp(config, cylinder, spacing=0.02)
    names, loads = config.robot.member_names, {}
    for k in np.flatnonzero(analysis.normal_forces > 0.0):
        x, y = analysis.normal_forces[k] * analysis.normals[k]
        loads.setdefault(names[analysis.members[k]], []).append((analysis.places[k], x, y, 0.0))
    expected = deform(config, {}, tube_loads=loads, paper_model=True).utilisation
    assert analysis.utilisation == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_nothing_is_closed_without_contact():
    config = load_robot('nine_member').home
    far = ConvexObject.disc((0.5, 30.0), 0.2)
    # Nothing has to be balanced, but nothing is held.
    assert not analyze_grasp(config, far).closed_by_friction
    for method in ('exact', 'relaxation'):
        pulled = analyze_grasp(config, far, external_wrench=(0, -1, 0), method=method)
        assert not pulled.closed_by_friction
        assert pulled.required_friction == math.inf
        assert pulled.closure_residual == pytest.approx(1.0)


def test_exact_and_relaxed_contact_agree(gripped):
    config, cylinder = gripped
    exact = analyze_grasp(config, cylinder, external_wrench=(0, -2, 0))
    relaxed = analyze_grasp(config, cylinder, external_wrench=(0, -2, 0), method='relaxation')
    size = exact.normal_forces.sum()
    assert relaxed.normal_forces == pytest.approx(exact.normal_forces, abs=1e-4 * size)
    assert relaxed.gaps == pytest.approx(exact.gaps, abs=1e-8)
    assert relaxed.required_friction == pytest.approx(exact.required_friction, rel=1e-3)


def test_contact_lengths_include_half_a_spacing_beyond_the_outermost_points(gripped):
    config, cylinder = gripped
    analysis = analyze_grasp(config, cylinder, spacing=0.005)
    assert len(analysis.contact_lengths) == 2
    for name, length in analysis.contact_lengths.items():
        on_member = analysis.members == config.robot.member_names.index(name)
        forces, places = analysis.normal_forces[on_member], analysis.places[on_member]
        assert length == pytest.approx(np.ptp(places[forces > 0.0]) + 0.005)
        assert forces[0] == forces[-1] == 0.0  # candidates beyond the contact


@pytest.mark.parametrize('pressures', [[30e3, 25e3, 20e3], {'east': 25e3, 'south': 30e3}])
def test_measured_pressures_agree_with_a_robot_file_of_these_pressures(gripped, pressures):
    config, cylinder = gripped
    document = robots.preset_document('nine_member')
    north = 20e3 if isinstance(pressures, list) else config.robot.description.pressures['north']
    document['tube']['pressure'] = {'south': 30e3, 'east': 25e3, 'north': north}
    expected = analyze_grasp(robots.load(document).home, cylinder)
    measured = analyze_grasp(config, cylinder, pressure=pressures)
    np.testing.assert_array_equal(measured.normal_forces, expected.normal_forces)


@pytest.mark.parametrize('degrees', [26.0, 60.0])
def test_required_friction_of_a_wedge_is_the_tangent_of_half_its_angle(degrees):
    half = np.radians(0.5 * degrees)
    document = robots.example()
    document['joints'] = {
        'P': [-1.5 * np.sin(half), -1.5 * np.cos(half)],
        'Q': [1.5 * np.sin(half), -1.5 * np.cos(half)],
        'X': [0.0, 0.0],
    }
    # Supports that mirror: the object is pressed down, along the middle.
    document['supports'] = {'X': ['x'], 'P': ['y'], 'Q': ['y']}
    document['tube']['diameter'] = 0.05
    document['module'].update(pinch_separation=0.06, rod_length=0.05)
    robot = robots.load(document)
    b, b_end, c, c_end = robots.side_ends(robot.home, 'south/X')
    opening = abs(np.angle((b_end - b) / (c_end - c)))
    # The sides run from pinch point to pinch point, nearly from joint to joint.
    assert np.degrees(opening) == pytest.approx(degrees, abs=6.0)
    config, cylinder = pressed_between(robot, 'south/X', 0.5, 1e-5)
    analysis = analyze_grasp(config, cylinder, friction=1.0)
    # Both sides press alike, downward.
    forces = analysis.normal_forces
    assert analysis.normal_wrench[0] == pytest.approx(0.0, abs=1e-6 * forces.sum())
    assert analysis.normal_wrench[1] < 0.0
    assert analysis.closed_by_friction
    assert analysis.required_friction == pytest.approx(np.tan(0.5 * opening), rel=1e-4)


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        ({'friction': math.nan}, 'friction'),
        ({'friction': -0.1}, 'must be from 0 to 10'),
        ({'spacing': 9.9e-5}, 'spacing'),
        ({'method': 'guess'}, 'exact, relaxation'),
        ({'external_wrench': (0.0, math.inf, 0.0)}, 'wrench'),
    ],
)
def test_invalid_arguments_are_refused(gripped, options, message):
    config, cylinder = gripped
    with pytest.raises(GraspError, match=message):
        analyze_grasp(config, cylinder, **options)
