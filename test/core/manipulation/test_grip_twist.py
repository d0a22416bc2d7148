# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Roller velocities for an object between any members, or for joints without an object."""

from dataclasses import replace

from grips import surface
from hypothesis import assume, given
from hypothesis import strategies as st
from isotruss_ros import core
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.manipulation.grip_rows import contact_rows, grip_jacobian
import numpy as np
import pytest
import random_grips
import robots
from scipy.linalg import null_space

NINE = core.load_robot('nine_member')
KINDS = (('module', 2), ('tube', 2), ('tubes', 2), ('module', 3), ('tubes', 3))


def motions(config, grip, failed):
    """Return all (rollers, twist) that keep the constraint, as columns, in speeds [m/s]."""
    hand, rigid = contact_rows(config, grip)
    stuck = [config.robot.roller_names.index(name) for name in failed]
    still = np.eye(hand.shape[1] + 3)[stuck]
    return null_space(np.vstack([np.hstack([hand, -rigid / surface(grip)]), still]), rcond=1e-9)


def some_failed(robot, rng):
    return [name for name in robot.roller_names if rng.random() < rng.choice([0.0, 0.3])]


def least_cost(config, grip, twist, failed):
    """Return the twist that is nearest of those that keep the contacts, and its rollers (11)."""
    rollers, twists = np.split(motions(config, grip, failed), [len(config.roller_positions)])
    if np.abs(twists).max(initial=0.0) < 1e-10:  # zero but for rounding
        return np.zeros(len(rollers)), np.zeros(3)
    target = surface(grip) * twist
    share = np.linalg.lstsq(twists, target, rcond=1e-9)[0]
    still = null_space(twists, rcond=1e-9)
    incidence = config.robot.topology.incidence
    if still.shape[1]:
        free = incidence @ rollers @ still
        share = share - still @ np.linalg.lstsq(free, incidence @ rollers @ share, rcond=1e-9)[0]
    return rollers @ share, twists @ share / surface(grip)


def well_posed(config, grip, failed=()):
    """Return whether no motion is nearly singular."""
    _, twists = np.split(motions(config, grip, failed), [len(config.roller_positions)])
    if twists.shape[1] == 0:
        return True
    gains = np.linalg.svd(twists, compute_uv=False)
    working = [name not in failed for name in config.robot.roller_names]
    kept = np.linalg.svd(grip_jacobian(config, grip)[3:, working], compute_uv=False)
    return all(np.all((g > 1e-2) | (g < 1e-10)) for g in (gains, kept))


@pytest.mark.parametrize(('kind', 'count'), KINDS)
@robots.examples(15)
@given(st.data(), robots.generators())
def test_reachable_twists_are_those_that_keep_the_contacts(kind, count, data, rng):
    robot = data.draw(random_grips.robots_with(kind))
    config, grip = random_grips.random_grip(robot, rng, kind, count)
    failed = some_failed(robot, rng)
    assume(grip is not None and well_posed(config, grip, failed))
    basis = core.reachable_twists(config, grip, failed) * surface(grip)
    _, twists = np.split(motions(config, grip, failed), [len(config.roller_positions)])
    # Where no motion keeps the contacts, twists are zero but for rounding.
    directions, sizes, _ = np.linalg.svd(twists, full_matrices=False)
    reached = directions[:, sizes > 1e-6]
    wanted = reached @ reached.T
    assert basis.T @ basis == pytest.approx(wanted, abs=1e-9)
    assert basis @ basis.T == pytest.approx(np.eye(len(basis)), abs=1e-12)
    for twist in basis / surface(grip):
        command = core.solve_twist(config, grip, twist, failed, limits=())
        assert command.status is core.Status.OK
        assert command.reachable_dof == len(basis)
    for twist in null_space(basis).T / surface(grip) if len(basis) else ():
        command = core.solve_twist(config, grip, twist, failed, limits=())
        assert command.status is core.Status.UNREACHABLE
        assert not command.roller_velocities.any()
    assert core.solve_twist(config, grip, np.zeros(3), failed).reachable_dof == len(basis)


@pytest.mark.parametrize(
    ('flat', 'kind', 'count'),
    [(flat, *kind) for flat in (None, False, True) for kind in KINDS if not flat or kind[1] == 2],
)
@robots.examples(10)
@given(st.data(), robots.generators())
def test_rollers_are_those_of_the_least_cost_that_keep_the_contacts(flat, kind, count, data, rng):
    """Of discs, of any shapes, and of polygons on a face."""
    robot = data.draw(random_grips.robots_with(kind))
    config, grip = random_grips.random_convex_grip(robot, rng, kind, count, flat)
    failed = some_failed(robot, rng)
    assume(grip is not None and well_posed(config, grip, failed))
    grip = replace(grip, friction=0.0)  # a polygon does not roll off its face
    twist = rng.standard_normal(3) / surface(grip)
    command = core.solve_twist(config, grip, twist, failed, limits=())
    rollers, nearest = least_cost(config, grip, twist, failed)
    size = max(1.0, np.abs(rollers).max())
    missed = np.abs(surface(grip) * (nearest - twist)).max()
    assert command.scale == 1.0
    if flat is None:
        assert command.status is (core.Status.OK if missed < 1e-9 else core.Status.UNREACHABLE)
    assert command.roller_velocities == pytest.approx(rollers, abs=1e-8 * size)
    expected = nearest * surface(grip)
    assert command.achieved_twist * surface(grip) == pytest.approx(expected, abs=1e-8 * size)


def test_three_members_open_alike_by_half_of_the_opening_rate():
    rng = np.random.default_rng(0)
    opened = 0
    for _ in range(20):
        config, grip = random_grips.random_grip(NINE, rng, 'tubes', 3)
        if grip is None:
            continue
        assert core.solve_twist(config, grip, np.zeros(3)).status is core.Status.IDLE
        if np.linalg.svd(grip_jacobian(config, grip), compute_uv=False)[-1] < 1e-2:
            continue
        command = core.solve_twist(config, grip, np.zeros(3), limits=(), opening_rate=0.01)
        hand, rigid = contact_rows(config, grip)
        speeds = hand @ command.roller_velocities
        # Without what would carry the object along.
        away = 0.005 * random_grips.contacts_of(config, grip).normals.view(float)
        away -= rigid @ np.linalg.lstsq(rigid, away, rcond=None)[0]
        assert speeds == pytest.approx(away, abs=1e-9)
        opened += 1
    assert opened > 2


HOME = NINE.home
VELOCITY = (0.01, -0.02)
PLACES = [NINE.topology.joint_names.index(joint) for joint in 'ZQ']


def moved(config, command, joint):
    """Return the velocity of a joint by the forward kinematics."""
    nodes = (config.node_jacobian @ command.roller_velocities).reshape(-1, 2)
    return nodes[NINE.topology.joint_names.index(joint)]


def test_joint_commands_have_the_least_cost():
    rng = np.random.default_rng(0)
    config = robots.random_state(NINE, rng)
    velocities = {'Z': VELOCITY, 'Q': (0.0, 0.01)}
    command = core.solve_joint_velocity(config, velocities)
    assert command.status is core.Status.OK
    assert command.scale == 1.0
    achieved = command.achieved_twist.reshape(-1, 2)
    for (joint, velocity), result in zip(velocities.items(), achieved, strict=True):
        assert moved(config, command, joint) == pytest.approx(velocity, abs=1e-10)
        assert result == pytest.approx(velocity, abs=1e-10)
    incidence = NINE.topology.incidence
    rows = np.stack([c.reshape(-1, 2)[PLACES].ravel() for c in config.node_jacobian.T], axis=1)
    # The cost does not change to first order along motions that keep the velocities.
    gradient = incidence.T @ incidence @ command.roller_velocities
    assert gradient @ null_space(rows) == pytest.approx(0.0, abs=1e-9)


def test_zero_is_idle_and_limits_scale():
    idle = core.solve_joint_velocity(HOME, {'Z': (0.0, 0.0)})
    assert idle.status is core.Status.IDLE
    assert not idle.roller_velocities.any()
    fast = core.solve_joint_velocity(HOME, {'Z': (5.0, -10.0)})
    assert fast.status is core.Status.SLOWED_ROLLER_SPEED
    assert np.abs(fast.roller_velocities).max() == pytest.approx(NINE.description.max_speed)
    expected = fast.scale * np.array([5.0, -10.0])
    assert moved(HOME, fast, 'Z') == pytest.approx(expected, rel=1e-6)


def test_a_grounded_joint_stays_and_failed_rollers_stand_still():
    command = core.solve_joint_velocity(HOME, {'X': (0.01, 0.02)})
    assert command.status is core.Status.UNREACHABLE
    assert moved(HOME, command, 'X') == pytest.approx(0.0, abs=1e-10)
    failed = NINE.roller_names[-1]
    command = core.solve_joint_velocity(HOME, {'Z': VELOCITY}, failed=(failed,))
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
        core.solve_joint_velocity(HOME, velocities)
