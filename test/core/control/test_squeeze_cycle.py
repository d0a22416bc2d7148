"""What the control of the squeeze asks for in a single cycle, and what that leads to."""

import math

from grips import gripped
from isotruss_ros.core import Grasp, Hold, RollerCommand, solve_twist, Status
from isotruss_ros.core.control.squeeze_control import SqueezeControl, SqueezeSettings
from isotruss_ros.core.grasping.rolling_grasp import RollingGrasp
import numpy as np
import pytest

CONFIG, CYLINDER = gripped(35.0, squeeze=0.1)
GRASP = Grasp('north/Z', CYLINDER.center, CYLINDER.diameter)
MODEL = RollingGrasp.attach(CONFIG, CYLINDER)
FRICTION = 0.5


def controlled(missing=0.0, **settings):
    """Return a control of which so much of the squeeze is missing."""
    control = SqueezeControl(SqueezeSettings(0.0, FRICTION, **settings))
    assert control.follow(CONFIG, GRASP, 0.0, 0.0) is Hold.HELD
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
    slope = control.grasp.squeeze_by_opening()
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
