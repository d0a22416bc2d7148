# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Steps over other nodes' actions: progress, failures, and cancels wherever they wait."""

from concurrent.futures import ThreadPoolExecutor
from math import inf, nan
import re
from types import SimpleNamespace

from action_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import (
    FollowRollerTrajectory,
    MoveObject,
    PickObject,
    PlaceObject,
    PlanGrasp,
)
from isotruss_msgs.msg import GraspState
from isotruss_ros.core import ConvexObject, Ellipse, Pose
from isotruss_ros.core.errors import ConfigurationError, GraspError
from isotruss_ros.core.inputs import InputError, StampedInput
from isotruss_ros.core.paths.path_tracking import RETURN_SETTINGS
from isotruss_ros.core.planning.describe_plan import NEAR_SPEED_SHARE
from isotruss_ros.nodes.conversions.messages import to_pose_message
from isotruss_ros.nodes.conversions.path_messages import read_duration
from isotruss_ros.nodes.conversions.plan_messages import read_goal
from isotruss_ros.nodes.framework import supervision
from isotruss_ros.nodes.pick_and_place import action_steps, grasp_sequences
from isotruss_ros.nodes.pick_and_place.action_steps import (
    ActionStep,
    CANCEL_TICKS,
    CancelledError,
    Outcome,
    RETRY_TICKS,
    set_parameters,
    StepError,
)
from isotruss_ros.nodes.pick_and_place.grasp_sequences import GraspSequences
from isotruss_ros.nodes.pick_and_place.node import _find_outcome
from nav_msgs.msg import Path
import numpy as np
from probe import ROBOT
import pytest
from rclpy.task import Future


class Server:
    """Stands for an action client and the server behind it."""

    def __init__(self):
        self.ready, self.discovers_client, self.knows_goal = True, True, False
        self.sent, self.ended = Future(), None
        self.goals = self.questions = self.cancels = 0
        self.supervised = []

    def server_is_ready(self):
        """Return whether the server is there."""
        return self.ready

    def publish(self, info):
        """Hear from the client."""
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
        """Send a goal."""
        self.goals += 1
        self.feedback, self.goal_id = feedback, bytes(goal_id.uuid)
        self.knows_goal = True
        return self.sent

    def accept(self, accepted=True):
        """Answer the goal."""
        self.knows_goal = accepted
        self.sent.set_result(SimpleNamespace(accepted=accepted, cancel_goal_async=self._cancel))

    def end(self, result):
        """End the goal."""
        self.ended.set_result(SimpleNamespace(status=GoalStatus.STATUS_SUCCEEDED, result=result))

    def start_again(self):
        """Forget everything, as a process that was killed and started again."""
        self.knows_goal = False

    def _cancel(self):
        self.cancels += 1


@pytest.fixture
def server(monkeypatch):
    """Return the server of every action."""
    made = Server()
    monkeypatch.setattr(action_steps, 'ActionClient', lambda *_: made)
    return made


def run(server, silence=inf):
    """Return the steps of a goal."""
    step = ActionStep(None, None, 'work', server.publish, lambda: silence)
    return step.run('goal', lambda feedback: feedback)


def begun(server, accepted=True):
    """Return the steps of a goal that was sent, and accepted or not answered yet."""
    steps = run(server)
    next(steps)
    if accepted:
        server.accept()
        next(steps)
    return steps


def last_of(steps, most=10 * RETRY_TICKS):
    """Return what the steps return, or raise what they raise."""
    for _ in range(most):
        try:
            next(steps)
        except StopIteration as ended:
            return ended.value
    raise AssertionError('the steps do not end')


def test_a_server_that_sends_no_feedback_ends_the_steps_after_the_timeout(server, monkeypatch):
    now = 0.0
    monkeypatch.setattr(supervision.time, 'monotonic', lambda: now)
    steps = run(server, silence=0.2)
    next(steps)
    server.accept()
    for _ in range(3):
        now += supervision.START_TIMEOUT
        server.feedback(SimpleNamespace(feedback=0.5))
        next(steps)
    now += 0.19
    next(steps)
    now += 0.02
    with pytest.raises(StepError, match=r'no feedback for 0\.2 s') as ended:
        next(steps)
    assert ended.value.outcome is Outcome.STOPPED
    assert server.cancels == 1


def test_steps_yield_the_progress_and_return_the_result(server):
    steps = run(server)
    assert next(steps) == 0.0
    server.accept()
    server.feedback(SimpleNamespace(feedback=0.25))
    assert next(steps) == 0.25
    server.end('done')
    assert last_of(steps) == 'done'


@pytest.mark.parametrize('when', ['before', 'asked', 'accepted'])
def test_a_server_that_is_missing_ends_the_steps(server, when):
    steps = run(server) if when == 'before' else begun(server, when == 'accepted')
    server.ready = False
    with pytest.raises(StepError, match='no node offers the action work') as error:
        next(steps)
    # Under a goal something may have moved.
    expected = Outcome.NOT_READY if when == 'before' else Outcome.STOPPED
    assert error.value.outcome is expected


def test_a_goal_is_sent_only_once_the_server_answers(server):
    server.discovers_client = False
    steps = run(server)
    for _ in range(2 * RETRY_TICKS + 1):
        next(steps)
    assert (server.questions, server.goals) == (3, 0)
    asked_before, server.discovers_client = server.asked_for, True
    for _ in range(RETRY_TICKS):
        next(steps)
    assert (server.questions, server.goals) == (4, 1)
    # Late answers from before it was sent are not about it.
    assert asked_before != server.goal_id


def test_a_cancel_before_the_goal_is_sent_ends_the_steps(server):
    server.discovers_client = False
    steps = run(server)
    next(steps)
    with pytest.raises(CancelledError):
        steps.throw(CancelledError())
    assert server.goals == 0


def test_a_goal_that_is_rejected_ends_the_steps(server):
    steps = run(server)
    next(steps)
    server.accept(False)
    with pytest.raises(StepError, match='work rejects goals'):
        last_of(steps)


@pytest.mark.parametrize('accepted', [True, False])
def test_a_server_that_was_started_again_ends_the_steps(server, accepted):
    steps = begun(server, accepted)
    server.start_again()
    with pytest.raises(StepError, match='work does not know the goal') as error:
        last_of(steps)
    assert error.value.outcome is Outcome.STOPPED
    assert server.asked_for == server.goal_id


def test_a_goal_is_supervised_from_before_it_is_sent_until_it_ends(server):
    server.discovers_client = False
    steps = run(server)
    next(steps)
    assert (server.goals, len(server.supervised)) == (0, 2)
    server.discovers_client = True
    for _ in range(RETRY_TICKS):
        next(steps)
    server.accept()
    for _ in range(10):
        before = len(server.supervised)
        next(steps)
        assert len(server.supervised) > before
    assert {*server.supervised} == {server.goal_id}


def test_a_cancel_waits_until_the_server_has_ended_the_goal(server):
    steps = begun(server)
    steps.throw(CancelledError())
    assert server.cancels == 1
    next(steps)
    server.end('cancelled')
    with pytest.raises(CancelledError):
        next(steps)


@pytest.mark.parametrize('accepted', [True, False])
def test_a_cancel_ends_the_steps_where_the_server_does_not(server, accepted):
    steps = begun(server, accepted)
    steps.throw(CancelledError())
    with pytest.raises(CancelledError):
        last_of(steps, CANCEL_TICKS)


@pytest.mark.parametrize('change', [{'ready': False}, {'knows_goal': False}])
def test_a_cancel_ends_the_steps_where_the_server_is_gone(server, change):
    steps = begun(server)
    vars(server).update(change)
    with pytest.raises(CancelledError):
        steps.throw(CancelledError())


def test_a_goal_that_is_not_answered_yet_is_cancelled_when_it_is(server):
    steps = run(server)
    next(steps)
    steps.throw(CancelledError())
    next(steps)
    assert server.cancels == 0
    server.accept()
    next(steps)
    assert server.cancels == 1
    server.end('cancelled')
    with pytest.raises(CancelledError):
        next(steps)


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
    fault = StepError(Outcome.NOT_HELD, 'lost')
    faults = iter([None, None, fault])
    step = ActionStep(None, None, 'work', server.publish, lambda: inf)
    steps = step.run('goal', lambda feedback: feedback, lambda: next(faults))
    next(steps)
    server.accept()
    next(steps)
    assert server.cancels == 0
    next(steps)
    assert server.cancels == 1
    if not cancelled:
        next(steps)
    server.end('cancelled')
    with pytest.raises(StepError, match='lost') as error:
        steps.throw(CancelledError()) if cancelled else next(steps)
    assert error.value is fault


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


def sequences_at(grasp_age=0.0, held=True, pose_age=0.0, y=0.3, **values):
    """Return sequences whose inputs are so old [s], the object at (0.6, y)."""
    made = GraspSequences.__new__(GraspSequences)
    made._node = SimpleNamespace(now=lambda: 10.0, values=values.pop('values', None))
    made._robot, made._described, made.timeout, made.stage = ROBOT, None, 0.2, 0
    state = SimpleNamespace(held=held, message='', hold_message='it slips', slip_margin=1.0)
    state.grasping_members = ['north/P-Z', 'north/Z-R']
    made.grasp = StampedInput(state, 10.0 - grasp_age)
    made.rollers = StampedInput(None, 10.0)
    made.pose = StampedInput(Pose(0.6, y, 0.1), 10.0 - pose_age)
    vars(made).update(values)
    return made


class Follower:
    """Stands for the path follower: the object is somewhere afterwards, and it ends somehow."""

    def __init__(self, sequences, goes_to, ends):
        self.goal, self._sequences = None, sequences
        self._to, self._ends = goes_to, ends

    def run(self, goal, **_options):
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
    sequences = sequences_at(y=0.3 - moved)
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
        assert follower.goal.position_tolerance == RETURN_SETTINGS.position_tolerance


class Planner:
    """Stands for the planner: it finds nothing, and keeps the goal."""

    def run(self, goal, **_options):
        """Search."""
        self.goal = goal
        yield 0.5
        return PlanGrasp.Result(code=PlanGrasp.Result.NONE_FOUND, message='nothing')


@pytest.mark.parametrize('described', [None, ConvexObject(Ellipse((0.2, 0.1)), mass=2.0)])
def test_object_and_members_are_those_that_are_planned_with(described):
    values, planner = SimpleNamespace(object_diameter=0.25, friction=0.6), Planner()
    sequences = sequences_at(held=False, values=values, _planner=planner, _described=described)
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


def test_an_object_that_is_held_already_is_not_picked():
    with pytest.raises(StepError, match='by north/P-Z, north/Z-R: place it first') as refused:
        list(sequences_at().pick(PickObject.Goal()))
    assert refused.value.outcome is Outcome.BAD_GOAL


@pytest.mark.parametrize(
    ('held', 'age', 'words', 'outcome'),
    [
        (False, 0.1, 'not held', Outcome.NOT_HELD),
        (True, 0.3, '0.300 s old.*command_timeout', Outcome.STOPPED),
        (False, 0.3, '0.300 s old.*command_timeout', Outcome.STOPPED),
    ],
)
def test_a_lost_object_and_a_late_analysis_are_told_apart(held, age, words, outcome):
    assert sequences_at(0.1)._find_loss() is None
    fault = sequences_at(age, held)._find_loss()
    assert re.search(words, str(fault))
    assert fault.outcome is outcome


def test_motion_starts_after_late_inputs():
    sequences = sequences_at(0.3)
    steps = sequences.move(MoveObject.Goal())
    assert [next(steps) for _ in range(3)] == [0.0] * 3
    sequences.grasp = sequences.grasp._replace(time=10.0)
    sequences._object = Follower(sequences, (0.6, 0.3), 0)
    assert next(steps) == 0.5


def test_inputs_that_stay_late_end_the_steps_as_not_ready(monkeypatch):
    passed = iter([0.0, 0.5, 0.9, 1.1])
    monkeypatch.setattr(grasp_sequences.time, 'monotonic', lambda: next(passed))
    steps = sequences_at(0.3).move(MoveObject.Goal())
    assert [next(steps), next(steps)] == [0.0, 0.0]
    with pytest.raises(InputError, match='command_timeout') as error:
        next(steps)
    assert _find_outcome(error.value) is Outcome.NOT_READY


@pytest.mark.parametrize(
    ('error', 'outcome'),
    [
        (StepError(Outcome.NOT_HELD, 'lost'), Outcome.NOT_HELD),
        (CancelledError('by the client'), Outcome.CANCELLED),
        (GraspError('no such module'), Outcome.BAD_GOAL),
        (ConfigurationError('too long'), Outcome.NO_MOTION_FOUND),
    ],
)
def test_the_code_of_a_result_is_that_of_the_error(error, outcome):
    assert _find_outcome(error) is outcome


@pytest.mark.parametrize(('age', 'outcome'), [(0.0, Outcome.NOT_HELD), (100.0, Outcome.NOT_READY)])
def test_a_missing_analysis_is_distinct_from_an_object_not_held(age, outcome):
    sequences, times = sequences_at(age, held=False), iter([10.0, 20.0])
    sequences._node = SimpleNamespace(now=lambda: next(times))
    sequences.grasp = sequences.grasp._replace(time=20.0 - age)
    sequences.grasp.value.code = GraspState.OK
    with pytest.raises(StepError) as error:
        next(sequences._confirm(True))
    assert error.value.outcome is outcome


def test_an_analysis_from_before_the_end_of_the_motion_confirms_nothing():
    sequences = sequences_at()
    sequences.grasp.value.code = GraspState.OK
    steps = sequences._confirm(True)
    next(steps)
    sequences.grasp = sequences.grasp._replace(time=10.1)
    assert last_of(steps).held


@pytest.mark.parametrize('pose_age', [0.0, 0.3])
def test_the_remaining_distance_requires_a_known_pose(pose_age):
    end = PoseStamped(pose=to_pose_message(Pose(0.6, 0.38, 0.3)))
    left = sequences_at(0.0, pose_age=pose_age).distance_left(Path(poses=[end]))
    assert left == pytest.approx((0.08, 0.2) if pose_age == 0.0 else (nan, nan), nan_ok=True)
    assert np.isnan(sequences_at(0.0).distance_left(Path())).all()


class Rollers:
    """Stands for the action that drives the rollers: it keeps the trajectory."""

    def run(self, goal, *_progress, **_options):
        """Drive."""
        self.path = goal.trajectory
        yield 0.5
        return FollowRollerTrajectory.Result(error_code=-1, error_string='no rollers')


def test_a_grip_opens_slowly_until_it_is_apart(monkeypatch):
    path = np.linspace(0.0, 0.05, 6)[:, None] * np.ones(len(ROBOT.roller_names))
    released = SimpleNamespace(violation=None, path=path, apart=2)
    rollers = Rollers()
    sequences = sequences_at(
        values=SimpleNamespace(object_diameter=0.25, object=''),
        _trajectories=rollers,
        configuration=lambda *_: ROBOT.home,
        _thread=ThreadPoolExecutor(1),
    )
    monkeypatch.setattr(grasp_sequences, 'plan_release', lambda *_: released)
    with pytest.raises(StepError, match='no rollers'):
        list(sequences.place(PlaceObject.Goal()))
    times = [read_duration(point.time_from_start) for point in rollers.path.points]
    quick, slow = (
        0.01 / ROBOT.description.max_speed,
        0.01 / ROBOT.description.max_speed / NEAR_SPEED_SHARE,
    )
    assert np.diff(times) == pytest.approx([slow] * 3 + [quick] * 2, abs=1e-6)
