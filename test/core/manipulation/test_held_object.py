# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Motion in time: the held object's pose, commands for the middle of their interval, no drift."""

from grips import disc_grip
from hypothesis import given, strategies
from isotruss_ros.core import load_robot, RollingGrip, solve_twist, solve_twist_ahead, Status
from isotruss_ros.core.errors import ConfigurationError, GraspError
import numpy as np
import pytest
import robots
from scipy.integrate import solve_ivp

HOME = load_robot('nine_member').home
MODULE = 'east/Q'
START = RollingGrip.attach(HOME, disc_grip(HOME, MODULE))
TWIST = np.array([0.02, 0.04, 0.15])


def opening(config):
    """Return the angle between the members at the grip's module."""
    b, b_end, c, c_end = robots.side_ends(config, MODULE)
    return abs(np.angle((c_end - c) / (b_end - b)))


def difference(pose, wanted):
    """Return the distance [m] and the angle [rad] between two poses."""
    turned = np.angle(np.exp(1j * (pose[2] - wanted[2])))
    return np.hypot(pose[0] - wanted[0], pose[1] - wanted[1]), abs(turned)


def moved(held, travel):
    """Return the object held after some travel of the rollers."""
    return held.moved_to(held.config.moved_to(held.config.roller_positions + travel))


def drive(twists, rate, lead):
    """Carry out each command, computed for some time ahead [s], for one interval of the loop."""
    held = START
    for twist in twists:
        command = solve_twist_ahead(held.config, held.grip, twist, lead)
        assert command.status in (Status.OK, Status.IDLE)
        held = moved(held, command.roller_velocities / rate)
        yield held


@robots.examples(20)
@given(robots.robots(), robots.generators(), strategies.integers(0, 10**6))
def test_no_lead_is_the_plain_solution(robot, rng, number):
    config, grip, _ = robots.random_grasp(robot, rng, number)
    twist = rng.standard_normal(3)
    plain = solve_twist(config, grip, twist)
    ahead = solve_twist_ahead(config, grip, twist, 0.0)
    assert ahead.roller_velocities.tolist() == plain.roller_velocities.tolist()
    assert (ahead.status, ahead.scale) == (plain.status, plain.scale)


def test_command_ahead_is_the_plain_one_for_the_state_ahead():
    twist, lead = [0.01, 0.02, -0.1], 0.1
    plain = solve_twist(HOME, START.grip, twist)
    there = moved(START, lead * plain.roller_velocities)
    wanted = solve_twist(there.config, there.grip, twist)
    command = solve_twist_ahead(HOME, START.grip, twist, lead)
    assert command.roller_velocities == pytest.approx(wanted.roller_velocities, abs=1e-12)
    assert np.abs(command.roller_velocities - plain.roller_velocities).max() > 1e-5


@pytest.mark.parametrize(
    ('lead', 'error', 'words'),
    [
        *(
            (lead, GraspError, r'lead .* be a finite number, not negative')
            for lead in (-1e-3, np.inf)
        ),
        (np.nan, GraspError, 'lead nan s: must be'),
        (1e3, ConfigurationError, 'nine_member'),
    ],
)
def test_leads_that_make_no_sense_or_lead_beyond_all_shapes_are_refused(lead, error, words):
    with pytest.raises(error, match=words):
        solve_twist_ahead(HOME, START.grip, [0.0, 0.05, 0.0], lead)
    assert solve_twist_ahead(HOME, START.grip, np.zeros(3), 0.1).status is Status.IDLE


def drift(rate, lead, seconds=2.0):
    """Return how far object and grip are from where a constant twist should have led them."""
    *_, end = drive([TWIST] * round(seconds * rate), rate, lead)
    distance, angle = difference(end.pose, np.array(START.pose) + seconds * TWIST)
    return distance, angle, abs(opening(end.config) - opening(HOME))


def test_midpoint_rule_is_of_second_order_and_euler_of_first():
    first = np.array([drift(rate, 0.0) for rate in (10.0, 20.0)])
    second = np.array([drift(rate, 0.5 / rate) for rate in (10.0, 20.0)])
    assert first[0] / first[1] == pytest.approx([2.0, 2.0, 2.0], rel=0.1)
    # The robot is symmetric: what is left of one coordinate is rounding.
    assert (second[0] > 3.6 * second[1] - 1e-9).all()
    # At the same rate the midpoint is far ahead.
    assert (second[1] < 0.05 * first[1]).all()


def test_lead_makes_up_for_a_state_that_is_one_cycle_old():
    rate, seconds = 20.0, 2.0
    errors = []
    for lead in (0.5, 1.5):
        states = [START, START]
        for _ in range(round(seconds * rate)):
            seen = states[-2]
            command = solve_twist_ahead(seen.config, seen.grip, TWIST, lead / rate)
            states.append(moved(states[-1], command.roller_velocities / rate))
        wanted = np.array(START.pose) + seconds * TWIST
        errors.append(difference(states[-1].pose, wanted)[0])
    assert errors[1] < 0.1 * errors[0]


def test_rollers_integrate_as_scipy_integrates_them():
    def rates(_time, travel):
        held = START.moved_to(HOME.robot.configuration(travel))
        return solve_twist(held.config, held.grip, TWIST).roller_velocities

    found = solve_ivp(rates, (0.0, 2.0), np.zeros(6), rtol=1e-8, atol=1e-10)
    end = START.moved_to(HOME.robot.configuration(found.y[:, -1]))
    wanted = np.array(START.pose) + 2.0 * TWIST
    assert difference(end.pose, wanted) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert opening(end.config) == pytest.approx(opening(HOME), abs=1e-6)
    *_, driven = drive([TWIST] * 200, 100.0, 0.005)
    assert driven.config.points == pytest.approx(end.config.points, abs=1e-5)


def test_a_quarter_of_a_turn_uses_up_the_arc_of_a_quarter():
    """Of an object of 0.3 m that are 0.236 m, less what the member turns itself."""
    *_, end = drive([[0.0, 0.0, -0.1 * np.pi]] * 100, 20.0, 0.025)
    assert difference(end.pose, START.pose) == pytest.approx((0.0, 0.5 * np.pi), abs=1e-3)
    (b, b_end, *_), (there, there_end, *_) = (
        robots.side_ends(each, MODULE) for each in (HOME, end.config)
    )
    own = abs(np.angle((there_end - there) / (b_end - b)))
    rolled = dict(zip(HOME.robot.roller_names, end.config.roller_positions, strict=True))[MODULE]
    assert abs(rolled) == pytest.approx(0.236, abs=0.15 * own + 1e-3)
    assert own < 0.3


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


def test_object_does_not_drift_on_the_path_of_figure_nine():
    """In five minutes of it, in which errors of each step would add up."""
    rate = 5.0
    twists = figure_nine(rate, pace=300.0 / 28.0)
    wanted, furthest = np.array(START.pose), 0.0
    for twist, held in zip(twists, drive(twists, rate, 0.5 / rate), strict=True):
        wanted = wanted + twist / rate
        distance, angle = difference(held.pose, wanted)
        assert distance < 1e-3
        assert angle < np.deg2rad(0.1)
        furthest = max(furthest, np.abs(held.config.residual()).max())
    assert furthest < 1e-9
    for tube in range(3):
        own = HOME.robot.topology.tube == tube
        change = held.config.member_lengths[own].sum() - HOME.member_lengths[own].sum()
        assert abs(change) < 1e-9
    assert abs(opening(held.config) - opening(HOME)) < np.deg2rad(0.1)
    # It did go somewhere.
    assert abs(held.grip.center - START.grip.center) > 0.4
