# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What the control of the squeeze asks for in a single cycle, and what that leads to."""

from dataclasses import replace
import math

from grips import gripped
from isotruss_ros.core import (
    ConvexObject,
    Grip,
    HoldStatus,
    RollerCommand,
    solve_twist,
    Status,
)
from isotruss_ros.core.control.load_estimate import LoadSettings
from isotruss_ros.core.control.squeeze_control import SqueezeControl, SqueezeSettings
from isotruss_ros.core.grasping.held_grip import HeldGrip
import numpy as np
import pytest

CONFIG, CYLINDER = gripped(35.0, squeeze=0.1)
GRASP = Grip.at_module(
    HOME.robot, 'north/Z', ConvexObject.disc(CYLINDER.center, CYLINDER.diameter)
)
MODEL = HeldGrip.attach(CONFIG, CYLINDER)
FRICTION = 0.5


def controlled(missing=0.0, **settings):
    """Return a control of which so much of the squeeze is missing."""
    control = SqueezeControl(SqueezeSettings(0.0, FRICTION, **settings))
    assert control.follow(CONFIG, GRASP, 0.0, 0.0) is HoldStatus.HELD
    force = control.grasp.squeeze + missing
    control.settings = SqueezeSettings(force, FRICTION, **settings)
    return control


def asked_of(control, twist, period):
    """Return the first twist and the first rate of opening that are asked for."""
    asked = []

    def solve(wanted, opening_rate):
        asked.append((wanted, opening_rate))
        still = np.zeros(len(CONFIG.roller_positions))
        return RollerCommand(still, np.zeros(3), 0.0, Status.SLOWED_ROLLER_SPEED)

    control.solve(np.array(twist), period, solve)
    assert len(asked) == 1
    return asked[0]


@pytest.mark.parametrize(('period', 'gain'), [(0.01, 20.0), (0.02, 20.0), (0.1, 5.0)])
def test_errors_of_the_pose_decay_no_quicker_than_half_of_them_in_a_cycle(period, gain):
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


@pytest.mark.parametrize(
    ('missing', 'rate'), [(1.0, 5.0), (-1.5, -7.5), (3.0, 10.0), (-9.0, -10.0)]
)
def test_the_grip_opens_by_what_is_missing_of_the_squeeze(missing, rate):
    """Five times what is missing in a second, at most 10 N/s, by the slope of the model."""
    control = controlled(missing)
    slope = control.grasp.squeeze_stiffness()
    _, opening_rate = asked_of(control, np.zeros(3), 0.02)
    assert opening_rate * slope == pytest.approx(rate, rel=1e-6)


@pytest.mark.parametrize('missing', [0.5, -0.8])
def test_a_cycle_changes_the_squeeze_as_asked(missing):
    """The first command is off by what the model knows better than its slope."""
    control, period = controlled(missing), 0.02
    before = control.grasp.squeeze

    def solve(twist, opening_rate):
        return solve_twist(CONFIG, GRASP, twist, opening_rate=opening_rate)

    command = control.solve(np.zeros(3), period, solve)
    there = CONFIG.moved_to(CONFIG.roller_positions + period * command.roller_velocities)
    after = MODEL.moved_to(there).squeeze
    assert after - before == pytest.approx(5.0 * missing * period, rel=0.01)


AT_REST = Grip.at_module(
    HOME.robot, 'north/Z', ConvexObject.disc(MODEL.pose[:2], CYLINDER.diameter)
)


def at_rest(missing=0.0, **settings):
    """Return a control whose object is where the model has it."""
    force = MODEL.squeeze + missing
    control = SqueezeControl(SqueezeSettings(force, FRICTION, **settings))
    assert control.slip_margin == 0.0
    assert control.follow(CONFIG, AT_REST, MODEL.pose.angle, 0.0) is HoldStatus.HELD
    return control


def solve_at_rest(twist, opening_rate):
    return solve_twist(CONFIG, AT_REST, twist, opening_rate=opening_rate)


def measured(model):
    """Return the grasp and the angle of an object that is where a model has it."""
    return Grip.at_module(
        HOME.robot, 'north/Z', ConvexObject.disc(model.pose[:2], CYLINDER.diameter)
    ), model.pose.angle


@pytest.mark.parametrize('missing', [2.0, -2.0])
def test_between_evaluations_the_squeeze_follows_slope_and_trend(missing):
    # No load is estimated.
    control = at_rest(missing, model_period=10.0, near=1.0, load=LoadSettings(time=1e9))
    period = 0.02
    command = control.solve(np.zeros(3), period, solve_at_rest)
    there = CONFIG.moved_to(CONFIG.roller_positions + 2.0 * period * command.roller_velocities)
    travel = there.roller_positions - control.grasp.config.roller_positions
    beyond = control._trend.squeeze * control._trend.along(travel)
    truth = MODEL.moved_to(there)
    control.follow(there, *measured(truth), period)
    assert abs(beyond) > 5e-3
    assert control._squeeze == pytest.approx(truth.squeeze, abs=0.6 * abs(beyond))


def test_a_load_that_comes_later_is_estimated_as_one_that_is_there_at_once():
    control, once = at_rest(), at_rest()
    loaded = measured(MODEL.moved_to(CONFIG, np.array([0.5, -1.0, 0.1])))
    for _ in range(40):
        control.follow(CONFIG, *loaded, 0.02)
    once.follow(CONFIG, *loaded, 100.0)
    assert np.abs(once.load.wrench).max() > 0.4
    assert control.load.wrench == pytest.approx(once.load.wrench, rel=1e-3)


def test_a_load_is_no_trend():
    control, moved = at_rest(), CONFIG.moved_to(CONFIG.roller_positions + 1e-3)
    plain, loaded = (
        control._find_trend(MODEL, MODEL.moved_to(moved, wrench))
        for wrench in (None, np.array([0.5, -1.0, 0.1]))
    )
    change = MODEL.moved_to(CONFIG, np.array([0.5, -1.0, 0.1])).squeeze - MODEL.squeeze
    length = np.linalg.norm(moved.roller_positions - CONFIG.roller_positions)
    assert abs(loaded.squeeze - plain.squeeze) < 0.3 * abs(change) / length


@pytest.mark.parametrize('scale', [1.0, 0.5])
def test_a_trend_goes_by_the_command_before_limits_scale_it(scale):
    control = at_rest(1.0)

    def solve(twist, opening_rate):
        found = solve_at_rest(twist, opening_rate)
        return replace(found, roller_velocities=scale * found.roller_velocities, scale=scale)

    asked = solve_at_rest(np.zeros(3), 5.0 / MODEL.squeeze_stiffness()).roller_velocities
    control.solve(np.zeros(3), 0.02, solve)
    assert control._rollers == pytest.approx(asked, rel=1e-6, abs=1e-9)
