"""How far shapes are from trouble: against a full decomposition and brute-force distances."""

from hypothesis import given
from isotruss_ros.core import (
    ConfigurationError,
    Cylinder,
    GraspError,
    load_robot,
    shape_margins,
    snug_center,
)
import numpy as np
import pytest
import robots


def rigidity(config):
    """Return the smallest singular value of (12), bisection rows times the rod length."""

    def smallest(config):
        m = len(config.robot.member_names)
        matrix = config.matrix.copy()
        bisection = slice(4 * m, 5 * m)
        matrix[bisection] *= config.robot.description.module.rod_length
        return np.linalg.svd(matrix, compute_uv=False)[-1]

    return smallest(config) / smallest(config.robot.home)


@robots.examples(40)
@given(robots.robots(), robots.generators())
def test_rigidity_is_the_smallest_singular_value(robot, rng):
    try:
        config = robots.random_state(robot, rng, reach=rng.uniform(0.0, 0.3))
    except ConfigurationError:
        return
    assert shape_margins(config).rigidity == pytest.approx(rigidity(config), rel=2e-3)


@pytest.mark.parametrize('name', robots.PRESETS)
def test_presets_are_well_inside_at_home(name):
    margins = shape_margins(load_robot(name).home)
    assert margins.rigidity == pytest.approx(1.0)
    assert margins.clearance > 0.5
    assert margins.object_clearance == np.inf


def test_object_that_lies_free_and_that_is_held():
    robot = load_robot('nine_member')
    cylinder = Cylinder(snug_center(robot.home, 'north/Z', 0.3), 0.3)
    held = shape_margins(robot.home, cylinder, 'north/Z')
    free = shape_margins(robot.home, cylinder)
    # It touches both sides: that is what the grip is for. The joint behind it is not.
    assert free.object_clearance == pytest.approx(0.0, abs=1e-9)
    assert free.nearest_to_object.startswith('member north/')
    joint = robot.home.nodes[robot.node_names.index('Z')]
    assert held.object_clearance == pytest.approx(
        np.hypot(*(joint - cylinder.center)) - 0.15, abs=1e-9
    )
    assert held.nearest_to_object == 'module north/Z'
    with pytest.raises(GraspError, match='no such module'):
        shape_margins(robot.home, cylinder, 'north/X')
