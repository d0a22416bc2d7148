"""Node grasp_planner: goals, feedback, cancelling, results."""

import math
import re
import statistics
import time

from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Wrench
from isotruss_msgs.action import PlanGrasp
from isotruss_ros.core import Cylinder, GraspRequirements, plan_grasps
from isotruss_ros.nodes.trajectory_messages import roller_path
from isotruss_ros.plan.searcher import Outcome
import numpy as np
from planning import assert_same, CENTER, Client, DIAMETER, goal, NO_MARGIN, node
from probe import Manager, ROBOT, world
import pytest

pytestmark = pytest.mark.nodes

Result = PlanGrasp.Result
#: A goal is to end this soon after it was cancelled [s].
CANCELLED_WITHIN = 0.2


@pytest.fixture(scope='module')
def planner():
    """Return a client of a node with two processes that searches from home."""
    with world(node(workers=2)) as w:
        yield Client(w)


def test_codes_are_those_of_the_action():
    for outcome in Outcome:
        assert getattr(Result, outcome.name) == int(outcome)
    constants = [name for name in dir(Result) if name.isupper() and name != 'SLOT_TYPES']
    assert sorted(constants) == sorted(outcome.name for outcome in Outcome)


def seconds(duration):
    """Return a duration in seconds."""
    return duration.sec + 1e-9 * duration.nanosec


def assert_way_can_be_driven(grasp, expected):
    """Check the trajectory: it can be followed, as quick as the rollers can, and says `touch`."""
    fastest = ROBOT.description.max_speed
    assert roller_path(grasp.path, ROBOT).duration > 0.0  # what follows it takes it
    times = np.array([seconds(point.time_from_start) for point in grasp.path.points])
    assert times[0] == 0.0
    speeds = np.abs(np.diff(expected.path, axis=0)).max(axis=1) / np.diff(times)
    assert speeds.max() == pytest.approx(fastest, rel=1e-6)
    long = np.diff(times) > 0.0101
    assert speeds[long] == pytest.approx(fastest, rel=1e-6)
    assert seconds(grasp.touch) == times[expected.touch]


def test_answers_as_the_core_does_on_two_processes(planner):
    expected = plan_grasps(ROBOT.home, Cylinder(CENTER, DIAMETER), seed=3)
    status, result = planner.plan(goal(seed=3))
    assert (status, result.code) == (GoalStatus.STATUS_SUCCEEDED, Result.FOUND)
    assert_same(result, expected)
    for grasp, other in zip(result.grasps, expected.grasps, strict=True):
        assert_way_can_be_driven(grasp, other)
    assert result.missed == ''
    assert f'{len(result.grasps)} grasps' in result.message


def test_takes_over_every_requirement(planner):
    wrench = Wrench()
    wrench.force.x, wrench.torque.z = 0.01, 0.001
    asked = goal(
        center=(0.52, 0.31),
        object_diameter=0.25,
        friction=0.7,
        external_wrench=wrench,
        module='north/R',
        min_margin=1e-4,
        max_contact_force=19.0,
        max_total_force=37.0,
        min_rigidity=0.2,
        measure='stiffness',
        direction=np.array([1.0, 0.0, 0.5]),
        count=1,
        seed=5,
    )
    needs = GraspRequirements(
        0.7, (0.01, 0.0, 0.001), 'north/R', 1e-4, 19.0, 37.0, 0.2, None, None, 'stiffness',
        (1.0, 0.0, 0.5), 1,
    )  # fmt: skip
    status, result = planner.plan(asked)
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert_same(result, plan_grasps(ROBOT.home, Cylinder((0.52, 0.31), 0.25), needs, seed=5))


def test_tells_how_far_it_is_and_ends_soon_when_cancelled(planner):
    delays = []
    for _ in range(3):
        handle = planner.begin(goal(count=1000))
        planner.until(lambda: planner.feedback[-1][1].found > 0)
        began = time.monotonic()
        handle.cancel_goal_async()
        status, result = planner.result(handle)
        delays.append(time.monotonic() - began)
        assert (status, result.code) == (GoalStatus.STATUS_CANCELED, Result.CANCELLED)
        assert result.grasps
        assert all(grasp.path.points for grasp in result.grasps)
    assert statistics.median(delays) <= CANCELLED_WITHIN
    told = [message for _, message in planner.feedback]
    assert math.isnan(told[0].best)
    assert told[-1].best <= result.grasps[0].score
    assert all(0.0 <= message.progress <= 1.0 for message in told)
    assert [m.evaluations for m in told] == sorted(m.evaluations for m in told)
    assert told[-1].time_left >= 0.0
    gaps = np.diff([when for when, _ in planner.feedback])
    assert statistics.median(gaps) <= 0.2


def test_says_at_the_time_limit_what_was_missed(planner):
    status, result = planner.plan(goal(min_margin=NO_MARGIN, time_limit=1.0))
    assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.TIME_OUT)
    assert not result.grasps
    assert result.computing_time >= 1.0
    left = [message.time_left for _, message in planner.feedback]
    assert not any(time_left > 1.0 for time_left in left)
    assert result.missed


def test_says_what_the_nearest_candidate_misses(planner):
    status, result = planner.plan(goal(center=(3.0, 3.0)))
    assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.NONE_FOUND)
    assert (result.missed, result.missed_value, result.missed_bound) == ('enclosed', 0.0, 1.0)
    assert 'no loop of the robot' in result.message


def torque(z):
    """Return a wrench."""
    message = Wrench()
    message.torque.z = z
    return message


@pytest.mark.parametrize(
    ('fields', 'words'),
    [
        ({'frame': 'map'}, "object pose in frame 'map': must be in 'truss'"),
        ({'center': (math.nan, 0.0)}, 'x nan m: must be finite'),
        ({'center': (0.0, -math.inf)}, 'y -inf m: must be finite'),
        ({'center': (1e300, 0.0)}, 'x 1e[+]300 m: must be finite, at most'),
        ({'object_diameter': 0.0}, 'diameter 0.0 m: must be positive'),
        ({'object_diameter': -0.3}, 'diameter -0.3 m: must be positive'),
        ({'object_diameter': math.nan}, 'diameter nan m: must be finite'),
        ({'friction': -0.1}, 'friction: -0.1: must be a number, not negative'),
        ({'friction': math.inf}, 'friction: inf'),
        ({'external_wrench': torque(math.nan)}, 'torque.z must be finite'),
        ({'module': 'north/Q'}, "module 'north/Q': robot nine_member has no such module"),
        ({'module': 'x' * 10_000}, 'module .{1,90}: robot nine_member has no such module'),
        ({'min_margin': math.nan}, 'min_margin: nan'),
        ({'max_contact_force': -1.0}, 'max_contact_force: -1.0'),
        ({'max_total_force': math.nan}, 'max_total_force: nan'),
        ({'min_rigidity': -1.0}, 'min_rigidity: -1.0'),
        ({'measure': 'beauty' * 1000}, 'measure .{1,90}: must be one of closure_margin'),
        ({'measure': 'stiffness'}, 'direction: .0, 0, 0.: must say along what'),
        ({'direction': np.array([math.nan, 0.0, 0.0])}, 'direction'),
        ({'count': 0}, 'count 0: must be from 1 to 1000'),
        ({'count': 2**32 - 1}, 'count 4294967295: must be from 1'),
        ({'time_limit': -1.0}, 'time_limit -1.0 s: must be a number, not negative'),
        ({'time_limit': math.nan}, 'time_limit nan s'),
    ],
)
def test_says_what_is_wrong_with_a_goal(planner, fields, words):
    status, result = planner.plan(goal(**fields))
    assert (status, result.code) == (GoalStatus.STATUS_ABORTED, Result.BAD_GOAL)
    assert not result.grasps
    assert re.search(words, result.message), result.message


def test_rejects_a_goal_while_it_searches_and_answers_other_questions(planner):
    handle = planner.begin(goal(min_margin=NO_MARGIN))
    assert not planner.send(goal()).accepted
    assert Manager(planner._world, 'grasp_planner').state() == 'active'
    handle.cancel_goal_async()
    assert planner.result(handle)[1].code == Result.CANCELLED
