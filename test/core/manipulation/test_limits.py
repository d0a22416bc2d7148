# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Limits: their rows, and that no walk ever crosses them or gets stuck at them."""

from grips import held_at, rolled
from hypothesis import given
from isotruss_ros.core import solve_twist, Status
from isotruss_ros.core.manipulation.limits import MemberLengthLimit, RollerSpeedLimit
import numpy as np
import pytest
import robots


@robots.examples(15)
@given(robots.robots(), robots.generators())
def test_rows_bound_rollers_and_members(robot, rng):
    config = robots.random_state(robot, rng)
    rates = rng.standard_normal(len(robot.roller_names))
    rows = RollerSpeedLimit(0.3).rows(config)
    assert rows.matrix @ rates == pytest.approx(rates)
    assert (rows.upper == 0.3).all()
    assert (rows.lower == -0.3).all()
    limit = MemberLengthLimit(0.5, 1.0, rate=4.0)
    rows = limit.rows(config)
    step = 1e-6
    moved = config.moved_to(config.roller_positions + step * rates).member_lengths
    assert step * rows.matrix @ rates == pytest.approx(moved - config.member_lengths, abs=1e-11)
    assert (rows.lower <= 0.0).all()
    assert (rows.upper >= 0.0).all()
    # Whoever moves at the bound's rate for 1/rate seconds arrives exactly there.
    inside = (config.member_lengths >= 0.5) & (config.member_lengths <= 1.0)
    assert (config.member_lengths + rows.upper / 4.0)[inside] == pytest.approx(1.0)
    assert (config.member_lengths + rows.lower / 4.0)[inside] == pytest.approx(0.5)
    # Whoever is beyond a bound may stay or return.
    assert (rows.upper[config.member_lengths > 1.0] == 0.0).all()
    assert (rows.lower[config.member_lengths < 0.5] == 0.0).all()
    assert limit.row_names(config) == robot.member_names
    assert RollerSpeedLimit(0.3).row_names(config) == robot.roller_names
    # Ten times a second where nothing else is said.
    longest = config.member_lengths.max()
    rows = MemberLengthLimit(0.1, longest).rows(config)
    assert rows.upper == pytest.approx(10.0 * (longest - config.member_lengths))


def narrow(shortest, longest):
    """Return the nine-member robot with other limits of its members."""
    document = robots.preset_document('nine_member')
    document['members'] = {'min_length': shortest, 'max_length': longest}
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


@pytest.mark.parametrize('direction', [0, 3, 6])
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
