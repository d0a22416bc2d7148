"""The servo decides from samples alone: no middleware, no clock but the one it is told."""

from isotruss_ros.core import (
    Grasp,
    HeldObject,
    load_robot,
    Refusal,
    RollerState,
    Sample,
    snug_center,
    Status,
    TwistServo,
)
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
MODULE, DIAMETER = 'north/Z', 0.3
CENTER = snug_center(ROBOT.home, MODULE, DIAMETER)
HOME = np.zeros(len(ROBOT.roller_names))
NOW = 1000.0


def at(positions, velocities=0.0 * HOME):
    """Return a roller state."""
    return RollerState(np.asarray(positions), np.asarray(velocities))


INPUTS = ('twist', 'rollers', 'center')


def servo(**given):
    """Return a servo with good inputs at NOW, or those given."""
    made = TwistServo(ROBOT, MODULE, DIAMETER, period=0.005, timeout=0.2)
    made.twist = Sample((0.0, 0.02, 0.1), NOW)
    made.rollers = Sample(at(HOME), NOW)
    made.center = Sample(CENTER, NOW)
    for name, value in given.items():
        setattr(made, name, value)
    return made


def test_moves_when_all_is_known():
    decision = servo().decide(NOW)
    assert decision.command.status is Status.OK
    assert decision.message == ''
    assert decision.command.achieved_twist == pytest.approx([0.0, 0.02, 0.1], abs=1e-9)


@pytest.mark.parametrize(
    ('name', 'missing', 'stale', 'invalid'),
    [
        ('twist', Status.HALT_NO_TWIST, Status.HALT_NO_TWIST, Status.HALT_INVALID_TWIST),
        (
            'rollers',
            Status.HALT_NO_JOINT_STATES,
            Status.HALT_STALE_JOINT_STATES,
            Status.HALT_INVALID_JOINT_STATES,
        ),
        (
            'center',
            Status.HALT_NO_OBJECT_POSE,
            Status.HALT_STALE_OBJECT_POSE,
            Status.HALT_INVALID_OBJECT_POSE,
        ),
    ],
)
def test_halts_with_the_status_of_each_doubt(name, missing, stale, invalid):
    good = getattr(servo(), name)
    for given, status in (
        (None, missing),
        (good._replace(time=NOW - 0.201), stale),
        (Refusal('not a number'), invalid),
        (good._replace(time=NOW + 0.201), invalid),
    ):
        decision = servo(**{name: given}).decide(NOW)
        assert decision.command.status is status
        assert decision.message
        assert not decision.command.roller_velocities.any()
        assert not decision.command.achieved_twist.any()
        assert decision.command.scale == 0.0


@pytest.mark.parametrize('name', INPUTS)
def test_an_input_is_good_until_the_timeout(name):
    good = getattr(servo(), name)
    made = servo(**{name: good._replace(time=NOW - 0.199)})
    assert made.decide(NOW).command.status is Status.OK


def test_halts_without_a_grasp_and_where_no_configuration_is():
    assert servo(center=Sample((5.0, 5.0), NOW)).decide(NOW).command.status is Status.HALT_NO_GRASP
    impossible = Sample(at([5.0, 0, 0, 0, 0, 0]), NOW)
    decision = servo(rollers=impossible).decide(NOW)
    assert decision.command.status is Status.HALT_KINEMATICS


def test_history_does_not_matter():
    """A servo that has been elsewhere decides as a new one does."""
    there = np.linspace(-0.1, 0.12, len(HOME))
    config = ROBOT.configuration(there)
    center = snug_center(config, MODULE, DIAMETER)
    travelled = servo()
    travelled.decide(NOW)
    travelled.rollers = Sample(at([9.0, 0, 0, 0, 0, 0]), NOW)
    travelled.decide(NOW)
    for made in (travelled, fresh := servo()):
        made.rollers, made.center = Sample(at(there), NOW), Sample(center, NOW)
    assert travelled.decide(NOW).command.roller_velocities == pytest.approx(
        fresh.decide(NOW).command.roller_velocities, abs=1e-10
    )


def test_looks_ahead_by_the_age_of_the_state_and_half_a_period():
    """The command for an old state of a moving robot is that for where it is by now."""
    speeds = servo().decide(NOW).command.roller_velocities
    made = servo(rollers=Sample(at(HOME, speeds), NOW - 0.05))
    made.period = 0.02
    late = made.decide(NOW).command.roller_velocities
    lead = 0.05 + 0.01
    # To first order in the way: 0.0012 m here, so 1e-6 m off in a robot of 1 m, and 1e-6 in speed.
    moved = ROBOT.configuration(lead * speeds)
    held = HeldObject.attach(ROBOT.home, Grasp(MODULE, CENTER, DIAMETER))
    there = servo(
        rollers=Sample(at(moved.roller_positions), NOW), center=Sample(held.pose(moved)[:2], NOW)
    )
    exact = there.decide(NOW).command.roller_velocities
    assert np.abs(late - exact).max() < 1e-5 * np.abs(exact).max()
    assert np.abs(late - speeds).max() > 1e-5


def test_says_what_limits():
    decision = servo(twist=Sample((0.0, 3.0, 0.0), NOW)).decide(NOW)
    assert decision.command.status is Status.SLOWED_ROLLER_SPEED
    for name in decision.command.limiting:
        assert name in decision.message
