# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The robots that come with the package."""

from isotruss_ros import core
from isotruss_ros.core.model.presets import preset_names
import numpy as np
import pytest

#: Number of rollers, and a module whose grip moves an object in this many directions.
PRESETS = {
    'bow_tie': (4, 'upper/D', 3),
    'nine_member': (6, 'north/Z', 3),
    'open_chain': (6, 'right/G', 2),
    'ring_of_four': (8, 'north/T', 3),
    'triangle': (2, 'main/T', 1),
}


def test_all_presets_are_tested():
    assert preset_names() == sorted(PRESETS)


@pytest.mark.parametrize('name', PRESETS)
def test_a_preset_is_rigid_and_each_roller_moves_it(name):
    robot = core.load_robot(name)
    rollers, _, _ = PRESETS[name]
    assert np.linalg.matrix_rank(robot.home.node_jacobian) == len(robot.roller_names) == rollers
    top = robot.topology.joint_names[-1]
    assert np.isfinite(core.deform(robot.home, {top: (1.0, -1.0)}).displacement(top)).all()


@pytest.mark.parametrize('name', PRESETS)
def test_a_preset_moves_an_object(name):
    robot = core.load_robot(name)
    _, module, directions = PRESETS[name]
    body = core.ConvexObject.disc(core.tangent_center(robot.home, module, 0.3), 0.3)
    grip = core.Grip.at_module(robot, module, body)
    twists = core.reachable_twists(robot.home, grip)
    assert len(twists) == directions
    assert core.solve_twist(robot.home, grip, 0.01 * twists[0]).status is core.Status.OK
