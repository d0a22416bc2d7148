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


class Rollers:
    """
    Client that sends trajectories, and observer of the commands.

    :param still: whether the probe tells joint states, of rollers that stand still at home.
    """

    def __init__(self, w, still=False):
        self.w = w
        self._publisher = w.probe.create_publisher(JointTrajectory, TOPIC, QoSProfile(depth=10))
        self.tell = w.probe.send_joints if still else (lambda: None)
        self.until(lambda: self._publisher.get_subscription_count() > 0)
        self.until(lambda: w.probe.last('joints') is not None)
        # A node that has not heard of the rollers refuses every trajectory.
        self.until(lambda: w.nodes[1].describe()['age of joint states [s]'] != 'none received')

    def until(self, what):
        """Spin until something holds."""
        self.w.until(what, self.tell)

    def spin(self, duration):
        """Spin for a while."""
        self.w.spin(duration, self.tell)

    def send(self, message):
        """Send a trajectory; discard earlier commands."""
        self.w.probe.seen['command'].clear()
        self._publisher.publish(message)

    def commands(self):
        """Return all commands since then, (k, r)."""
        reported = [m.data for _, m in self.w.probe.seen['command']]
        return np.array(reported).reshape(len(reported), N)

    def moves(self):
        """Return whether the last command moves a roller."""
        return bool(len(self.commands())) and self.commands()[-1].any()

    def places(self):
        """Return where the rollers were in all joint states (k, r) [m]."""
        return np.array([m.position for _, m in self.w.probe.seen['joints']])

    def until_moving(self, message):
        """Send a trajectory and wait until it moves the rollers."""
        self.send(message)
        self.until(self.moves)

    def until_still(self):
        """Wait until no trajectory is followed; check that a zero command was the last word."""
        self.until(lambda: not self.follows())
        self.until(lambda: len(self.commands()) and not self.moves())
        self.spin(SILENCE)  # for what was on its way
        count = len(self.commands())
        self.spin(SILENCE)
        assert not self.commands()[count:].any()
        assert not self.moves()
        assert np.abs(self.commands()).max() <= MAX_SPEED

    def follows(self):
        """Return whether the node follows a trajectory."""
        return 'time on the trajectory [s]' in self.w.nodes[1].describe()

    def said(self):
        """Return the present message of the diagnostics."""
        self.w.probe.seen['diagnostics'].clear()
        self.w.nodes[1].diagnostics.report()
        self.until(lambda: self.w.report('manipulation').name)
        return self.w.report('manipulation').message


# With the simulator


def test_follows_a_trajectory_and_rests_at_its_end():
    with world(node(), simulator()) as w:
        rollers = Rollers(w)
        rollers.until_moving(trajectory(HOME, AWAY, 0.5 * AWAY, times=[0.0, 0.5, 0.8]))
        rollers.until_still()
        assert rollers.said() == 'the rollers have arrived'
        rollers.until(lambda: not any(w.probe.last('joints').velocity))
        assert np.abs(rollers.places()[-1] - 0.5 * AWAY).max() <= TOLERANCE
        # The way leads over the point between.
        assert np.abs(rollers.places() - AWAY).max(axis=1).min() < 5e-3
        # It takes the time that it should, and what the last 20 um take.
        moving = [t for t, m in w.probe.seen['command'] if any(m.data)]
        assert moving[-1] - moving[0] > 0.7


# What ends it


@pytest.mark.parametrize('events', [[(1, 0), (0, 1)], [(1, 1)]], ids=['in two', 'in one'])
def test_a_publisher_that_left_before_its_trajectory_was_received_ends_the_active_one(
    events, capfd
):
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
        rollers.until_still()
        assert rollers.said().startswith(f'trajectory aborted: {lost}')
        # One that was received is no longer waited for.
        rollers.spin(1.1 * MATCH_DELAY)
        report_matches(manipulation, TOPIC, (1, 0))
        rollers.until_moving(trajectory(rollers.places()[-1], HOME, times=[0.0, 20.0]))
        report_matches(manipulation, TOPIC, (0, 1))
        rollers.spin(SILENCE)
        assert rollers.follows()


def test_twists_are_ignored_during_a_trajectory():
    with world(node(), simulator()) as w:
        rollers = Rollers(w)
        assert 'twist: none received yet' in rollers.said()
        rollers.until_moving(trajectory(HOME, AWAY))
        rollers.tell = lambda: w.probe.send_twist() if rollers.follows() else None
        rollers.until(lambda: not rollers.follows())
        rollers.until_still()
        assert rollers.said() == 'the rollers have arrived'
        assert np.abs(rollers.places()[-1] - AWAY).max() <= TOLERANCE
        # A twist that comes afterwards does.
        w.probe.send_twist()
        rollers.until(lambda: 'arrived' not in rollers.said())


def test_an_emergency_stop_ends_the_trajectory_and_rejects_new_ones():
    with world(node()) as w:
        rollers = Rollers(w, still=True)
        rollers.until_moving(trajectory(HOME, AWAY))
        w.probe.stops.publish(Bool(data=True))
        rollers.until_still()
        for pressed in (True, False):
            w.probe.stops.publish(Bool(data=pressed))
            still = 'its last message is true' if pressed else 'its last message is false'
            rollers.until(lambda words=still: words in w.nodes[1].describe()['emergency stop'])
            rollers.send(trajectory(HOME, AWAY))
            rollers.until(lambda words=still: f'{STOPPED}; {words}' in rollers.said())
            rollers.spin(0.1)
            assert not rollers.commands().any()
            assert w.release_stop().success is not pressed
        assert w.nodes[1].describe()['emergency stop'] == 'no'
        rollers.spin(0.1)
        assert not rollers.commands().any()  # nothing goes on by itself
        assert f'trajectory rejected: {STOPPED}' in rollers.said()
        rollers.until_moving(trajectory(HOME, AWAY))


BAD_STATES = {
    'nan': {'position': [math.nan] * N},
    'old': {'age': 9.0},
    'in the future': {'age': -9.0},
}


@pytest.mark.parametrize('case', BAD_STATES)
def test_stops_on_invalid_joint_states_and_does_not_begin_on_them(case):
    with world(node(command_timeout=2.0)) as w:
        rollers = Rollers(w, still=True)
        rollers.until_moving(trajectory(HOME, AWAY))
        w.until(lambda: not rollers.moves(), lambda: w.probe.send_joints(**BAD_STATES[case]))
        rollers.tell = lambda: w.probe.send_joints(**BAD_STATES[case])
        rollers.until_still()
        assert 'trajectory aborted: joint states' in rollers.said()
        rollers.send(trajectory(HOME, AWAY))
        rollers.until(lambda: 'trajectory rejected: joint states' in rollers.said())
        assert not rollers.commands().any()


def bent(**changes):
    """Return a trajectory of which the second point is changed."""
    made = trajectory(HOME, AWAY, 0.5 * AWAY)
    for name, value in changes.items():
        setattr(made.points[1], name, value)
    return made


def stamped(seconds, nanosec=0):
    """Return a trajectory that says for when it is meant."""
    made = trajectory(HOME, AWAY)
    made.header.stamp = Time(sec=seconds, nanosec=nanosec)
    return made


ROW = [0.0] * N
HOSTILE = {
    'nan': (bent(positions=[math.nan] * N), 'must be 6 finite numbers'),
    '-1e308': (bent(positions=[*ROW[:-1], -1e308]), 'at most 1e+06 m'),
    'too quick': (bent(time_from_start=lasting(0.1)), '0.2 m/s; must be at most 0.1'),
    'times back': (trajectory(HOME, AWAY, AWAY, times=[0.0, 1.0, 0.5]), 'time 0.5 s of point 2'),
    'no names': (trajectory(HOME, AWAY, names=[]), 'joint_names: south/P, '),
    'too many names': (trajectory(HOME, AWAY, names=[*NAMES, 'north/P']), "'north/P': must be"),
    'points without end': (
        trajectory(*[ROW] * (MAX_POINTS + 1), times=0.01 * np.arange(MAX_POINTS + 1)),
        f'{MAX_POINTS + 1} points; must be 1 to {MAX_POINTS}',
    ),
    'elsewhere': (
        trajectory(AWAY, HOME),
        'the trajectory begins 0.02 m from the measured position',
    ),
    'long ago': (stamped(0, 1), 's old; must be at most'),
    'in the future': (stamped(2**31 - 1), 'in the future'),
}


def test_invalid_trajectories_are_rejected_and_end_the_active_one():
    with world(node()) as w:
        rollers = Rollers(w, still=True)
        for name, (message, words) in HOSTILE.items():
            rollers.until_moving(trajectory(HOME, AWAY))
            rollers.send(message)

            def refused(words=words):
                return all(part in rollers.said() for part in ('trajectory rejected: ', words))

            rollers.until(refused)
            assert len(rollers.said()) < 3000, name
            rollers.until(lambda: not rollers.moves())
            assert not rollers.follows(), name
        rollers.until_still()
        # No harm done.
        rollers.until_moving(trajectory(HOME, AWAY))


# Clocks, parameters, diagnostics
