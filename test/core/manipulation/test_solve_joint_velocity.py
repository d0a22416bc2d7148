# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Velocities of joints, without an object."""

from isotruss_ros.core import load_robot, solve_joint_velocity, Status
from isotruss_ros.core.errors import GraspError
import numpy as np
import pytest
import robots
from scipy.linalg import null_space

ROBOT = load_robot('nine_member')
HOME = ROBOT.home
VELOCITY = (0.01, -0.02)
PLACES = [ROBOT.topology.joint_names.index(joint) for joint in 'ZQ']


def moved(config, command, joint):
    """Return the velocity of a joint by the forward kinematics."""
    nodes = (config.node_jacobian @ command.roller_velocities).reshape(-1, 2)
    return nodes[ROBOT.topology.joint_names.index(joint)]


def test_joint_commands_have_the_least_cost():
    rng = np.random.default_rng(0)
    config = robots.random_state(ROBOT, rng)
    velocities = {'Z': VELOCITY, 'Q': (0.0, 0.01)}
    command = solve_joint_velocity(config, velocities)
    assert command.status is Status.OK
    assert command.scale == 1.0
    achieved = command.achieved_twist.reshape(-1, 2)
    for (joint, velocity), result in zip(velocities.items(), achieved, strict=True):
        assert moved(config, command, joint) == pytest.approx(velocity, abs=1e-10)
        assert result == pytest.approx(velocity, abs=1e-10)
    incidence = ROBOT.topology.incidence
    cost = np.linalg.norm(incidence @ command.roller_velocities)
    rows = np.stack(
        [unit.reshape(-1, 2)[PLACES].ravel() for unit in config.node_jacobian.T], axis=1
    )
    for direction in null_space(rows).T:
        for step in (-1e-3, 1e-3):
            other = command.roller_velocities + step * direction
            assert np.linalg.norm(incidence @ other) >= cost - 1e-12


def test_zero_is_idle_and_limits_scale():
    idle = solve_joint_velocity(HOME, {'Z': (0.0, 0.0)})
    assert idle.status is Status.IDLE
    assert not idle.roller_velocities.any()
    fast = solve_joint_velocity(HOME, {'Z': (5.0, -10.0)})
    assert fast.status is Status.SLOWED_ROLLER_SPEED
    assert np.abs(fast.roller_velocities).max() == pytest.approx(ROBOT.description.max_speed)
    expected = fast.scale * np.array([5.0, -10.0])
    assert moved(HOME, fast, 'Z') == pytest.approx(expected, rel=1e-6)


def test_a_grounded_joint_stays_and_failed_rollers_stand_still():
    command = solve_joint_velocity(HOME, {'X': (0.01, 0.02)})
    assert command.status is Status.UNREACHABLE
    assert moved(HOME, command, 'X') == pytest.approx(0.0, abs=1e-10)
    failed = ROBOT.roller_names[-1]
    command = solve_joint_velocity(HOME, {'Z': VELOCITY}, failed=(failed,))
    assert command.roller_velocities[-1] == 0.0
    assert moved(HOME, command, 'Z') == pytest.approx(command.achieved_twist)


@pytest.mark.parametrize(
    ('velocities', 'words'),
    [
        ({}, 'give one or more, of the joints P'),
        ({'W': VELOCITY}, "'W'"),
        ({'Z': (1.0,)}, 'joint Z'),
        ({'Z': (np.nan, 0.0)}, 'joint Z'),
    ],
)
def test_invalid_velocities_are_refused(velocities, words):
    with pytest.raises(GraspError, match=words):
        solve_joint_velocity(HOME, velocities)
