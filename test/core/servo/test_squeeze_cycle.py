# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the control of the squeeze asks for in a single cycle, and what that leads to."""

from dataclasses import replace
import math

from grips import gripped, MASSLESS
from isotruss_ros.core import Grip, HoldStatus, Pose, solve_twist, Status
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.servo.squeeze_control import SqueezeControl, SqueezeSettings
import numpy as np
import pytest
from scipy.optimize import brentq

CONFIG, CYLINDER = gripped(35.0, squeeze=0.1)
GRASP = Grip.at_module(CONFIG.robot, 'north/Z', CYLINDER)
MODEL = attach_grip(CONFIG, CYLINDER)
FRICTION = 0.5


def controlled(missing=0.0, **settings):
    """Return a control of which so much of the squeeze is missing."""
    control = SqueezeControl(SqueezeSettings(0.0, **MASSLESS | settings))
    assert control.follow(CONFIG, GRASP, 0.0) is HoldStatus.HELD
    force = control.belief.squeeze + missing
    control.settings = SqueezeSettings(force, **MASSLESS | settings)
    return control


def asked_of(control, twist, period):
    """Return the first twist and the first rate of opening that are asked for."""
    asked = []

    def solve(wanted, opening_rate):
        asked.append((wanted, opening_rate))
        still = np.zeros(len(CONFIG.roller_positions))
        return RollerCommand(still, np.zeros(3), 1.0, Status.OK)

    control.solve(np.array(twist), period, solve)
    assert len(asked) == 1
    return asked[0]


@pytest.mark.parametrize(('period', 'gain'), [(0.01, 20.0), (0.02, 20.0), (0.1, 5.0)])
def test_pose_correction_takes_at_most_half_of_the_error_in_a_cycle(period, gain):
    control, twist = controlled(), np.array([0.01, -0.02, 0.1])
    assert asked_of(control, twist, period)[0] == pytest.approx(twist, abs=1e-15)
    error = np.array([1e-3, -2e-3, 3e-2])
    control.reference = control.reference + error
    assert asked_of(control, twist, period)[0] == pytest.approx(twist + gain * error)
    # Angles count the shorter way around.
    control.reference = control.reference + np.array([0.0, 0.0, 2.0 * math.pi])
    assert asked_of(control, twist, period)[0] == pytest.approx(twist + gain * error)
    control.reference[2] += 3.0
    turned = error[2] + 3.0
    assert asked_of(control, twist, period)[0][2] == pytest.approx(twist[2] + gain * turned)


@pytest.mark.parametrize('status', [Status.SLIDING, Status.UNREACHABLE])
def test_pose_error_ends_only_along_the_directions_of_an_unreachable_twist(status):
    control, twist, elapsed = controlled(), np.array([0.01, -0.02, 0.1]), 0.01
    asked_of(control, twist, elapsed)
    error, reachable = np.array([1e-3, -2e-3, 3e-2]), np.array([1.0, 0.0, 1.0])
    control.reference = before = control.reference + error
    achieved = reachable * asked_of(control, twist, elapsed)[0]
    still = np.zeros(len(CONFIG.roller_positions))
    control.advance(twist, RollerCommand(still, achieved, 1.0, status))
    assert control.follow(CONFIG, GRASP, elapsed) is HoldStatus.HELD
    decay = (1.0 - reachable) * control.gain * error
    assert control.reference - before == pytest.approx(elapsed * (reachable * twist - decay))


AT_REST = Grip.at_module(CONFIG.robot, 'north/Z', MODEL.body)


def at_rest(missing=0.0, **settings):
    """Return a control whose object is where the model has it."""
    force = MODEL.squeeze + missing
    control = SqueezeControl(SqueezeSettings(force, **MASSLESS | settings))
    assert control.belief is None
    assert control.follow(CONFIG, AT_REST, 0.0) is HoldStatus.HELD
    return control


def solve_at_rest(twist, opening_rate):
    return solve_twist(CONFIG, AT_REST, twist, opening_rate=opening_rate)


def test_object_is_attached_again_at_the_mean_of_the_first_poses():
    control, rng = at_rest(pose_gain=2.0), np.random.default_rng(0)
    control.reset()
    for k in range(60):
        turned = 0.02 if k == 0 else 0.01 * rng.normal()
        grip = AT_REST.moved_to(Pose(*np.add(MODEL.pose, (0.0, 0.0, turned))))
        control.follow(CONFIG, grip, 0.01)
    assert control.fault is None
    assert abs(control.belief.grasp.pose.angle - MODEL.pose.angle) < 0.004


def test_the_slip_margin_does_not_rely_on_an_estimated_load():
    control, alone = at_rest(), MODEL.slip_margin(FRICTION)
    for wrench in ([0.0, 1.0, 0.0], [0.0, -1.0, 0.0]):
        loaded = replace(AT_REST, body=roll_grip(MODEL, CONFIG, np.array(wrench)).body)
        for _ in range(20):
            control.follow(CONFIG, loaded, 0.02)
        assert control.belief.slip_margin == pytest.approx(alone, rel=0.05)


def cycles(control, twist, count, period=0.02):
    """Return the models in the configurations to which the commands of some cycles lead."""
    models = [MODEL]
    for _ in range(count):
        config, grip = models[-1].config, replace(AT_REST, body=models[-1].body)
        assert control.follow(config, grip, period) is HoldStatus.HELD

        def solve(twist, opening_rate, config=config, grip=grip):
            return solve_twist(config, grip, twist, opening_rate=opening_rate)

        command = control.solve(np.array(twist), period, solve)
        control.advance(twist, command)
        travel = period * command.roller_velocities
        models.append(roll_grip(models[-1], config.moved_to(config.roller_positions + travel)))
    return models


def test_drift_beyond_the_contact_rows_is_fed_forward():
    """It is a tenth of the twist in the first cycle, of which nothing is known before."""
    twist = np.array([0.02, -0.01, 0.1])
    models = cycles(at_rest(pose_gain=1e-9), twist, 3)
    moved = np.diff([model.pose for model in models], axis=0) / 0.02
    first, second, third = np.abs(moved - twist).max(axis=1)
    assert second < 0.2 * first
    assert third < 0.1 * first


def opened():
    """Return a configuration whose members are away from the object."""
    opening = solve_at_rest(np.zeros(3), 0.05).roller_velocities
    return CONFIG.moved_to(CONFIG.roller_positions + 6.0 * opening)


def test_a_start_without_a_balance_is_not_held_until_there_is_one():
    control = SqueezeControl(SqueezeSettings(20.0, **MASSLESS))
    for _ in range(2):
        assert control.follow(opened(), AT_REST, 0.02) is HoldStatus.NO_BALANCE
    assert control.belief is control.fault is None
    assert control.follow(CONFIG, AT_REST, 0.02) is HoldStatus.HELD


@pytest.mark.parametrize('status', [Status.SLOWED_ROLLER_SPEED, Status.SLOWED_BARRIER])
def test_limits_slow_the_twist_before_the_squeeze(status):
    control, speed = at_rest(1.0), 0.03
    opening = 5.0 / MODEL.squeeze_stiffness()

    def solve(twist, opening_rate):
        command = solve_twist(CONFIG, AT_REST, twist, opening_rate=opening_rate)
        share = min(1.0, speed / np.abs(command.roller_velocities).max())
        return replace(
            command,
            roller_velocities=share * command.roller_velocities,
            scale=share,
            status=Status.OK if share == 1.0 else status,
        )

    alone = solve(np.zeros(3), opening)
    assert alone.scale == 1.0
    command = control.solve(np.array([0.05, 0.0, 0.0]), 0.02, solve)
    rows = grip_jacobian(CONFIG, AT_REST)
    assert command.status is status
    assert command.scale < 0.5
    assert rows[3] @ command.roller_velocities == pytest.approx(opening, rel=0.02)


def test_a_speed_limit_of_the_rollers_stops_neither_twist_nor_squeeze():
    """The opening rate needs a part of the limited speed, and the twist has the other."""
    control, limit = at_rest(0.2), 0.015

    def solve(twist, opening_rate):
        command = solve_at_rest(twist, opening_rate)
        share = min(1.0, limit / np.abs(command.roller_velocities).max())
        status = Status.OK if share == 1.0 else Status.SLOWED_ROLLER_SPEED
        velocities = share * command.roller_velocities
        return replace(command, roller_velocities=velocities, scale=share, status=status)

    for direction in (-1.0, 1.0):
        command = control.solve(np.array([0.05 * direction, 0.0, 0.0]), 0.02, solve)
        assert 0.1 < command.scale < 1.0
        fastest = np.abs(command.roller_velocities).max()
        assert 0.9 * limit < fastest <= limit


@pytest.mark.parametrize('status', [Status.UNREACHABLE, Status.SLIDING, Status.ACCELERATING])
def test_a_correction_that_is_not_admitted_is_no_fault_of_a_twist_of_zero(status):
    def solve(twist, opening_rate):
        return replace(solve_at_rest(twist, opening_rate), status=status)

    changed = status is not Status.ACCELERATING
    assert at_rest().solve(np.zeros(3), 0.02, solve).status is (Status.OK if changed else status)
    assert at_rest().solve(np.array([0.01, 0.0, 0.0]), 0.02, solve).status is status


def test_a_twist_is_slowed_no_more_than_its_limit_demands():
    control = at_rest(1.0)

    def solve(twist, opening_rate):
        share = min(1.0, 0.02 / max(np.linalg.norm(twist), 1e-9))
        command = solve_at_rest(share * twist, opening_rate)
        status = Status.OK if share > 1.0 - 1e-9 else Status.SLOWED_OBJECT
        return replace(command, scale=1.0 if status is Status.OK else share, status=status)

    command = control.solve(np.array([0.05, 0.0, 0.0]), 0.02, solve)
    assert (command.status, command.scale) == (Status.SLOWED_OBJECT, pytest.approx(0.4, rel=1e-3))
    assert command.achieved_twist[0] == pytest.approx(0.02, rel=1e-3)


def test_a_limit_that_admits_no_twist_leaves_the_squeeze():
    control, calls = at_rest(1.0), []

    def solve(twist, opening_rate):
        calls.append((twist.any(), opening_rate))
        command, slowed = solve_at_rest(twist, opening_rate), bool(twist.any())
        status = Status.SLOWED_OBJECT if slowed else Status.OK
        return replace(command, scale=0.5 if slowed else 1.0, status=status, limiting=('a',))

    command = control.solve(np.array([0.05, 0.0, 0.0]), 0.02, solve)
    assert [moving for moving, _ in calls] == [True, True, False]
    assert len({opening_rate for _, opening_rate in calls}) == 1
    assert (command.scale, command.status) == (0.0, Status.SLOWED_OBJECT)
    assert command.limiting == ('a',)
    assert command.roller_velocities.any()


def moved(left, error=0.0, solve=solve_at_rest):
    """Return the command for a twist where so much of the squeeze is margin."""
    friction = brentq(lambda mu: MODEL.slip_margin(mu) / MODEL.squeeze - left, 0.01, 2.0)
    control, twist = SqueezeControl(SqueezeSettings(MODEL.squeeze, **MASSLESS)), (0.02, 0.0, 0.0)
    held = Grip.at_module(CONFIG.robot, 'north/Z', MODEL.body, friction)
    assert control.follow(CONFIG, held, 0.0) is HoldStatus.HELD
    travel = 0.02 * solve_at_rest(np.array(twist), 0.0).roller_velocities
    control.belief.cache.usage.learn(control.belief.grasp, -10.0, travel)
    control.reference = control.belief.regulated[:3] + np.array([0.0, error, 0.0])
    return control.solve(np.array(twist), 0.02, solve)


def test_the_shares_of_limits_and_of_the_slip_margin_multiply():
    def solve(twist, opening_rate):
        command = solve_at_rest(twist, opening_rate)
        return replace(command, scale=0.5, status=Status.UNREACHABLE, limiting=('a',))

    command, whole = moved(0.02, solve=solve), moved(0.02)
    assert 0.0 < whole.scale < 1.0
    assert command.scale == pytest.approx(0.5 * whole.scale)
    assert command.limiting == ('a', 'the slip margin')


def test_slip_margin_stays_above_a_hundredth_of_the_squeeze():
    assert moved(0.005).scale == 0.0
    one, two = moved(0.02).scale, moved(0.03).scale
    assert 0.0 < one < 0.5
    # Twice as much is free then.
    assert two == pytest.approx(2.0 * one, rel=0.01)


def test_a_low_slip_margin_slows_the_twist_and_not_the_correction_of_the_pose():
    for left in (0.005, 0.02):
        command = moved(left, error=1e-4)
        assert command.status is Status.SLOWED_SLIP_MARGIN
        assert command.limiting == ('the slip margin',)
        expected = [0.02 * command.scale, 20.0 * 1e-4, 0.0]
        assert command.achieved_twist == pytest.approx(expected, abs=1e-6)


def test_a_lost_balance_is_a_fault_unless_the_next_search_finds_another():
    for grip, fault in (
        (AT_REST, None),
        (AT_REST.moved_to((5.0, 5.0, 0.0)), Status.HALT_NOT_HELD),
    ):
        control = at_rest()
        # The first cycle does not roll the grip, and the second finds no equilibrium.
        assert control.follow(opened(), AT_REST, 0.02) is HoldStatus.HELD
        assert control.follow(opened(), AT_REST, 0.02) is not HoldStatus.HELD
        assert control.fault is control.belief is None
        control.follow(CONFIG, grip, 0.02)
        assert control.fault is fault
        assert (control.belief is None) is (fault is not None)
