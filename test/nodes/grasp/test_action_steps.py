# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Steps over other nodes' actions: progress, failures, and cancels wherever they wait."""

from math import inf
from types import SimpleNamespace

from action_msgs.msg import GoalInfo, GoalStatus
from isotruss_ros.nodes.framework import supervision
from isotruss_ros.nodes.pick_and_place import action_steps
from isotruss_ros.nodes.pick_and_place.action_steps import (
    ActionStep,
    CANCEL_TICKS,
    CancelledError,
    RETRY_TICKS,
    StepError,
    StepOutcome,
)
from manual_actions import replace_clients
from manual_world import world
import pytest
from rcl_interfaces.msg import SetParametersResult
from rclpy.task import Future


class Server:
    """Stands for an action client and the server behind it."""

    def __init__(self):
        self.ready, self.discovers_client, self.knows_goal = True, True, False
        self.sent, self.ended = Future(), None
        self.goals = self.questions = self.cancels = 0
        self.supervised = []

    def server_is_ready(self):
        return self.ready

    def publish(self, info):
        self.supervised.append(bytes(info.goal_id.uuid))

    def _get_result_async(self, handle):
        self.questions += 1
        self.asked_for = bytes(handle.goal_id.uuid)
        answer = Future()
        if self.discovers_client and not self.knows_goal:
            answer.set_result(SimpleNamespace(status=GoalStatus.STATUS_UNKNOWN))
        if self.knows_goal:
            self.ended = answer
        return answer

    def send_goal_async(self, _goal, feedback, goal_id):
        self.goals += 1
        self.feedback, self.goal_id = feedback, bytes(goal_id.uuid)
        self.knows_goal = True
        return self.sent

    def accept(self, accepted=True):
        self.knows_goal = accepted
        self.sent.set_result(SimpleNamespace(accepted=accepted, cancel_goal_async=self._cancel))

    def end(self, result):
        self.ended.set_result(SimpleNamespace(status=GoalStatus.STATUS_SUCCEEDED, result=result))

    def _cancel(self):
        self.cancels += 1


@pytest.fixture
def server(monkeypatch):
    server = Server()
    replace_clients(monkeypatch, action_steps, lambda *_: server)
    return server


def run(server, silence=inf, **checks):
    step = ActionStep(None, None, 'work', server.publish, lambda: silence)
    return step.run('goal', lambda feedback: feedback, **checks)


def begun(server, accepted=True, **options):
    """Return the steps of a goal that was sent, and accepted or not answered yet."""
    steps = run(server, **options)
    next(steps)
    if accepted:
        server.accept()
        next(steps)
    return steps


def last_of(steps, most=10 * RETRY_TICKS):
    for _ in range(most):
        try:
            next(steps)
        except StopIteration as ended:
            return ended.value
    raise AssertionError('the steps do not end')


def test_a_server_that_sends_no_feedback_ends_the_steps_after_the_timeout(server, monkeypatch):
    now = 0.0
    # The clock of the machine.
    monkeypatch.setattr(supervision.time, 'monotonic', lambda: now)
    steps = begun(server, silence=0.2)
    server.feedback(SimpleNamespace(feedback=0.5))
    now += 0.9 * supervision.START_TIMEOUT
    next(steps)
    for _ in range(3):
        now += supervision.START_TIMEOUT
        server.feedback(SimpleNamespace(feedback=0.5))
        next(steps)
    now += 0.19
    next(steps)
    now += 0.02
    with pytest.raises(StepError, match=r'no feedback for 0\.2 s') as ended:
        next(steps)
    assert ended.value.outcome is StepOutcome.STOPPED
    assert server.cancels == 1


@pytest.mark.parametrize('when', ['before', 'asked', 'accepted'])
def test_a_server_that_is_missing_ends_the_steps(server, when):
    steps = run(server) if when == 'before' else begun(server, when == 'accepted')
    server.ready = False
    with pytest.raises(StepError, match='offers the action work: check that its node') as error:
        next(steps)
    # Under a goal something may have moved.
    expected = StepOutcome.NOT_READY if when == 'before' else StepOutcome.STOPPED
    assert error.value.outcome is expected


def test_a_goal_is_sent_only_once_the_server_answers_and_is_supervised_until_its_end(server):
    server.discovers_client = False
    steps = run(server)
    for _ in range(2 * RETRY_TICKS + 1):
        next(steps)
    assert (server.questions, server.goals) == (3, 0)
    # Late answers from before it was sent are not about it.
    asked_before, server.discovers_client = server.asked_for, True
    for _ in range(RETRY_TICKS):
        next(steps)
    assert (server.questions, server.goals) == (4, 1)
    assert asked_before != server.goal_id
    assert {*server.supervised} == {server.goal_id}
    server.accept()
    for _ in range(10):
        server.supervised.clear()
        next(steps)
        assert {*server.supervised} == {server.goal_id}


@pytest.mark.parametrize('accepted', [True, False])
def test_a_server_that_was_started_again_ends_the_steps(server, accepted):
    steps = begun(server, accepted)
    server.knows_goal = False
    with pytest.raises(StepError, match='work was restarted and has lost the goal') as error:
        last_of(steps)
    assert error.value.outcome is StepOutcome.STOPPED
    assert server.asked_for == server.goal_id


@pytest.mark.parametrize(('accepted', 'ended'), [(True, True), (True, False), (False, False)])
def test_a_cancel_ends_the_steps_with_the_goal_or_after_its_timeout(server, accepted, ended):
    steps = begun(server, accepted)
    steps.throw(CancelledError())
    assert server.cancels == accepted
    if ended:
        next(steps)
        server.end('cancelled')
    with pytest.raises(CancelledError):
        last_of(steps, 1 if ended else CANCEL_TICKS)


@pytest.mark.parametrize('answered', [True, False])
def test_steps_that_are_closed_cancel_their_goal(server, answered):
    steps = begun(server, answered)
    steps.close()
    assert server.cancels == answered
    if not answered:
        server.accept()
    assert server.cancels == 1


@pytest.mark.parametrize('cancelled', [False, True], ids=['alone', 'and a cancel'])
def test_a_fault_cancels_the_goal_and_is_the_error_once_that_has_ended(server, cancelled):
    fault = StepError(StepOutcome.NOT_HELD, 'lost')
    steps = begun(server, find_fault=iter([None, None, fault]).__next__)
    assert server.cancels == 0
    next(steps)
    assert server.cancels == 1
    if not cancelled:
        next(steps)
    server.end('cancelled')
    with pytest.raises(StepError, match='lost') as error:
        steps.throw(CancelledError()) if cancelled else next(steps)
    assert error.value is fault


def test_a_refused_parameter_ends_the_steps_with_its_reason():
    client, answer = SimpleNamespace(srv_name='work/set_parameters'), Future()
    client.service_is_ready, client.call_async = lambda: True, lambda _: answer
    steps = action_steps.set_parameters(client, {'force': 2.0, 'rate': 0.0})
    next(steps)
    results = [SetParametersResult(successful=True), SetParametersResult(reason='too small')]
    answer.set_result(SimpleNamespace(results=results))
    with pytest.raises(StepError, match='work/set_parameters: rate: too small') as error:
        last_of(steps)
    assert error.value.outcome is StepOutcome.NOT_READY


def test_heartbeats_of_another_goal_do_not_replace_those_of_the_own_client():
    own, other, timeout = bytes(16), bytes(range(16)), 0.2
    with world() as w:
        watch = supervision.ClientWatch(w.probe)
        beats = w.probe.create_publisher(GoalInfo, supervision.TOPIC, 1)

        def beat(*goals):
            for goal in goals:
                message = GoalInfo()
                message.goal_id.uuid = list(goal)
                beats.publish(message)

        w.spin(0.1, lambda: beat(own))
        watch.goal = own
        w.spin(1.0, lambda: beat(own, other))
        assert watch.find_loss(timeout) is None
        w.spin(0.9 * timeout, lambda: beat(other))
        assert watch.find_loss(timeout) is None
        w.spin(0.2 * timeout, lambda: beat(other))
        assert 'has not published on supervised_goal for 0.2 s' in watch.find_loss(timeout)
