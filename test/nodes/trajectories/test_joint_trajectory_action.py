# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The standard trajectory action with its meaning, and our own, which means the same."""

from action_msgs.msg import GoalInfo, GoalStatus
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from isotruss_msgs.action import FollowRollerTrajectory
from isotruss_msgs.msg import RollerTolerance
from isotruss_ros.core import Status
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.simulator.node import Simulator
from lifecycle_msgs.msg import Transition
from manual_world import Manager, world
import numpy as np
from probe import failed, overrides, ROBOT
import pytest
from std_msgs.msg import Bool
from trajectories import AWAY, FollowJointTrajectory, HOME, lasting, NAMES, TOPIC, trajectory
from trajectory_msgs.msg import JointTrajectory

Result = FollowRollerTrajectory.Result
TIMEOUT = 2.0
KINDS = {'standard': FollowJointTrajectory, 'own': FollowRollerTrajectory}
SUCCEEDED = (GoalStatus.STATUS_SUCCEEDED, Result.SUCCESSFUL)


@pytest.fixture(params=KINDS)
def kind(request):
    return KINDS[request.param]


@pytest.fixture
def make(monkeypatch):
    FollowJointTrajectory.install(monkeypatch)
    return lambda **faults: world(
        lambda: Simulator(overrides(command_timeout=TIMEOUT, rate=50.0, **faults)),
        lambda: Manipulation(overrides(command_timeout=TIMEOUT, rate=50.0)),
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
            goal_time_tolerance=lasting(late),
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
        ({'goal_time_tolerance': lasting(0.3)}, Result.GOAL_TOLERANCE_VIOLATED, 1.0),
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


def test_an_old_stamp_has_its_code(make):
    with make() as w:
        goal = send(w, HOME, AWAY, stamp=-3.0)
        assert ended(w, goal) == aborted(Result.OLD_HEADER_TIMESTAMP)


@pytest.mark.parametrize('names', [NAMES[:-1], [*NAMES[:-1], 'W'], [*NAMES[:-1], NAMES[0]], []])
def test_joints_that_are_not_those_of_the_robot_have_their_code(make, names):
    with make() as w:
        rows = [row[: len(names)] for row in (HOME, AWAY)]
        goal = send(w, *rows, names=names)
        assert ended(w, goal) == aborted(Result.INVALID_JOINTS)


#: Goals that cannot be followed, with words of the reason; unusable points are in
#: test_trajectory_following.
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
    status, result = w.finish(goal)
    assert (status, result.error_code) == (GoalStatus.STATUS_SUCCEEDED, Result.SUCCESSFUL)
    assert np.array(w.probe.last('joints').position) == pytest.approx(AWAY, abs=1e-4)
    desired = [feedback.desired for feedback in goal.feedback]
    assert len(desired) > 3
    for feedback in goal.feedback:
        parts = (feedback.desired, feedback.actual, feedback.error)
        wanted, there, error = (np.array(part.positions) for part in parts)
        assert feedback.joint_names == list(ROBOT.roller_names)
        assert error == pytest.approx(wanted - there, abs=1e-12)
        assert np.abs(error).max() < 5e-3


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
    w.spin(2.0 * TIMEOUT, lambda: supervision.publish(goal.info))
    assert not goal.ended
    silent = w.now
    status, result = w.finish(goal)
    assert status == GoalStatus.STATUS_ABORTED
    assert 'command_timeout' in result.error_string
    assert w.now - silent < TIMEOUT + 0.1
    w.until(lambda: not w.command().any())
