# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Roller trajectories as goals of an action, in the shape of FollowJointTrajectory."""

from action_msgs.msg import GoalInfo, GoalStatus
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from isotruss_msgs.action import FollowRollerTrajectory
from isotruss_ros.core import Status
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.simulator.node import Simulator
from lifecycle_msgs.msg import Transition
from manual_world import Manager, world
import numpy as np
from probe import failed, overrides, ROBOT
import pytest
from std_msgs.msg import Bool
from trajectories import AWAY, HOME, TOPIC, trajectory
from trajectory_msgs.msg import JointTrajectory

TIMEOUT = 2.0
Result = FollowRollerTrajectory.Result


@pytest.fixture
def w():
    """Return a simulator and the node, with measured rollers."""
    makers = [
        lambda kind=kind: kind(overrides(command_timeout=TIMEOUT))
        for kind in (Simulator, Manipulation)
    ]
    with world(*makers) as made:
        ready = 'age of joint states [s]'
        made.until(lambda: made.nodes[2].describe()[ready] != 'none received')
        yield made


def send(w, *rows, times=None):
    """Send a goal, return it."""
    return w.send_goal(FollowRollerTrajectory.Goal(trajectory=trajectory(*rows, times=times)))


def ending(w, goal):
    """Return how a goal ends."""
    w.until(lambda: goal.ended)
    return goal.result()


def test_the_rollers_arrive_and_the_goal_succeeds(w):
    goal = send(w, HOME, AWAY)
    status, result = ending(w, goal)
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
    ended, result = ending(w, goal)
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


@pytest.mark.parametrize(
    'how', ['stop', 'goal', 'topic', 'deactivate', 'empty', 'failed', 'other']
)
def test_what_ends_a_trajectory_aborts_its_goal(w, how):
    topic = w.probe.create_publisher(JointTrajectory, TOPIC, 1)
    stop = w.probe.create_publisher(Bool, 'emergency_stop', 1)
    goal = send(w, HOME, AWAY, times=[0.0, 3.0])
    w.until(lambda: len(goal.feedback) > 1)
    here = np.array(w.probe.last('joints').position)
    if how == 'stop':
        stop.publish(Bool(data=True))
    elif how == 'goal':
        newer = send(w, here, HOME)
    elif how == 'topic':
        topic.publish(trajectory(here, HOME))
    elif how == 'empty':
        topic.publish(JointTrajectory())
    elif how == 'failed':
        w.probe.create_publisher(DiagnosticArray, 'failed_rollers', 1).publish(failed('nobody'))
    elif how == 'other':
        w.probe.send_command(HOME)
    else:
        assert Manager(w, 'manipulation').ask(Transition.TRANSITION_DEACTIVATE)
    status, result = ending(w, goal)
    assert status == GoalStatus.STATUS_ABORTED
    assert result.error_code == Result.PATH_TOLERANCE_VIOLATED
    words = {
        'stop': 'emergency',
        'deactivate': 'deactivated',
        'empty': 'empty',
        'failed': 'no such roller',
        'other': 'another node publishes',
    }
    assert words.get(how, 'newer') in result.error_string
    if how == 'goal':
        assert ending(w, newer)[0] == GoalStatus.STATUS_SUCCEEDED
    if how in ('goal', 'topic'):
        w.until(lambda: np.abs(w.probe.last('joints').position).max() < 1e-4)
    else:
        w.until(lambda: not w.command().any())


def test_a_goal_while_a_trajectory_of_the_topic_is_followed_takes_over(w):
    topic = w.probe.create_publisher(JointTrajectory, TOPIC, 1)
    topic.publish(trajectory(HOME, AWAY, times=[0.0, 3.0]))
    w.until(lambda: np.abs(w.probe.last('joints').position).max() > 1e-3)
    here = np.array(w.probe.last('joints').position)
    assert ending(w, send(w, here, HOME))[0] == GoalStatus.STATUS_SUCCEEDED


def test_a_supervised_goal_ends_with_its_client(w):
    supervision = w.probe.create_publisher(GoalInfo, 'supervised_goal', 1)
    goal = send(w, HOME, AWAY, times=[0.0, 60.0])
    w.spin(2.0 * TIMEOUT, lambda: supervision.publish(goal.info))
    assert not goal.ended
    silent = w.now
    status, result = ending(w, goal)
    assert status == GoalStatus.STATUS_ABORTED
    assert 'command_timeout' in result.error_string
    assert w.now - silent < TIMEOUT + 0.1
    w.until(lambda: not w.command().any())


def test_a_goal_that_is_not_supervised_goes_on(w):
    supervision = w.probe.create_publisher(GoalInfo, 'supervised_goal', 1)
    supervision.publish(GoalInfo())
    goal = send(w, HOME, AWAY, times=[0.0, 60.0])
    w.spin(2.0 * TIMEOUT)
    assert not goal.ended


def test_goals_are_rejected_while_the_node_is_inactive(w):
    assert Manager(w, 'manipulation').ask(Transition.TRANSITION_DEACTIVATE)
    assert not send(w, HOME, AWAY).accepted


def test_a_goal_without_joint_states_is_aborted_at_once():
    with world(lambda: Manipulation(overrides(command_timeout=TIMEOUT))) as w:
        status, result = ending(w, send(w, HOME, AWAY))
    assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert 'none received yet' in result.error_string
