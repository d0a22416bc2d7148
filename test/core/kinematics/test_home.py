# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The robot at home: names, modules that bisect, and rigidity with locked rollers."""

from isotruss_ros.core import load_robot
from isotruss_ros.core.errors import RobotFileError
from isotruss_ros.core.kinematics.rigidity import rigidity_index
import numpy as np
import pytest
import robots
from robots import refusal


def pinched(opening, module):
    """Return an isosceles triangle with this angle [deg] at its top, and this module."""
    document = robots.example()
    half = np.deg2rad(0.5 * opening)
    document['joints'] = {'P': [-np.sin(half), 0], 'Q': [np.sin(half), 0], 'X': [0, np.cos(half)]}
    document['module'].update(module, guide_ring_distance=0.001)
    document['members'] = {'min_length': 1e-3, 'max_length': 10.0}
    return document


@pytest.mark.parametrize(
    ('opening', 'size', 'message'),
    [
        # The rod at the blunt top is longer than the triangle is high: its end comes out below.
        (150.0, {'pinch_separation': 0.1, 'rod_length': 0.25}, 'leave it at -.* must be more'),
        # The modules at the short base are wider than it.
        (10.0, {'pinch_separation': 0.1, 'rod_length': 0.1}, 'no angle of its rod bisects'),
        (0.95, {'pinch_separation': 1e-5, 'rod_length': 1e-3}, '0.95 degrees; must be between 1'),
    ],
)
def test_module_that_does_not_fit_its_corner_is_refused(opening, size, message):
    with pytest.raises(RobotFileError, match=f'does not fit its corner: .*{message}'):
        robots.load(pinched(opening, size))


def slender_example():
    """Return the document of a small robot whose modules fit where they are close together."""
    document = robots.example()
    document['module']['pinch_separation'], document['tube']['diameter'] = 0.05, 0.02
    return document


@pytest.mark.parametrize(
    ('supports', 'message'),
    [
        ({'P': ['x', 'y']}, 'supports: too few: 2 grounded coordinates; must be 3'),
        ({'P': ['x', 'y'], 'Q': ['x', 'y']}, 'supports: too many: 4 grounded coordinates'),
        ({'P': ['y'], 'Q': ['y'], 'X': ['y']}, 'these joints can still move: P, Q, X'),
        # Q can only move at a right angle to PQ: along y, which grounding its x does not stop.
        ({'P': ['x', 'y'], 'Q': ['x']}, 'rollers locked: these joints can still move: Q, X'),
    ],
)
def test_supports_that_do_not_hold_the_robot_are_refused(supports, message):
    document = robots.example()
    document['supports'] = supports
    assert message in refusal(document)


def test_only_moving_joints_of_a_mechanism_are_named():
    document = slender_example()
    # A second triangle that hangs on one joint of the first, and turns about it.
    document['joints'].update({'U': [2.0, 0.0], 'V': [1.6, 0.9]})
    document['tubes']['loose'] = {'joints': ['Q', 'U', 'V'], 'passive': 'U'}
    assert 'these joints can still move: U, V; 1 more members or supports' in refusal(document)
    document['supports']['U'] = ['y']
    robots.load(document)


def test_hinges_in_line_are_refused():
    # A three-hinged arch whose hinges are in line moves a little, whatever its lengths.
    document = slender_example()
    document['members']['min_length'] = 0.2
    document['joints'].update({'H': [0.5, 0.0], 'U': [0.25, -0.45], 'V': [0.75, -0.45]})
    document['tubes']['left'] = {'joints': ['P', 'H', 'U'], 'passive': 'U'}
    document['tubes']['right'] = {'joints': ['Q', 'H', 'V'], 'passive': 'V'}
    message = refusal(document)
    assert 'can still move: H, U, V' in message
    document['joints'].update({'H': [0.5, -0.3], 'U': [0.15, -0.6], 'V': [0.85, -0.6]})
    robots.load(document)


def scaled_matrix(config):
    """Return the matrix of (12), its rows of angles times the rod length."""
    m, matrix = config.robot.topology.n_modules, robots.dense_matrix(config)
    matrix[slice(4 * m, 5 * m)] *= config.robot.description.module.rod_length
    return matrix


def least_singular_value(config):
    """Return the smallest singular value of that matrix."""
    return np.linalg.svd(scaled_matrix(config), compute_uv=False)[-1]


@pytest.mark.parametrize('case', [*robots.PRESETS, 0, 1, 2])
def test_modes_agree_with_a_singular_value_decomposition(case):
    robot = load_robot(case) if isinstance(case, str) else robots.random_robot(case)
    measure = rigidity_index(robot)
    rng = np.random.default_rng(1)
    for _ in range(3):
        config = robots.random_state(robot, rng, 0.1)
        modes = measure.modes(config)
        expected = least_singular_value(config) / least_singular_value(robot.home)
        assert modes.values[0] == pytest.approx(expected, rel=1e-5)
