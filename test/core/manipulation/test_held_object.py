# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Motion in time: the held object's pose, commands for the middle of their interval, no drift."""

from hypothesis import given, reject, strategies
from isotruss_ros.core import (
    ConfigurationError,
    ConvexObject,
    GraspError,
    Grip,
    load_robot,
    RollingGrip,
    solve_twist,
    solve_twist_ahead,
    Status,
    tangent_center,
)
from isotruss_ros.core.manipulation.grasp import members_at_module
import numpy as np
import pytest
import robots
from scipy.integrate import solve_ivp

NUMBERS = strategies.integers(0, 10**6)
MODULE, DIAMETER = 'east/Q', 0.3


def grasp_at(config, module=MODULE, diameter=DIAMETER):
    return Grip.at_module(
        config.robot, module, ConvexObject.disc(tangent_center(config, module, diameter), diameter)
    )


def opening(config, module=MODULE):
    sides = members_at_module(config, module)
    return np.angle(sides.back / sides.ahead)


def difference(pose, wanted):
    """Return the distance [m] and the angle [rad] between two poses."""
    turned = np.angle(np.exp(1j * (pose[2] - wanted[2])))
    return np.hypot(pose[0] - wanted[0], pose[1] - wanted[1]), abs(turned)


def drive(twists, rate, command_for, start=None):
    """HoldStatus each command for one interval of the loop; return the end of it all."""
    config = start or load_robot('nine_member').home
    held = RollingGrip.attach(config, grasp_at(config))
    for twist in twists:
        command = command_for(config, held.moved_to(config), twist)
        assert command.status in (Status.OK, Status.IDLE)
        config = config.moved_to(config.roller_positions + command.roller_velocities / rate)
    return config, held


@robots.examples(40)
@given(robots.robots(), robots.generators(), NUMBERS, strategies.floats(-10.0, 10.0))
def test_object_is_where_it_was_grasped(robot, rng, number, angle):
    config, grasp, _ = robots.random_grasp(robot, rng, number)
    pose = RollingGrip.attach(config, grasp, angle).pose(config)
    assert pose[:2] == pytest.approx(grasp.center, abs=1e-12)
    assert difference(pose, (*grasp.center, angle))[1] < 1e-12
    assert -np.pi <= pose.angle <= np.pi
    again = RollingGrip.attach(config, grasp, angle).moved_to(config)
    assert again.center == pytest.approx(grasp.center, abs=1e-12)
    assert (again.module, again.diameter) == (grasp.module, grasp.diameter)


@robots.examples(25)
@given(robots.robots(), robots.generators(), NUMBERS)
def test_pose_depends_on_the_configuration_and_not_on_the_path(robot, rng, number):
    config, grasp, _ = robots.random_grasp(robot, rng, number)
    held = RollingGrip.attach(config, grasp)
    away = robots.random_state(robot, rng)
    back = away.moved_to(config.roller_positions)
    assert difference(held.pose(back), held.pose(config)) == pytest.approx((0.0, 0.0), abs=1e-9)
    # Grasped again elsewhere it is the same object.
    try:
        again = RollingGrip.attach(away, held.moved_to(away), held.pose(away).angle)
    except GraspError:
        reject()  # it was so near to a side that the side has swept over it
    assert difference(again.pose(config), held.pose(config)) == pytest.approx((0, 0), abs=1e-9)


@robots.examples(25)
@given(robots.robots(), robots.generators(), NUMBERS)
def test_object_rolls_by_the_travel_of_its_own_roller(robot, rng, number):
    config, grasp, ends = robots.random_grasp(robot, rng, number)
    held = RollingGrip.attach(config, grasp)
    moved = robots.random_state(robot, rng)
    before, after = ends, robots.side_ends(moved, grasp.module)
    carried = np.angle((after[1] - after[0]) / (before[1] - before[0]))
    travel = dict(
        zip(robot.roller_names, moved.roller_positions - config.roller_positions, strict=True)
    ).get(grasp.module, 0.0)
    arm = grasp.center - before[0]
    left = (arm * np.conj(before[1] - before[0])).imag > 0.0
    rolled = (2.0 if left else -2.0) * travel / grasp.diameter
    turned = held.pose(moved).angle - held.pose(config).angle
    assert np.exp(1j * turned) == pytest.approx(np.exp(1j * (carried + rolled)), abs=1e-9)


@robots.examples(20)
@given(robots.robots(), robots.generators(), NUMBERS)
def test_no_lead_is_the_plain_solution(robot, rng, number):
    config, grasp, _ = robots.random_grasp(robot, rng, number)
    twist = rng.standard_normal(3)
    plain = solve_twist(config, grasp, twist)
    ahead = solve_twist_ahead(config, grasp, twist, 0.0)
    assert ahead.roller_velocities.tolist() == plain.roller_velocities.tolist()
    assert (ahead.status, ahead.scale) == (plain.status, plain.scale)


def test_command_ahead_is_the_plain_one_for_the_state_ahead():
    config = load_robot('nine_member').home
    grasp, twist, lead = grasp_at(config), [0.01, 0.02, -0.1], 0.1
    held = RollingGrip.attach(config, grasp)
    plain = solve_twist(config, grasp, twist)
    there = config.moved_to(config.roller_positions + lead * plain.roller_velocities)
    wanted = solve_twist(there, held.moved_to(there), twist)
    command = solve_twist_ahead(config, grasp, twist, lead)
    assert command.roller_velocities == pytest.approx(wanted.roller_velocities, abs=1e-12)
    assert np.abs(command.roller_velocities - plain.roller_velocities).max() > 1e-5


def test_zero_twist_stays_idle_ahead():
    config = load_robot('nine_member').home
    command = solve_twist_ahead(config, grasp_at(config), [0.0, 0.0, 0.0], 0.1)
    assert command.status is Status.IDLE


@pytest.mark.parametrize('lead', [-1e-3, np.nan, np.inf])
def test_lead_that_makes_no_sense_is_refused(lead):
    config = load_robot('nine_member').home
    with pytest.raises(GraspError, match=r'lead .* must be a finite number, not negative'):
        solve_twist_ahead(config, grasp_at(config), [0.0, 0.01, 0.0], lead)


def test_lead_beyond_all_shapes_is_refused():
    config = load_robot('nine_member').home
    with pytest.raises(ConfigurationError, match='nine_member'):
        solve_twist_ahead(config, grasp_at(config), [0.0, 0.05, 0.0], 1e3)


TWIST = np.array([0.02, 0.04, 0.15])


def drift(rate, command_for, seconds=2.0):
    """Return how far object and grip are from where a constant twist should have led them."""
    steps = round(seconds * rate)
    config, held = drive([TWIST] * steps, rate, command_for)
    start = held.pose(load_robot('nine_member').home)
    distance, angle = difference(held.pose(config), np.array(start) + seconds * TWIST)
    return distance, angle, abs(opening(config) - opening(load_robot('nine_member').home))


def euler(config, grasp, twist):
    return solve_twist(config, grasp, twist)


def midpoint_at(rate):
    def command_for(config, grasp, twist):
        return solve_twist_ahead(config, grasp, twist, 0.5 / rate)

    return command_for


def test_midpoint_rule_is_of_second_order_and_euler_of_first():
    first = np.array([drift(rate, euler) for rate in (10.0, 20.0)])
    second = np.array([drift(rate, midpoint_at(rate)) for rate in (10.0, 20.0)])
    assert first[0] / first[1] == pytest.approx([2.0, 2.0, 2.0], rel=0.1)
    # The robot is symmetric: what is left of one coordinate is rounding.
    assert (second[0] > 3.6 * second[1] - 1e-9).all()
    # At the same rate the midpoint is far ahead.
    assert (second[1] < 0.05 * first[1]).all()


def test_lead_makes_up_for_a_state_that_is_one_cycle_old():
    rate, seconds = 20.0, 2.0
    home = load_robot('nine_member').home
    held = RollingGrip.attach(home, grasp_at(home))
    errors = []
    for lead in (0.5, 1.5):
        states = [home, home]
        for _ in range(round(seconds * rate)):
            measured = states[-2]
            command = solve_twist_ahead(measured, held.moved_to(measured), TWIST, lead / rate)
            travel = states[-1].roller_positions + command.roller_velocities / rate
            states.append(states[-1].moved_to(travel))
        wanted = np.array(held.pose(home)) + seconds * TWIST
        errors.append(difference(held.pose(states[-1]), wanted)[0])
    assert errors[1] < 0.1 * errors[0]


def test_rollers_integrate_as_scipy_integrates_them():
    robot = load_robot('nine_member')
    held = RollingGrip.attach(robot.home, grasp_at(robot.home))

    def rates(_time, travel):
        config = robot.configuration(travel)
        return solve_twist(config, held.moved_to(config), TWIST).roller_velocities

    found = solve_ivp(rates, (0.0, 2.0), np.zeros(6), rtol=1e-8, atol=1e-10)
    end = robot.configuration(found.y[:, -1])
    wanted = np.array(held.pose(robot.home)) + 2.0 * TWIST
    assert difference(held.pose(end), wanted) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert opening(end) == pytest.approx(opening(robot.home), abs=1e-6)
    config, _ = drive([TWIST] * 200, 100.0, midpoint_at(100.0))
    assert config.points == pytest.approx(end.points, abs=1e-5)


def bump(time, seconds):
    """Return a speed that starts and ends at rest and covers 1 in so many seconds."""
    return (1.0 - np.cos(2.0 * np.pi * time / seconds)) / seconds


def bump_integral(time, seconds):
    return time / seconds - np.sin(2.0 * np.pi * time / seconds) / (2.0 * np.pi)


def figure_nine(rate, pace):
    """Return the twists of the paper's Fig. 9: up, a turn in place, an arc normal to itself."""
    up, turn, radius, arc = 0.2, -0.5 * np.pi, 0.25, 0.5 * np.pi
    twists = []
    for seconds, speed in (
        (8.0 * pace, lambda t, s: (0.0, up * bump(t, s), 0.0)),
        (8.0 * pace, lambda t, s: (0.0, 0.0, turn * bump(t, s))),
        (
            12.0 * pace,
            lambda t, s: (
                radius * arc * bump(t, s) * np.cos(arc * bump_integral(t, s)),
                radius * arc * bump(t, s) * np.sin(arc * bump_integral(t, s)),
                arc * bump(t, s),
            ),
        ),
    ):
        times = (np.arange(round(seconds * rate)) + 0.5) / rate
        twists += [speed(time, seconds) for time in times]
    return np.array(twists)


@pytest.mark.parametrize(
    ('rate', 'pace'),
    [
        pytest.param(20.0, 1.0, id='28 s at 20 Hz'),
        # Five minutes of it, in which errors of each step would add up.
        pytest.param(5.0, 300.0 / 28.0, id='5 min at 5 Hz'),
    ],
)
def test_object_does_not_drift_on_the_path_of_figure_nine(rate, pace):
    twists = figure_nine(rate, pace)
    home = load_robot('nine_member').home
    held = RollingGrip.attach(home, grasp_at(home))
    wanted, config, furthest = np.array(held.pose(home)), home, 0.0
    for twist in twists:
        command = solve_twist_ahead(config, held.moved_to(config), twist, 0.5 / rate)
        assert command.status in (Status.OK, Status.IDLE)
        config = config.moved_to(config.roller_positions + command.roller_velocities / rate)
        wanted = wanted + twist / rate
        distance, angle = difference(held.pose(config), wanted)
        assert distance < 1e-3
        assert angle < np.deg2rad(0.1)
        furthest = max(furthest, np.abs(config.residual()).max())
    assert furthest < 1e-9
    for tube in range(3):
        own = config.robot.topology.tube == tube
        change = config.member_lengths[own].sum() - home.member_lengths[own].sum()
        assert abs(change) < 1e-9
    assert abs(opening(config) - opening(home)) < np.deg2rad(0.1)
    # It did go somewhere.
    assert np.hypot(*(np.array(held.pose(config)[:2]) - held.pose(home)[:2])) > 0.4
