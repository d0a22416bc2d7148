# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node `manipulation` follows trajectories of the rollers: alone, and with the simulator."""

import math

from builtin_interfaces.msg import Time
from isotruss_ros.core.paths.roller_trajectory import TOLERANCE
from isotruss_ros.nodes.conversions.trajectory_goals import MAX_POINTS
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.manipulation.sparse_messages import MATCH_DELAY
from isotruss_ros.nodes.simulator.node import Simulator
from manual_world import report_matches, world
import numpy as np
from probe import maker, N, ROBOT
import pytest
from rclpy.qos import QoSProfile
from std_msgs.msg import Bool
from trajectories import AWAY, HOME, lasting, NAMES, TOPIC, trajectory
from trajectory_msgs.msg import JointTrajectory

MAX_SPEED = ROBOT.description.max_speed
#: Long: a busy machine delays, and most tests are not about that.
TIMEOUT = 5.0
STOPPED = 'stopped by the topic emergency_stop'
#: Some cycles of the node [s].
SILENCE = 0.08
node = maker(Manipulation, command_timeout=TIMEOUT)
simulator = maker(Simulator, command_timeout=TIMEOUT)
BAD_STATES = {'nan': {'position': [math.nan] * N}, 'old': {'age': 9.0}, 'ahead': {'age': -9.0}}


class Rollers:
    """Client that sends trajectories, and observer of the commands."""

    def __init__(self, w, still=False):
        self.w = w
        self._publisher = w.probe.create_publisher(JointTrajectory, TOPIC, QoSProfile(depth=10))
        self.publish_states = w.probe.send_joints if still else (lambda: None)
        # Without joint states every trajectory is rejected.
        self.until(lambda: w.nodes[1].describe()['age of joint states [s]'] != 'none received')

    def until(self, holds):
        self.w.until(holds, self.publish_states)

    def spin(self, duration):
        self.w.spin(duration, self.publish_states)

    def send(self, message):
        """Send a trajectory; discard earlier commands."""
        self.w.probe.seen['command'].clear()
        self._publisher.publish(message)

    def until_moving(self, message):
        self.send(message)
        self.until(self.moves)

    def commands(self):
        """Return all commands since the last trajectory (k, r) [m/s]."""
        return np.array([m.data for _, m in self.w.probe.seen['command']]).reshape(-1, N)

    def moves(self):
        return self.commands()[-1:].any()

    def follows(self):
        return 'time on the trajectory [s]' in self.w.nodes[1].describe()

    def check_ended(self):
        """Check that no trajectory is followed any more, and that all commands are zero."""
        self.until(lambda: not self.follows() and len(self.commands()) and not self.moves())
        count = len(self.commands())
        self.spin(2.0 * SILENCE)
        assert not self.commands()[count:].any()
        assert np.abs(self.commands()).max() <= MAX_SPEED

    def message(self):
        self.w.probe.seen['diagnostics'].clear()
        self.w.nodes[1].diagnostics.report()
        self.until(lambda: self.w.report('manipulation').name)
        return self.w.report('manipulation').message


@pytest.mark.parametrize('events', [[(1, 0), (0, 1)], [(1, 1)]], ids=['in two', 'in one'])
def test_publisher_that_left_before_its_trajectory_was_received_ends_the_active_one(events, capfd):
    """It may have been another one, or the end."""
    lost = f'a publisher of {TOPIC} left before a message was received'
    with world(node(), simulator()) as w:
        manipulation = w.nodes[1]
        report_matches(manipulation, TOPIC, *events)
        assert lost in capfd.readouterr().err
        rollers = Rollers(w)
        rollers.until_moving(trajectory(HOME, 5.0 * AWAY, times=[0.0, 20.0]))
        rollers.spin(1.1 * MATCH_DELAY)
        report_matches(manipulation, TOPIC, *events)
        rollers.check_ended()
        assert rollers.message().startswith(f'trajectory aborted: {lost}')
        # One that was received is no longer waited for.
        rollers.spin(1.1 * MATCH_DELAY)
        report_matches(manipulation, TOPIC, (1, 0))
        rollers.until_moving(trajectory(w.travel(), HOME, times=[0.0, 20.0]))
        report_matches(manipulation, TOPIC, (0, 1))
        rollers.spin(SILENCE)
        assert rollers.follows()


def test_twists_are_ignored_during_a_trajectory():
    with world(node(), simulator()) as w:
        rollers = Rollers(w)
        assert 'twist: none received yet' in rollers.message()
        rollers.until_moving(trajectory(HOME, AWAY))
        rollers.publish_states = lambda: w.probe.send_twist() if rollers.follows() else None
        rollers.until(lambda: not rollers.follows())
        rollers.check_ended()
        assert rollers.message() == 'the rollers have arrived'
        assert np.abs(w.travel() - AWAY).max() <= TOLERANCE
        # A twist that comes afterwards does.
        w.probe.send_twist()
        rollers.until(lambda: 'arrived' not in rollers.message())


def test_an_emergency_stop_ends_the_trajectory_and_rejects_new_ones():
    with world(node()) as w:
        rollers = Rollers(w, still=True)
        rollers.until_moving(trajectory(HOME, AWAY))
        w.probe.stops.publish(Bool(data=True))
        rollers.check_ended()
        for pressed in (True, False):
            w.probe.stops.publish(Bool(data=pressed))
            still = 'its last message is true' if pressed else 'its last message is false'
            rollers.until(lambda words=still: words in w.nodes[1].describe()['emergency stop'])
            rollers.send(trajectory(HOME, AWAY))
            rollers.until(lambda words=still: f'{STOPPED}; {words}' in rollers.message())
            rollers.spin(0.1)
            assert not rollers.commands().any()
            assert w.release_stop().success is not pressed
        assert w.nodes[1].describe()['emergency stop'] == 'no'
        rollers.spin(0.1)
        assert not rollers.commands().any()  # nothing goes on by itself
        assert f'trajectory rejected: {STOPPED}' in rollers.message()
        rollers.until_moving(trajectory(HOME, AWAY))


@pytest.mark.parametrize('case', BAD_STATES)
def test_stops_on_invalid_joint_states_and_does_not_begin_on_them(case):
    with world(node(command_timeout=2.0)) as w:
        rollers = Rollers(w, still=True)
        rollers.until_moving(trajectory(HOME, AWAY))
        w.until(lambda: not rollers.moves(), lambda: w.probe.send_joints(**BAD_STATES[case]))
        rollers.publish_states = lambda: w.probe.send_joints(**BAD_STATES[case])
        rollers.check_ended()
        assert 'trajectory aborted: joint states' in rollers.message()
        rollers.send(trajectory(HOME, AWAY))
        rollers.until(lambda: 'trajectory rejected: joint states' in rollers.message())
        assert not rollers.commands().any()


def bent(**changes):
    result = trajectory(HOME, AWAY, 0.5 * AWAY)
    for name, value in changes.items():
        setattr(result.points[1], name, value)
    return result


def stamped(seconds, nanosec=0):
    result = trajectory(HOME, AWAY)
    result.header.stamp = Time(sec=seconds, nanosec=nanosec)
    return result


ROW = [0.0] * N
#: Positions between which and home the shape of the robot ends.
BEYOND = [0.9 * (name == 'south/Q') for name in NAMES]
HOSTILE = {
    'infinite': (bent(positions=[math.inf] * N), 'must be 6 finite numbers'),
    '-1e308': (bent(positions=[*ROW[:-1], -1e308]), 'at most 1e+06 m'),
    'too quick': (bent(time_from_start=lasting(0.1)), '0.2 m/s; must be at most 0.1'),
    'no shape': (trajectory(HOME, BEYOND, times=[0.0, 40.0]), 'no configuration exists beyond'),
    'times back': (trajectory(HOME, AWAY, AWAY, times=[0.0, 1.0, 0.5]), 'time 0.5 s of point 2'),
    'no names': (trajectory(HOME, AWAY, names=[]), 'joint_names: south/P, '),
    'too many names': (trajectory(HOME, AWAY, names=[*NAMES, 'north/P']), "'north/P': must be"),
    'points without end': (
        trajectory(*[ROW] * (MAX_POINTS + 1), times=0.01 * np.arange(MAX_POINTS + 1)),
        f'{MAX_POINTS + 1} points; must be 1 to {MAX_POINTS}',
    ),
    'elsewhere': (trajectory(AWAY, HOME), 'begins 0.02 m from the measured position'),
    'long ago': (stamped(0, 1), 's old; must be at most'),
    'in the future': (stamped(2**31 - 1), 'in the future'),
}


def test_invalid_trajectories_are_rejected_and_end_the_active_one():
    with world(node()) as w:
        rollers = Rollers(w, still=True)
        for name, (message, words) in HOSTILE.items():
            rollers.until_moving(trajectory(HOME, AWAY))
            rollers.send(message)
            rollers.until(lambda: not rollers.follows() and not rollers.moves())
            assert rollers.message().startswith('trajectory rejected: '), name
            assert words in rollers.message()
            assert len(rollers.message()) < 3000
        rollers.until_moving(trajectory(HOME, AWAY))
