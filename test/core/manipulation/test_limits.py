# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Limits of member lengths: their rows, and motions against them and back."""

from grips import held_at, rolled
from hypothesis import given
from isotruss_ros.core import solve_twist, Status
from isotruss_ros.core.manipulation.limits import default_limits, MemberLengthLimit, stack_rows
import numpy as np
import pytest
import robots


@robots.examples(15)
@given(robots.robots(), robots.generators())
def test_members_approach_their_bounds_exponentially(robot, rng):
    """A member at the bounding speed reaches the bound after 1/rate; beyond it may only return."""
    config = robots.random_state(robot, rng)
    lengths = config.member_lengths
    rows = MemberLengthLimit(0.5, 1.0, rate=4.0).rows(config)
    assert lengths + rows.upper / 4.0 == pytest.approx(np.maximum(lengths, 1.0))
    assert lengths + rows.lower / 4.0 == pytest.approx(np.minimum(lengths, 0.5))
    rates = rng.standard_normal(len(robot.roller_names))
    moved = config.moved_to(config.roller_positions + 1e-6 * rates)
    assert 1e-6 * rows.matrix @ rates == pytest.approx(moved.member_lengths - lengths, abs=1e-11)


def narrow(shortest, longest, **rollers):
    """Return the nine-member robot with other limits of its members and rollers."""
    document = robots.preset_document('nine_member')
    document['members'] = {'min_length': shortest, 'max_length': longest}
    document['rollers'] |= rollers
    return robots.load(document)


def walk(held, twist, steps, dt):
    """Move along a twist and check the limits at each step; return the end and the commands."""
    file, commands = held.config.robot.description, []
    for _ in range(steps):
        command = solve_twist(held.config, held.grip, twist)
        commands.append(command)
        assert np.abs(command.roller_velocities).max() <= file.max_speed + 1e-9
        held = rolled(held, dt * command.roller_velocities)
        assert held.config.member_lengths.min() >= file.min_length - 1e-9
        assert held.config.member_lengths.max() <= file.max_length + 1e-9
    return held, commands


@pytest.mark.parametrize('direction', [0, 3])
def test_robot_pushed_against_a_limit_can_always_return(direction):
    robot = narrow(0.9, 1.1)
    angle = 2.0 * np.pi * direction / 8
    push = np.array([0.1 * np.cos(angle), 0.1 * np.sin(angle), 0.0])
    held = held_at(robot.home, 'east/Q')
    held, commands = walk(held, push, 250, dt=0.04)
    # It creeps up to the bound and comes to rest there.
    assert commands[-1].status is Status.SLOWED_MEMBER_LENGTH
    assert set(commands[-1].limiting) <= set(robot.member_names)
    assert commands[-1].scale < 1e-3
    back = solve_twist(held.config, held.grip, -push)
    assert back.scale > 0.05
    assert back.achieved_twist[:2] @ push[:2] < 0.0
    end, _ = walk(held, -push, 25, dt=0.04)
    assert abs(end.grip.center - held.grip.center) > 0.01


def test_members_approach_their_bounds_no_faster_than_the_rollers_brake():
    robot = narrow(0.9, 1.1, max_acceleration=0.2)
    _, bounds = np.split(
        stack_rows(robot.home, default_limits(robot)).upper, [len(robot.roller_names)]
    )
    braking_rate = 0.2 / robot.description.max_speed
    assert bounds == pytest.approx(braking_rate * (1.1 - robot.home.member_lengths))
