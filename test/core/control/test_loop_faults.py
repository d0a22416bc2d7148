# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Late loops, stale estimates and corrected zeros, as the loop deals with them."""

from types import SimpleNamespace

from grips import gripped
from isotruss_ros.core import (
    ConvexObject,
    Grip,
    HoldStatus,
    load_robot,
    Pose,
    Status,
    tangent_center,
    TwistServo,
)
from isotruss_ros.core.control.inputs import RollerState, StampedInput
from isotruss_ros.core.control.state_estimate import EstimatedTravel
from isotruss_ros.core.manipulation.status import RollerCommand
import numpy as np
import pytest
from squeeze_loop import SqueezeLoop

ROBOT = load_robot('nine_member')
CENTER = tangent_center(ROBOT.home, 'north/Z', 0.3)
GRIP = Grip.at_module(ROBOT, 'north/Z', ConvexObject.disc(CENTER, 0.3))
HOME = np.zeros(len(ROBOT.roller_names))
NOW, PERIOD, TIMEOUT = 1000.0, 0.005, 0.2


class NotedSqueeze:
    """Notes what the servo tells the regulation of the squeeze."""

    fault = frequency = squeeze = None
    grasp = 'held'
    gains = SimpleNamespace(pose=1.0)
    model = SimpleNamespace(grip=GRIP)

    def __init__(self):
        self.estimates, self.elapsed = [], []

    def take_pressures(self, _pressures):
        """Forget them."""

    def take_estimate(self, estimate, _offsets):
        """Note the estimate."""
        self.estimates.append(estimate)

    def follow(self, _config, _grip, elapsed):
        """Note the time since the cycle before."""
        self.elapsed.append(elapsed)
        return HoldStatus.HELD

    def solve(self, twist, _period, solve):
        """Solve for the twist alone."""
        return solve(twist)

    def advance(self, *_):
        """Do nothing."""

    def note(self):
        """Return that nothing is wrong."""
        return ''


def servo(now=NOW, **given):
    """Return a servo with good inputs."""
    made = TwistServo(ROBOT, GRIP, PERIOD, TIMEOUT)
    feed(made, now)
    for name, value in given.items():
        setattr(made, name, value)
    return made


def feed(made, now):
    """Give a servo good inputs of a time."""
    made.twist = StampedInput((0.0, 0.01, 0.0), now)
    made.rollers = StampedInput(RollerState(HOME, HOME), now)
    made.pose = StampedInput(Pose(*CENTER, 0.0), now)


@pytest.mark.parametrize(('age', 'used'), [(0.19, True), (0.21, False), (100.0, False)])
def test_an_estimate_regulates_the_squeeze_while_it_is_fresh(age, used):
    estimate = EstimatedTravel(HOME, 30.0, 1.0)
    made = servo(squeeze=NotedSqueeze(), estimate=StampedInput(estimate, NOW - age))
    assert made.decide(NOW).command.status < Status.HALT_NO_TWIST
    assert made.squeeze.estimates == [estimate if used else None]


def test_a_late_loop_counts_no_more_than_the_timeout_as_one_cycle():
    made = servo(squeeze=NotedSqueeze())
    for now in (NOW, NOW + 0.05, NOW + 10.0):
        feed(made, now)
        assert made.decide(now).command.status < Status.HALT_NO_TWIST
    assert made.squeeze.elapsed == pytest.approx([0.0, 0.05, TIMEOUT])


def test_corrected_zeros_are_no_travel_of_the_encoders():
    seen = []
    detector = SimpleNamespace(
        failed=frozenset(), update=lambda positions, *_: seen.append(positions.tolist())
    )
    made = servo(detector=detector)
    offsets = np.linspace(0.005, 0.01, len(HOME))
    state = RollerState(0.02 + HOME + offsets, HOME, offsets)
    made.rollers = StampedInput(state, NOW)
    made.decide(NOW)
    assert seen == [pytest.approx((0.02 + HOME).tolist())]


@pytest.mark.parametrize('elapsed', [0.02, 0.2, 0.5])
def test_the_correction_of_a_late_loop_takes_half_of_the_error_at_most(elapsed):
    config, body = gripped(35.0, squeeze=0.1)
    grip = Grip.at_module(config.robot, 'north/Z', body, 0.5)
    loop = SqueezeLoop(config, grip, pose_gain=4.0)
    loop.run((0.0, 0.0, 0.0), 0.1)
    control, twists = loop.control, []
    control.follow(loop.plant.config, grip.moved_to(loop.plant.object_pose), elapsed)
    error = 1e-3
    control.reference = control.reference + np.array([error, 0.0, 0.0])

    def solve(twist, _opening):
        twists.append(twist)
        return RollerCommand(HOME, np.zeros(3), 1.0, Status.OK)

    control.solve(np.zeros(3), 0.02, solve)
    rate = min(4.0, 0.5 / elapsed)
    assert twists[0][0] == pytest.approx(rate * error, abs=0.1 * rate * error)
