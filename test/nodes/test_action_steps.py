# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Steps over other nodes' actions: progress, failures, and cancels wherever they wait."""

from types import SimpleNamespace

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import PickObject, PlanGrasp
from isotruss_ros.core import ConvexObject, Ellipse, Pose
from isotruss_ros.core.control.inputs import StampedInput
from isotruss_ros.core.control.path_tracking import RETURN
from isotruss_ros.nodes.components import action_steps
from isotruss_ros.nodes.components.action_steps import (
    ActionStep,
    CancelledError,
    Outcome,
    RETRY_TICKS,
    set_parameters,
    StepError,
)
from isotruss_ros.nodes.components.grasp_sequences import (
    _run_while,
    check_grip,
    GraspSequences,
)
from isotruss_ros.nodes.conversions.plan_messages import read_goal
from isotruss_ros.nodes.framework import parameters as params
from probe import ROBOT
import pytest
from rclpy.task import Future


class Server:
    """Stands for an action client and the server behind it."""

    def __init__(self):
        self.ready, self.discovers_client = True, True
        self.sent, self.result = Future(), Future()
        self.goals = self.questions = self.cancels = 0

    def server_is_ready(self):
        """Return whether the server is there."""
        return self.ready

    def _get_result_async(self, _unknown_goal):
        self.questions += 1
        answer = Future()
        if self.discovers_client:
            answer.set_result('no such goal')
        return answer

    def send_goal_async(self, _goal, feedback):
        """Send a goal."""
        self.goals += 1
        self.feedback = feedback
        return self.sent

    def accept(self, accepted=True):
        """Answer the goal."""
        self.sent.set_result(
            SimpleNamespace(
                accepted=accepted,
                get_result_async=lambda: self.result,
                cancel_goal_async=self._cancel,
            )
        )

    def _cancel(self):
        self.cancels += 1


@pytest.fixture
def server(monkeypatch):
    """Return the server of every action."""
    made = Server()
    monkeypatch.setattr(action_steps, 'ActionClient', lambda *_: made)
    return made


def run():
    """Return the steps of a goal."""
    return ActionStep(None, None, 'work').run('goal', lambda feedback: feedback)


def test_steps_yield_the_progress_and_return_the_result(server):
    steps = run()
    assert next(steps) == 0.0
    server.accept()
    server.feedback(SimpleNamespace(feedback=0.25))
    assert next(steps) == 0.25
    server.result.set_result(SimpleNamespace(result='done'))
    with pytest.raises(StopIteration) as ended:
        next(steps)
    assert ended.value.value == 'done'


@pytest.mark.parametrize('when', ['before', 'asked', 'accepted'])
def test_a_server_that_is_missing_ends_the_steps(server, when):
    steps = run()
    if when != 'before':
        next(steps)
    if when == 'accepted':
        server.accept()
        next(steps)
    server.ready = False
    with pytest.raises(StepError, match='no node offers the action work') as error:
        next(steps)
    assert error.value.outcome is Outcome.NOT_READY


def test_a_goal_is_sent_only_once_the_server_answers(server):
    server.discovers_client = False
    steps = run()
    for _ in range(2 * RETRY_TICKS + 1):
        next(steps)
    assert (server.questions, server.goals) == (3, 0)
    server.discovers_client = True
    for _ in range(RETRY_TICKS):
        next(steps)
    assert (server.questions, server.goals) == (4, 1)


def test_a_cancel_before_the_goal_is_sent_ends_the_steps(server):
    server.discovers_client = False
    steps = run()
    next(steps)
    with pytest.raises(CancelledError):
        steps.throw(CancelledError())
    assert server.goals == 0


def test_a_goal_that_is_rejected_ends_the_steps(server):
    steps = run()
    next(steps)
    server.accept(False)
    with pytest.raises(StepError, match='work rejects goals'):
        next(steps)


def test_a_cancel_waits_until_the_server_has_ended_the_goal(server):
    steps = run()
    next(steps)
    server.accept()
    next(steps)
    steps.throw(CancelledError())
    assert server.cancels == 1
    next(steps)
    server.result.set_result(SimpleNamespace(result='cancelled'))
    with pytest.raises(CancelledError):
        next(steps)


def test_a_goal_that_is_not_answered_yet_is_cancelled_when_it_is(server):
    steps = run()
    next(steps)
    steps.throw(CancelledError())
    next(steps)
    assert server.cancels == 0
    server.accept()
    next(steps)
    assert server.cancels == 1
    server.result.set_result(SimpleNamespace(result='cancelled'))
    with pytest.raises(CancelledError):
        next(steps)


@pytest.mark.parametrize('answered', [True, False])
def test_steps_that_are_closed_cancel_their_goal(server, answered):
    steps = run()
    next(steps)
    if answered:
        server.accept()
        next(steps)
    steps.close()
    assert server.cancels == answered
    if not answered:
        server.accept()
    assert server.cancels == 1


class Steps:
    """Steps that end well after some, and take note of a cancel."""

    def __init__(self, count):
        self.cancelled = False
        self.steps = self._run(count)

    def _run(self, count):
        try:
            for number in range(count):
                yield number / count
        except CancelledError:
            self.cancelled = True
            yield 1.0
            raise
        return 'done'


def test_a_fault_cancels_the_steps_and_is_the_error():
    faults, inner = iter(['', '', 'lost', 'lost', 'lost']), Steps(10)
    steps = _run_while(inner.steps, lambda: next(faults))
    assert [next(steps), next(steps)] == [0.0, 0.1]
    assert next(steps) == 1.0
    assert inner.cancelled
    with pytest.raises(StepError, match='lost') as error:
        next(steps)
    assert error.value.outcome is Outcome.NOT_HELD


def test_without_a_fault_steps_end_as_they_do():
    inner = Steps(3)
    steps = _run_while(inner.steps, lambda: '')
    assert [next(steps) for _ in range(3)] == [0.0, 1 / 3, 2 / 3]
    with pytest.raises(StopIteration) as ended:
        next(steps)
    assert ended.value.value == 'done'


def test_a_cancel_goes_through_to_the_steps():
    inner = Steps(10)
    steps = _run_while(inner.steps, lambda: '')
    next(steps)
    assert steps.throw(CancelledError()) == 1.0
    with pytest.raises(CancelledError):
        next(steps)
    assert inner.cancelled


class Service:
    """Stands for a client of `set_parameters`."""

    srv_name = '/manipulation/set_parameters'

    def __init__(self):
        self.ready, self.answers, self.request = True, [], None

    def service_is_ready(self):
        """Return whether the service is there."""
        return self.ready

    def call_async(self, request):
        """Call the service."""
        self.request = request
        self.answers.append(Future())
        return self.answers[-1]


def test_parameters_are_set_or_the_reason_is_told():
    service = Service()
    steps = set_parameters(service, {'grip_module': 'north/Z', 'squeeze_force': 15.0})
    next(steps)
    given = {part.name: part.value for part in service.request.parameters}
    assert given['grip_module'].string_value == 'north/Z'
    assert given['squeeze_force'].double_value == 15.0
    results = [SimpleNamespace(successful=ok, reason='why') for ok in (True, False)]
    service.answers[0].set_result(SimpleNamespace(results=results))
    with pytest.raises(StepError, match='squeeze_force: why'):
        next(steps)


@pytest.mark.parametrize('answered', [0, 1])
def test_parameters_are_set_again_where_no_answer_comes(answered):
    service = Service()
    steps = set_parameters(service, {'squeeze_force': 15.0})
    for _ in range(RETRY_TICKS + 1):
        next(steps)
    assert len(service.answers) == 2
    result = SimpleNamespace(successful=True)
    service.answers[answered].set_result(SimpleNamespace(results=[result]))
    with pytest.raises(StopIteration):
        next(steps)


@pytest.mark.parametrize('waited', [0, 1])
def test_a_service_that_is_missing_ends_the_steps(waited):
    service = Service()
    steps = set_parameters(service, {'squeeze_force': 15.0})
    for _ in range(waited):
        next(steps)
    service.ready = False
    with pytest.raises(StepError, match='no node offers the service') as error:
        next(steps)
    assert error.value.outcome is Outcome.NOT_READY


def test_a_grip_of_two_or_three_members_can_be_opened():
    for count in (2, 3):
        check_grip(ROBOT.member_names[:count])
    for count in (0, 1, 4):
        with pytest.raises(StepError, match='must be 2 or 3 to open'):
            check_grip(ROBOT.member_names[:count])


class Follower:
    """Stands for the path follower: the object is somewhere afterwards, and it ends somehow."""

    def __init__(self, sequences, goes_to, ends):
        self.goal, self._sequences = None, sequences
        self._to, self._ends = goes_to, ends

    def run(self, goal, _progress):
        """Follow a path."""
        self.goal = goal
        yield 0.5
        self._sequences.pose = StampedInput(Pose(*self._to, 0.1), 10.0)
        if isinstance(self._ends, Exception):
            raise self._ends
        return SimpleNamespace(code=self._ends, message='stopped by limits')


LAY = PoseStamped()
LAY.pose.position.x, LAY.pose.position.y = 0.6, 0.3


@pytest.mark.parametrize(
    ('moved', 'left', 'ends', 'words'),
    [
        (0.0005, None, 0, ''),
        (0.0036, 0.001, 0, ', 1 mm from where it lay, after 3.6 mm'),
        (0.02, 0.01, 4, ', 10 mm from where it lay, after 20 mm (stopped by limits)'),
        (
            0.02,
            0.02,
            StepError(Outcome.NOT_READY, 'no node offers it'),
            ', 20 mm from where it lay, after 20 mm (no node offers it)',
        ),
    ],
)
def test_an_object_that_a_closing_grip_moved_is_brought_back(moved, left, ends, words):
    sequences = GraspSequences.__new__(GraspSequences)
    sequences._node = SimpleNamespace(now=lambda: 10.0)
    sequences.timeout = 0.2
    sequences.grasp = StampedInput(SimpleNamespace(held=True), 10.0)
    sequences.pose = StampedInput(Pose(0.6, 0.3 - moved, 0.1), 10.0)
    follower = sequences._object = Follower(sequences, (0.6, 0.3 - (left or 0.0)), ends)
    notes = []

    def steps():
        notes.append((yield from sequences._bring_back(LAY)))

    assert list(steps()) == [0.5] * (left is not None)
    assert notes == [words]
    if left is None:
        assert follower.goal is None
    else:
        assert follower.goal.path.poses == [LAY]
        assert follower.goal.position_tolerance == RETURN.position_tolerance


class Planner:
    """Stands for the planner: it finds nothing, and keeps the goal."""

    def run(self, goal, _progress):
        """Search."""
        self.goal = goal
        yield 0.5
        return PlanGrasp.Result(code=PlanGrasp.Result.NONE_FOUND, message='nothing')


@pytest.mark.parametrize('described', [None, ConvexObject(Ellipse((0.2, 0.1)), mass=2.0)])
def test_object_and_members_are_those_that_are_planned_with(described):
    sequences, planner = GraspSequences.__new__(GraspSequences), Planner()
    values = {params.OBJECT_DIAMETER: 0.25, params.FRICTION: 0.6}
    sequences._node = SimpleNamespace(now=lambda: 10.0, values=values)
    sequences._robot, sequences._planner, sequences._described = ROBOT, planner, described
    sequences.timeout = 0.2
    sequences.rollers = StampedInput(None, 10.0)
    sequences.pose = StampedInput(Pose(0.6, 0.3, 0.1), 10.0)
    with pytest.raises(StepError, match='nothing'):
        list(sequences.pick(PickObject.Goal(members=['south/P-Q', 'north/R-P'], squeeze=9.0)))
    arguments = read_goal(planner.goal, ROBOT)
    if described is None:
        assert arguments.body == ConvexObject.disc((0.6, 0.3), 0.25)
    else:
        assert arguments.body.moved_to((0.0, 0.0, 0.0)) == described
        assert arguments.body.pose == pytest.approx((0.6, 0.3, 0.1))
    needs = arguments.requirements
    assert needs.members == ('south/P-Q', 'north/R-P')
    assert (needs.module, needs.squeeze, needs.friction) == (None, 9.0, 0.6)


@pytest.mark.parametrize(
    ('held', 'age', 'words'),
    [(True, 0.1, ''), (False, 0.1, 'not held'), (True, 0.3, '0.300 s old')],
)
def test_an_object_counts_as_held_while_a_new_analysis_says_so(held, age, words):
    sequences = GraspSequences.__new__(GraspSequences)
    sequences._node = SimpleNamespace(now=lambda: 10.0)
    sequences.timeout = 0.2
    state = SimpleNamespace(held=held, message='', hold_message='it slips', slip_margin=1.0)
    sequences.grasp = StampedInput(state, 10.0 - age)
    fault = sequences._find_loss()
    assert words in fault
    assert bool(fault) == bool(words)
