# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories of the rollers: by topic, by our own action and by the standard action."""

import math

from action_msgs.msg import GoalInfo, GoalStatus
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from isotruss_msgs.action import FollowRollerTrajectory
from isotruss_msgs.msg import RollerTolerance
from isotruss_ros.core import Status
from isotruss_ros.core.paths.roller_trajectory import TOLERANCE
from isotruss_ros.nodes.conversions.messages import read_stamp
from isotruss_ros.nodes.conversions.path_messages import read_duration, to_duration
from isotruss_ros.nodes.conversions.trajectory_goals import MAX_POINTS
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.manipulation.sparse_messages import MATCH_DELAY
from isotruss_ros.nodes.simulator.node import Simulator
from lifecycle_msgs.msg import Transition
from manual_world import Manager, report_matches, world
import numpy as np
from probe import failed, maker, N, overrides, ROBOT
import pytest
from rclpy.action import get_action_server_names_and_types_by_node
from rclpy.qos import QoSProfile
from std_msgs.msg import Bool
from trajectories import AWAY, FollowJointTrajectory, HOME, NAMES, TOPIC, trajectory
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
    'too quick': (bent(time_from_start=to_duration(0.1)), '0.2 m/s; must be at most 0.1'),
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


Result = FollowRollerTrajectory.Result
GOAL_TIMEOUT = 2.0
KINDS = {'standard': FollowJointTrajectory, 'own': FollowRollerTrajectory}
SUCCEEDED = (GoalStatus.STATUS_SUCCEEDED, Result.SUCCESSFUL)


@pytest.fixture(params=KINDS)
def kind(request):
    return KINDS[request.param]


@pytest.fixture
def make(monkeypatch):
    FollowJointTrajectory.install(monkeypatch)
    return lambda **faults: world(
        lambda: Simulator(overrides(command_timeout=GOAL_TIMEOUT, rate=50.0, **faults)),
        lambda: Manipulation(overrides(command_timeout=GOAL_TIMEOUT, rate=50.0)),
    )


def send(w, *rows, kind=FollowRollerTrajectory, stamp=None, times=None, names=NAMES, **fields):
    """Send a goal once the rollers are measured; return it."""
    w.until(lambda: w.nodes[2].describe()['age of joint states [s]'] != 'none received')
    message = trajectory(*rows, times=times, names=names)
    if stamp is not None:
        nanoseconds = round(1e9 * (w.probe.past(0.0) + stamp))
        message.header.stamp = Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
    return w.send_goal(kind.Goal(trajectory=message, **fields))


def ended(w, goal):
    status, result = w.finish(goal)
    return status, result.error_code


def aborted(code):
    return GoalStatus.STATUS_ABORTED, code


def test_one_point_is_driven_to_from_where_the_rollers_are(make, kind):
    with make() as w:
        assert ended(w, send(w, AWAY, kind=kind, times=[0.5])) == SUCCEEDED
        assert w.travel() == pytest.approx(AWAY, abs=1e-4)


@pytest.mark.parametrize(
    ('kind', 'tolerance', 'late', 'ending'),
    [
        ('own', 1e-9, 1.2, aborted(Result.GOAL_TOLERANCE_VIOLATED)),
        ('standard', 1e-9, 0.0, aborted(Result.GOAL_TOLERANCE_VIOLATED)),
        ('own', 1e-3, 0.2, SUCCEEDED),
        ('standard', -1.0, 0.2, SUCCEEDED),
        ('own', 0.0, 0.5, SUCCEEDED),
    ],
    indirect=['kind'],
)
def test_the_goal_tolerance_is_kept(make, kind, tolerance, late, ending):
    with make(encoder_step=7e-6) as w:
        goal = send(
            w,
            HOME,
            AWAY,
            kind=kind,
            goal_tolerance=[RollerTolerance(name=name, position=tolerance) for name in NAMES],
            goal_time_tolerance=to_duration(late),
        )
        began = w.now
        assert ended(w, goal) == ending
        if ending != SUCCEEDED and late:
            assert w.now - began == pytest.approx(0.4 + late, abs=0.1)


def bound(**limits):
    """Return the field of a goal that bounds the errors of the first roller."""
    return {'path_tolerance': [RollerTolerance(name=NAMES[0], **limits)]}


@pytest.mark.parametrize(
    ('fields', 'code', 'longest'),
    [
        ({'goal_time_tolerance': to_duration(0.3)}, Result.GOAL_TOLERANCE_VIOLATED, 1.0),
        (bound(position=2e-3), Result.PATH_TOLERANCE_VIOLATED, 0.4),
        (bound(velocity=0.02), Result.PATH_TOLERANCE_VIOLATED, 0.4),
    ],
)
def test_a_stuck_roller_violates_the_tolerance_in_time_and_is_named(make, fields, code, longest):
    with make(stuck_roller=NAMES[0]) as w:
        goal = send(w, HOME, AWAY, **fields)
        began = w.now
        assert ended(w, goal) == aborted(code)
        assert w.now - began < longest
        assert f'roller {NAMES[0]} ' in goal.result()[1].error_string


def test_a_stamp_in_the_future_begins_then(make):
    with make() as w:
        goal = send(w, HOME, AWAY, stamp=2.0)
        w.spin(1.9)
        assert not w.travel().any()
        w.spin(0.2)
        assert w.travel().any()
        assert ended(w, goal) == SUCCEEDED


@pytest.mark.parametrize(
    ('names', 'stamp', 'code'),
    [
        (NAMES, -3.0, Result.OLD_HEADER_TIMESTAMP),
        (NAMES[:-1], None, Result.INVALID_JOINTS),
        ([*NAMES[:-1], 'W'], None, Result.INVALID_JOINTS),
        ([*NAMES[:-1], NAMES[0]], None, Result.INVALID_JOINTS),
        ([], None, Result.INVALID_JOINTS),
    ],
)
def test_an_old_stamp_and_joints_of_another_robot_have_their_codes(make, names, stamp, code):
    with make() as w:
        rows = [row[: len(names)] for row in (HOME, AWAY)]
        assert ended(w, send(w, *rows, names=names, stamp=stamp)) == aborted(code)


#: Goals that cannot be followed, with words of the reason.
HOPELESS = {
    'elsewhere': ([HOME + 0.1, AWAY + 0.1], {}, 'must begin within 0.01 m'),
    'no tolerance': ([HOME, AWAY], bound(position=-2.0), 'must be positive, 0 or -1'),
    'acceleration': ([HOME, AWAY], bound(acceleration=1.0), 'is not measured'),
}


@pytest.mark.parametrize('case', HOPELESS)
def test_a_goal_that_cannot_be_followed_is_rejected_with_the_reason(make, kind, case, capfd):
    rows, fields, words = HOPELESS[case]
    with make() as w:
        running = send(w, HOME, AWAY, kind=kind, times=[0.0, 3.0])
        goal = send(w, *rows, kind=kind, **fields)
        if kind is FollowJointTrajectory:
            assert not goal.accepted
        else:
            assert ended(w, goal) == aborted(Result.INVALID_GOAL)
            assert words in goal.result()[1].error_string
        # The one under way goes on.
        assert not running.ended
    assert words in capfd.readouterr().err


@pytest.fixture
def w(make):
    with make() as made:
        yield made


def test_the_rollers_arrive_within_the_path_tolerance_and_the_goal_succeeds(w):
    bounds = [RollerTolerance(name=name, position=2e-3) for name in NAMES]
    goal = send(w, HOME, AWAY, path_tolerance=bounds)
    assert ended(w, goal) == SUCCEEDED
    assert np.array(w.probe.last('joints').position) == pytest.approx(AWAY, abs=1e-4)
    assert len(goal.feedback) > 3
    for feedback in goal.feedback:
        parts = (feedback.desired, feedback.actual, feedback.error)
        wanted, there, error = (np.array(part.positions) for part in parts)
        assert feedback.joint_names == list(ROBOT.roller_names)
        assert feedback.header.frame_id == 'truss'
        assert error == pytest.approx(wanted - there, abs=1e-12)
        assert np.abs(error).max() < 5e-3
    stamps = np.array([read_stamp(feedback.header) for feedback in goal.feedback])
    times = [read_duration(feedback.desired.time_from_start) for feedback in goal.feedback]
    assert times == pytest.approx(np.minimum(stamps - stamps[0] + times[0], times[-1]), abs=1e-6)


def test_standard_action_has_the_name_of_the_joint_trajectory_controller(make):
    with make() as w:
        found = get_action_server_names_and_types_by_node(w.nodes[2], 'manipulation', '/')
        assert '/joint_trajectory_controller/follow_joint_trajectory' in dict(found)


def test_a_cancelled_goal_leaves_the_rollers_at_rest(w):
    goal = send(w, HOME, AWAY, times=[0.0, 3.0])
    w.until(lambda: len(goal.feedback) > 3)
    w.probe.seen['diagnostics'].clear()
    assert goal.cancel()
    ended, result = w.finish(goal)
    assert ended == GoalStatus.STATUS_CANCELED
    assert 'cancelled by the client' in result.error_string
    status = w.until_code(Status.HALT_NO_TWIST, lambda: None)
    assert status.message == 'trajectory cancelled by the client'
    w.until(lambda: not w.command().any())
    w.spin(2.0)
    assert not w.command().any()
    # It is no fault.
    levels = [array.status[0].level for _, array in w.probe.seen['diagnostics']]
    assert {*levels} == {DiagnosticStatus.OK}


def publish(kind, topic, message):
    return lambda w: w.probe.create_publisher(kind, topic, 1).publish(message)


def deactivate(w):
    assert Manager(w, 'manipulation').ask(Transition.TRANSITION_DEACTIVATE)


#: What ends a trajectory, words of the reason, and whether the rollers go back home then.
ENDS = {
    'stop': (publish(Bool, 'emergency_stop', Bool(data=True)), 'emergency', False),
    'goal': (lambda w: send(w, HOME, times=[0.5]), 'newer', True),
    'topic': (publish(JointTrajectory, TOPIC, trajectory(HOME, times=[0.5])), 'newer', True),
    'deactivate': (deactivate, 'deactivated', False),
    'empty': (publish(JointTrajectory, TOPIC, JointTrajectory()), 'empty', False),
    'failed': (publish(DiagnosticArray, 'failed_rollers', failed('W')), 'no such roller', False),
    'other': (lambda w: w.probe.send_command(HOME), 'another node publishes', False),
    'clock': (lambda w: setattr(w, 'shift', -100.0), 'the clock jumped back', False),
}


@pytest.mark.parametrize('how', ENDS)
def test_what_ends_a_trajectory_aborts_its_goal(w, how):
    end, words, is_replaced = ENDS[how]
    goal = send(w, HOME, AWAY, times=[0.0, 3.0])
    w.until(lambda: len(goal.feedback) > 1)
    newer = end(w)
    status, result = w.finish(goal)
    assert (status, result.error_code) == aborted(Result.PATH_TOLERANCE_VIOLATED)
    assert words in result.error_string
    if is_replaced:
        w.until(lambda: np.abs(w.probe.last('joints').position).max() < 1e-4)
    else:
        w.until(lambda: not w.command().any())
    assert how != 'goal' or ended(w, newer) == SUCCEEDED


def test_a_supervised_goal_ends_with_its_client(w):
    supervision = w.probe.create_publisher(GoalInfo, 'supervised_goal', 1)
    goal = send(w, HOME, AWAY, times=[0.0, 60.0])
    w.spin(2.0 * GOAL_TIMEOUT, lambda: supervision.publish(goal.info))
    assert not goal.ended
    silent = w.now
    status, result = w.finish(goal)
    assert status == GoalStatus.STATUS_ABORTED
    assert 'command_timeout' in result.error_string
    assert w.now - silent < GOAL_TIMEOUT + 0.1
    w.until(lambda: not w.command().any())
