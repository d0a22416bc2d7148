# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The planner node: goals, feedback and results, and its searches in the background."""

from concurrent.futures.process import BrokenProcessPool
import math
import re
import time

from action_msgs.msg import GoalStatus
from contracts import check_fields
from geometry_msgs.msg import PoseStamped, Vector3, Wrench
from held_grips import BOX_FILE
from isotruss_msgs.action import PlanGrasp
from isotruss_msgs.msg import ConvexObject as ObjectMessage
from isotruss_msgs.msg import Obstacles
from isotruss_ros import core, workers
from isotruss_ros.core import ConvexObject, GraspRequirements, load_robot
from isotruss_ros.core.errors import GraspError, SolverError, StructureError
from isotruss_ros.core.planning.grasp_plan import export_path, GraspPlan, Progress
from isotruss_ros.nodes.conversions.messages import to_pose_message
from isotruss_ros.nodes.conversions.object_messages import to_object_message
from isotruss_ros.nodes.conversions.obstacle_messages import to_obstacles_message
from isotruss_ros.nodes.conversions.plan_messages import read_goal, to_result_message
from isotruss_ros.nodes.conversions.trajectory_goals import read_roller_trajectory
from isotruss_ros.nodes.grasp.searcher import Answer, Searcher, SearchOutcome
from isotruss_ros.nodes.grasp_planner import GraspPlanner
from lifecycle_msgs.msg import Transition
from manual_world import Manager, world
import numpy as np
from planning import CENTER, DIAMETER, goal
from probe import maker, N, ROBOT
import pytest

Result = PlanGrasp.Result


def test_the_object_of_a_goal_goes_before_that_of_the_parameter():
    lying = PoseStamped(pose=to_pose_message(core.Pose(0.5, -0.3, -0.5)))
    box = core.read_object(BOX_FILE).moved_to((0.5, -0.3, -0.5))
    request = goal(object_pose=lying, object_diameter=0.0, object=to_object_message(box))
    for described in (None, core.ConvexObject(core.Disc(0.1))):
        body = read_goal(request, ROBOT, described).body
        assert body.moved_to(box.pose) == box
        assert body.pose == pytest.approx(box.pose)
        assert read_goal(goal(), ROBOT, described).body == core.ConvexObject.disc(CENTER, DIAMETER)


def test_the_parameter_describes_the_object():
    with world(idle(workers=2, object=BOX_FILE)) as w:
        w.spin(0.05, w.probe.send_joints)
        w.send_goal(goal(object_diameter=0.0))
        assert w.nodes[1].searcher.begun[1].shape == core.read_object(BOX_FILE).shape


@pytest.mark.parametrize(('silence', 'names'), [(0.0, ['hand']), (1.0, [])])
def test_search_has_the_published_obstacles_at_rest_at_their_present_poses(silence, names):
    velocity = (0.1, 0.0, 0.0)
    hand = core.Obstacle('hand', core.ConvexObject.disc((5.0, 0.0), 0.1), velocity)
    with world(idle(workers=2)) as w:
        sender = w.probe.create_publisher(Obstacles, 'obstacles', 10)

        def send():
            w.probe.send_joints()
            sender.publish(to_obstacles_message([hand], w.probe.past(0.2), 'truss'))

        w.spin(0.1, send)
        w.spin(silence, w.probe.send_joints)
        w.send_goal(goal())
        heeded = w.nodes[1].searcher.begun[2].obstacles
    assert [obstacle.name for obstacle in heeded] == names
    for obstacle in heeded:
        assert obstacle.body.pose[0] > 5.015
        assert obstacle.velocity == (0.0, 0.0, 0.0)


def path(*poses):
    """Return poses (x, y, angle) as messages."""
    return [to_pose_message(core.Pose(*pose)) for pose in poses]


@pytest.mark.parametrize(
    ('fields', 'words'),
    [
        ({'frame': 'map'}, "object pose in frame 'map': must be in 'truss'"),
        ({'center': (math.nan, 0.0)}, 'centre .*nan, 0.0.: must be 2 finite'),
        ({'center': (1e300, 0.0)}, 'pose .*1e[+]300, .*: must be within'),
        ({'object_diameter': -0.3}, 'diameter -0.3 m: must be from'),
        ({'external_wrench': Wrench(torque=Vector3(z=math.nan))}, 'must be 3 finite numbers'),
        ({'object_pose': PoseStamped()}, 'object_pose: missing'),
        ({'object': ObjectMessage(shape=1, diameter=0.3)}, 'object_diameter 0.3 m, together with'),
        ({'members': ['north/Z-R']}, "members 'north/Z-R': must be two or three different"),
        ({'members': ['north/Z-R', 'north/R-P'], 'module': 'north/R'}, 'only one of the two can'),
        ({'measure': 'beauty' * 1000}, 'measure: .{1,90}: must be one of slip_margin'),
        ({'count': 2**32 - 1}, 'count 4294967295: must be from 1'),
        ({'time_limit': math.nan}, 'time_limit nan s'),
        ({'uncertainty': '{friction: 5}'}, 'uncertainty: friction: 5: must be'),
        ({'carry': path((0.5, 0.3, 0.0))}, 'carry: 1 poses: must be none, or 2 to'),
    ],
)
def test_rejects_goals(fields, words):
    with pytest.raises(core.IsotrussError, match=words) as error:
        read_goal(goal(**fields), ROBOT)
    assert len(str(error.value)) < 1000


def test_reads_every_requirement():
    wrench = Wrench(force=Vector3(x=0.01), torque=Vector3(z=0.001))
    scalars = {'friction': 0.7, 'module': 'north/R', 'measure': 'stiffness', 'count': 2}
    scalars |= {'max_contact_force': 19.0, 'max_total_force': 37.0, 'min_rigidity': 0.2}
    about = {'center': (0.52, 0.31), 'object_diameter': 0.25, 'seed': 5, 'time_limit': 3.0}
    direction = (1.0, 0.0, 0.5)
    about |= {'external_wrench': wrench, 'direction': np.array(direction)}
    arguments = read_goal(goal(**about, **scalars), ROBOT)
    assert arguments.body == core.ConvexObject.disc((0.52, 0.31), 0.25)
    assert arguments.requirements == core.GraspRequirements(
        **scalars, external_wrench=(0.01, 0.0, 0.001), direction=direction
    )
    assert (arguments.seed, arguments.time_limit) == (5, 3.0)
    others = {'squeeze': 14.0, 'min_slip_margin': 2.0, 'max_utilisation': 0.6}
    others |= {'members': ('north/P-Z', 'north/Z-R')}
    arguments = read_goal(goal(**others), ROBOT)
    assert arguments.requirements == core.GraspRequirements(**others, count=3)
    assert read_goal(goal(uncertainty='{friction: 0.2}'), ROBOT).uncertainty.friction == 0.2
    default = read_goal(goal(), ROBOT)
    assert (default.requirements, default.uncertainty) == (core.GraspRequirements(count=3), None)


def test_the_path_of_a_carry_turns_the_shorter_way():
    poses = ((0.5, 0.3, 3.0), (0.6, 0.3, 3.3), (0.6, 0.4, 3.5))
    result = read_goal(goal(carry=path(*poses)), ROBOT).requirements.carry
    assert np.array(result) == pytest.approx(np.array(poses))


def seconds(duration):
    return duration.sec + 1e-9 * duration.nanosec


def test_the_result_has_the_planned_grasps_and_trajectories():
    body = core.ConvexObject.disc(CENTER, DIAMETER)
    two, random = core.GraspRequirements(count=2), core.Uncertainty()
    plan = core.plan_grasps(ROBOT.home, body, two, thorough=False, uncertainty=random)
    result = to_result_message(Answer(SearchOutcome.FOUND, 'found', plan), ROBOT)
    expected = {
        'code': Result.FOUND,
        'message': 'found',
        'stamp': result.stamp,
        'grasps': result.grasps,
        'violated_requirement': '',
        'violation_value': 0.0,
        'violation_bound': 0.0,
        'evaluations': plan.evaluations,
        'analyses': plan.analyses,
        'computing_time': plan.computing_time,
    }
    check_fields(result, expected)
    assert min(plan.evaluations, plan.analyses, plan.computing_time) > 0.0
    assert len(result.grasps) == len(plan.grasps) == 2
    for grasp, planned in zip(result.grasps, plan.grasps, strict=True):
        equal = ('members', 'roller_positions', 'score', 'squeeze', 'slip_margin', 'utilisation')
        equal += ('required_friction', 'max_contact_force', 'total_force', 'nonlinearity')
        values = {name: getattr(planned, name) for name in (*equal, 'travel', 'rigidity')}
        values |= {'module': planned.module or '', 'chance': planned.chance.probability}
        check_fields(grasp, values | {'path': grasp.path, 'touch': grasp.touch})
        rows = np.array([point.positions for point in grasp.path.points])
        assert np.array_equal(rows, planned.path)
        assert read_roller_trajectory(grasp.path, ROBOT, np.zeros(N)).duration > 0.0
        times = np.array([seconds(point.time_from_start) for point in grasp.path.points])
        assert times == pytest.approx(export_path(planned)['times'], abs=1e-8)
        assert seconds(grasp.touch) == times[planned.touch]


class StandIn:
    """In place of the searcher: begins, and ends when the test says so."""

    def __init__(self, workers):
        self.workers, self.begun, self.reply, self.closed = workers, None, None, False

    def begin(self, *arguments):
        self.begun, self.closed = arguments, False

    def answer(self):
        reply, self.reply = self.reply, None
        if reply is not None:
            self.begun = None
        return reply

    def progress(self):
        return None if self.begun is None else Progress(7, 2, 0.5, 0.25, 1.5)

    def cancel(self):
        self.reply = Answer(SearchOutcome.CANCELLED, 'cancelled')

    def close(self):
        self.begun, self.closed = None, True


class IdlePlanner(GraspPlanner):
    """Planner whose searches the test ends."""

    searcher_type = StandIn


idle = maker(IdlePlanner, command_timeout=5.0)


@pytest.fixture
def planner():
    """Return a world with a planner that has received joint states."""
    with world(idle(workers=2)) as w:
        w.spin(0.05, w.probe.send_joints)
        w.searcher = w.nodes[1].searcher
        yield w


@pytest.mark.parametrize(
    ('outcome', 'status'),
    [
        (SearchOutcome.FOUND, GoalStatus.STATUS_SUCCEEDED),
        (SearchOutcome.NONE_FOUND, GoalStatus.STATUS_ABORTED),
        (SearchOutcome.TIME_OUT, GoalStatus.STATUS_ABORTED),
        (SearchOutcome.FAILED, GoalStatus.STATUS_ABORTED),
    ],
)
def test_passes_the_goal_on_and_ends_with_the_answer(planner, outcome, status):
    handle = planner.send_goal(goal(seed=3, count=2))
    config, *arguments = planner.searcher.begun
    assert np.array_equal(config.roller_positions, np.zeros(N))
    assert tuple(arguments) == read_goal(goal(seed=3, count=2), ROBOT)
    planner.spin(1.0)
    assert len(handle.feedback) == pytest.approx(18, abs=3)
    expected = {'evaluations': 7, 'found': 2, 'best': 0.5, 'progress': 0.25, 'time_left': 1.5}
    check_fields(handle.feedback[-1], expected)
    assert planner.detail('grasps found', 'grasp_planner') == '2'
    planner.searcher.reply = Answer(outcome, 'the end')
    end, result = planner.finish(handle)
    assert (end, result.code, result.message) == (status, int(outcome), 'the end')
    assert result.stamp == planner.nodes[1].get_clock().now().to_msg()
    assert planner.nodes[1].details()['searching'] is False


def test_a_cancelled_goal_ends_with_the_result_so_far(planner):
    handle = planner.send_goal(goal())
    assert handle.cancel()
    status, result = planner.finish(handle)
    assert (status, result.code) == (GoalStatus.STATUS_CANCELED, Result.CANCELLED)
    assert not handle.cancel()


def test_a_bad_goal_or_a_second_one_is_aborted_with_the_reason(planner):
    def check_aborted(request, code, words):
        status, result = planner.finish(planner.send_goal(request))
        assert (status, result.code) == (GoalStatus.STATUS_ABORTED, code)
        assert words in result.message

    check_aborted(goal(object_diameter=-0.3), Result.BAD_GOAL, 'diameter -0.3 m: must be from')
    search = planner.send_goal(goal())
    check_aborted(goal(), Result.FAILED, 'another search is running')
    assert not search.ended
    planner.searcher.reply = Answer(SearchOutcome.FOUND, '')
    planner.finish(search)
    assert planner.send_goal(goal()).accepted


def test_needs_fresh_joint_states():
    with world(idle()) as w:
        for send, words in (
            (lambda: None, 'joint states: none received yet'),
            (lambda: w.probe.send_joints(name=['nobody'] * 6), 'must name south/P'),
            (lambda: w.probe.send_joints(age=100.0), 's old; must be at most 5.0 s'),
            (lambda: w.probe.send_joints(age=-100.0), 's in the future'),
            (lambda: w.probe.send_joints(position=[5.0] * 6), 'member|length|shape|straight'),
        ):
            w.spin(0.05, send)
            status, result = w.finish(w.send_goal(goal()))
            assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.NO_JOINT_STATES)
            assert re.search(words, result.message)
        assert w.nodes[1].searcher.begun is None


def test_an_inactive_node_ends_the_search_and_accepts_no_goals(planner):
    manager = Manager(planner, 'grasp_planner')
    handle = planner.send_goal(goal())
    assert manager.ask(Transition.TRANSITION_DEACTIVATE)
    status, result = planner.finish(handle)
    assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.FAILED)
    assert result.message == 'the node was deactivated'
    assert planner.searcher.closed
    assert not planner.send_goal(goal()).accepted
    assert manager.ask(Transition.TRANSITION_ACTIVATE)
    assert planner.send_goal(goal()).accepted


#: What is searched for; no search of these tests computes anything.
BODY = ConvexObject.disc((0.716, 0.43), 0.3)
SEARCH = load_robot('nine_member').home, BODY, GraspRequirements(), 0
DEADLINE = 240.0


def answer_of(searcher):
    deadline = time.monotonic() + DEADLINE
    while (answer := searcher.answer()) is None:
        assert time.monotonic() < deadline
    return answer


@pytest.mark.parametrize(
    ('error', 'outcome', 'words'),
    [
        (GraspError('no such module'), SearchOutcome.BAD_GOAL, 'no such module'),
        (StructureError('two laws'), SearchOutcome.FAILED, 'two laws'),
        (SolverError('no step'), SearchOutcome.FAILED, 'no step'),
        (ZeroDivisionError('an accident'), SearchOutcome.FAILED, 'ZeroDivisionError: an accident'),
        (BrokenProcessPool('gone'), SearchOutcome.FAILED, 'a process of the search died'),
    ],
)
def test_every_error_of_a_search_is_its_result(error, outcome, words):
    def plan(*_arguments, **_options):
        raise error

    searcher = Searcher(1, plan)
    assert searcher.answer() is None
    searcher.begin(*SEARCH, 0.0)
    answer = answer_of(searcher)
    assert (answer.outcome, answer.plan) == (outcome, None)
    assert words in answer.message
    assert searcher.answer() is None
    assert searcher.progress() is None
    searcher.close()


@pytest.mark.parametrize(
    ('estimate', 'limit', 'left'), [(10.0, 0.0, 10.0), (50.0, 20.0, 17.0), (None, 20.0, None)]
)
def test_the_time_left_is_no_longer_than_the_limit(estimate, limit, left, monkeypatch):
    now = 100.0
    # The clock of the machine.
    monkeypatch.setattr(workers.time, 'monotonic', lambda: now)

    def plan(config, body, needs, seed, executor, on_progress, stop, uncertainty):
        nonlocal now
        now += 3.0
        on_progress(Progress(5, 1, 2.0, 0.5, estimate))

    searcher = Searcher(1, plan)
    searcher.begin(*SEARCH, limit)
    while searcher.progress().evaluations == 0:
        pass
    result = searcher.progress()
    searcher.close()
    assert (result.evaluations, result.found, result.best, result.share) == (5, 1, 2.0, 0.5)
    assert result.time_left == (left if left is None else pytest.approx(left))


@pytest.mark.parametrize(
    ('complete', 'requested', 'outcome'),
    [
        (True, False, SearchOutcome.NONE_FOUND),
        (False, False, SearchOutcome.TIME_OUT),
        (False, True, SearchOutcome.CANCELLED),
    ],
)
def test_a_plan_without_grasps_has_its_reason(complete, requested, outcome):
    plan = GraspPlan((), complete, None, 7, 2, 0.1)
    searcher = Searcher(1, lambda *_, **__: plan)
    searcher.begin(*SEARCH, 0.0)
    assert searcher.progress() == Progress(0, 0, None, 0.0, None)
    if requested:
        searcher.cancel()
    answer = answer_of(searcher)
    assert (answer.outcome, answer.plan) == (outcome, plan)
    assert 'in 7 evaluations' in answer.message
    searcher.close()
