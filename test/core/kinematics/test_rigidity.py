"""The worst-case rigidity index: by hand, by the definition, and what it does not depend on."""

from hypothesis import given
from isotruss_ros.core import load_robot, worst_case_rigidity_index
import numpy as np
import pytest
import robots


def by_definition(config):
    """Return it from the bars by name, without complex numbers."""
    place = dict(zip(config.robot.node_names, config.nodes, strict=True))
    joints = config.robot.topology.joint_names
    rows = []
    for name in config.robot.member_names:
        one, other = name.split('/')[1].split('-')
        row = np.zeros((len(joints), 2))
        row[joints.index(one)] = place[one] - place[other]
        row[joints.index(other)] = place[other] - place[one]
        rows.append(row.ravel())
    matrix = np.array(rows)
    gains = np.linalg.svd(matrix, compute_uv=False)
    # Of 2 J coordinates three belong to rigid motions.
    gains = np.append(gains, np.zeros(max(0, 2 * len(joints) - len(gains))))
    return gains[2 * len(joints) - 4] ** 2 / np.trace(matrix.T @ matrix)


def test_equilateral_triangle_is_that_by_hand():
    # R R^T has 2 L^2 on its diagonal and L^2 cos 60 beside it: eigenvalues 3, 1.5 and 1.5 L^2.
    assert worst_case_rigidity_index(load_robot('triangle').home) == pytest.approx(0.25)


def test_nine_member_robot_has_the_stated_number():
    assert worst_case_rigidity_index(load_robot('nine_member').home) == pytest.approx(
        0.0318305, abs=1e-6
    )


@robots.examples(25)
@given(robots.robots(), robots.generators())
def test_it_is_what_its_definition_says(robot, rng):
    config = robots.random_state(robot, rng)
    assert worst_case_rigidity_index(config) == pytest.approx(by_definition(config), abs=1e-12)


@robots.examples(10)
@given(robots.robots(('arch',)), robots.generators())
def test_it_does_not_depend_on_size_place_or_orientation(robot, rng):
    config = robots.random_state(robot, rng)
    points = config.points * 3.0 * np.exp(1j) + (2.0 - 5.0j)
    moved = type(config)(robot, config.roller_positions, points)
    assert worst_case_rigidity_index(moved) == pytest.approx(worst_case_rigidity_index(config))


def test_polygon_without_its_supports_is_not_rigid():
    robot = robots.random_robot(3, 'polygon', 5)
    assert worst_case_rigidity_index(robot.home) == pytest.approx(0.0, abs=1e-12)
