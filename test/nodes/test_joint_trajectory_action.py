# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The standard trajectory action with its meaning, and our own, which means the same."""

from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Time
from isotruss_msgs.action import FollowRollerTrajectory
from isotruss_ros.nodes.manipulation import trajectory_following
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.simulator.node import Simulator
import joint_trajectory_action
from joint_trajectory_action import FollowJointTrajectory, tolerance
from manual_world import world
import numpy as np
from probe import overrides
import pytest
from std_msgs.msg import Bool
from trajectories import AWAY, HOME, lasting, NAMES, trajectory
from trajectory_msgs.msg import MultiDOFJointTrajectory

Result = FollowRollerTrajectory.Result
KINDS = {'standard': FollowJointTrajectory, 'own': FollowRollerTrajectory}


@pytest.fixture(params=KINDS)
def kind(request):
    """Return the type of an action."""
    return KINDS[request.param]


@pytest.fixture
def make(monkeypatch):
    """Return what makes the simulator, with faults, and the node."""
    joint_trajectory_action.install(monkeypatch)
    return lambda **faults: world(
        lambda: Simulator(overrides(command_timeout=2.0, **faults)),
        lambda: Manipulation(overrides(command_timeout=2.0)),
    )


def send(w, kind, *rows, stamp=None, times=None, names=NAMES, **fields):
    """Send a goal once the rollers are measured; return it."""
    w.until(lambda: w.nodes[2].describe()['age of joint states [s]'] != 'none received')
    message = trajectory(*rows, times=times, names=names)
    if stamp is not None:
        nanoseconds = round(1e9 * (w.probe.past(0.0) + stamp))
        message.header.stamp = Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
    return w.send_goal(kind.Goal(trajectory=message, **fields))


def ended(w, goal):
    """Return status and code of a goal."""
    w.until(lambda: goal.ended)
    status, result = goal.result()
    return status, result.error_code


SUCCEEDED = (GoalStatus.STATUS_SUCCEEDED, Result.SUCCESSFUL)


def aborted(code):
    """Return how a goal ends that is aborted with a code."""
    return GoalStatus.STATUS_ABORTED, code


def test_both_actions_are_offered_where_control_msgs_is_installed(make):
    with make():
        names = [name for _, name in trajectory_following._offered_actions()]
    assert names == [
        'follow_roller_trajectory',
        'joint_trajectory_controller/follow_joint_trajectory',
    ]


def test_only_our_action_is_offered_without_control_msgs():
    names = [name for _, name in trajectory_following._offered_actions()]
    assert names == ['follow_roller_trajectory']


def test_one_point_is_driven_to_from_where_the_rollers_are(make, kind):
    with make() as w:
        assert ended(w, send(w, kind, AWAY, times=[0.5])) == SUCCEEDED
        assert w.travel() == pytest.approx(AWAY, abs=1e-4)


@pytest.mark.parametrize(
    ('bound', 'late', 'ending'),
    [
        (1e-9, 0.2, aborted(Result.GOAL_TOLERANCE_VIOLATED)),
        (1e-9, 0.0, aborted(Result.GOAL_TOLERANCE_VIOLATED)),
        (1e-3, 0.2, SUCCEEDED),
        (-1.0, 0.2, SUCCEEDED),
        (0.0, 0.5, SUCCEEDED),
    ],
)
def test_the_goal_tolerance_is_kept(make, kind, bound, late, ending):
    with make(encoder_step=7e-6) as w:
        goal = send(
            w,
            kind,
            HOME,
            AWAY,
            goal_tolerance=[tolerance(name, bound) for name in NAMES],
            goal_time_tolerance=lasting(late),
        )
        began = w.now
        assert ended(w, goal) == ending
        if ending != SUCCEEDED and late:
            assert w.now - began == pytest.approx(0.4 + late, abs=0.1)


def test_a_roller_that_does_not_arrive_in_time_violates_the_goal(make, kind):
    with make(stuck_roller=NAMES[0]) as w:
        goal = send(w, kind, HOME, AWAY, goal_time_tolerance=lasting(0.3))
        began = w.now
        assert ended(w, goal) == aborted(Result.GOAL_TOLERANCE_VIOLATED)
        assert w.now - began < 1.0
        assert NAMES[0] in goal.result()[1].error_string


@pytest.mark.parametrize('bounds', [{'position': 2e-3}, {'velocity': 0.02}])
def test_the_path_tolerance_is_kept(make, kind, bounds):
    with make(stuck_roller=NAMES[0]) as w:
        goal = send(w, kind, HOME, AWAY, path_tolerance=[tolerance(NAMES[0], **bounds)])
        began = w.now
        assert ended(w, goal) == aborted(Result.PATH_TOLERANCE_VIOLATED)
        assert w.now - began < 0.4
        assert f'roller {NAMES[0]} is ' in goal.result()[1].error_string


def test_a_path_tolerance_of_rollers_that_follow_is_not_violated(make, kind):
    with make() as w:
        bounds = [tolerance(name, 2e-3) for name in NAMES]
        assert ended(w, send(w, kind, HOME, AWAY, path_tolerance=bounds)) == SUCCEEDED


def test_a_stamp_in_the_future_begins_then(make, kind):
    with make() as w:
        goal = send(w, kind, HOME, AWAY, stamp=2.0)
        w.spin(1.9)
        assert not w.travel().any()
        w.spin(0.2)
        assert w.travel().any()
        assert ended(w, goal) == SUCCEEDED


def test_an_emergency_stop_ends_a_trajectory_that_has_not_begun(make, kind):
    with make() as w:
        goal = send(w, kind, HOME, AWAY, stamp=2.0)
        w.spin(0.5)
        w.probe.stops.publish(Bool(data=True))
        assert ended(w, goal) == aborted(Result.PATH_TOLERANCE_VIOLATED)


def test_an_old_stamp_has_its_code(make, kind):
    with make() as w:
        goal = send(w, kind, HOME, AWAY, stamp=-3.0)
        assert ended(w, goal) == aborted(Result.OLD_HEADER_TIMESTAMP)


@pytest.mark.parametrize(
    'names', [NAMES[:-1], [*NAMES[:-1], 'nowhere'], [*NAMES[:-1], NAMES[0]], []]
)
def test_joints_that_are_not_those_of_the_robot_have_their_code(make, kind, names):
    with make() as w:
        rows = [row[: len(names)] for row in (HOME, AWAY)]
        goal = send(w, kind, *rows, names=names)
        assert ended(w, goal) == aborted(Result.INVALID_JOINTS)


def test_a_tolerance_of_an_unknown_joint_has_its_code(make, kind):
    with make() as w:
        goal = send(w, kind, HOME, AWAY, goal_tolerance=[tolerance('nowhere', 1.0)])
        assert ended(w, goal) == aborted(Result.INVALID_JOINTS)


#: Goals that cannot be followed, with words of the reason.
HOPELESS = {
    'no points': ({'rows': []}, '0 points; must be 1'),
    'elsewhere': ({'rows': [HOME + 0.1, AWAY + 0.1]}, 'must begin within 0.01 m'),
    'too quick': ({'rows': [HOME, 50.0 * AWAY]}, 'm/s; must be at most'),
    'too late': ({'rows': [HOME, AWAY], 'stamp': 1e6}, 'in the future'),
    'no number': ({'rows': [HOME, AWAY * np.nan]}, 'finite'),
    'no tolerance': (
        {'rows': [HOME, AWAY], 'path_tolerance': [tolerance(NAMES[0], -2.0)]},
        'must be positive, 0 or -1',
    ),
    'acceleration': (
        {'rows': [HOME, AWAY], 'path_tolerance': [tolerance(NAMES[0], acceleration=1.0)]},
        'is not measured',
    ),
}


@pytest.mark.parametrize('case', HOPELESS)
def test_a_goal_that_cannot_be_followed_is_rejected_with_the_reason(make, kind, case, capfd):
    fields, words = HOPELESS[case]
    with make() as w:
        running = send(w, kind, HOME, AWAY, times=[0.0, 3.0])
        goal = send(w, kind, *fields['rows'], **{k: v for k, v in fields.items() if k != 'rows'})
        if kind is FollowJointTrajectory:
            assert not goal.accepted
        else:
            assert ended(w, goal) == aborted(Result.INVALID_GOAL)
            assert words in goal.result()[1].error_string
        # The one under way goes on.
        assert not running.ended
    assert words in capfd.readouterr().err


@pytest.mark.parametrize(
    'fields',
    [
        {'multi_dof_trajectory': MultiDOFJointTrajectory(joint_names=['base'])},
        {'component_path_tolerance': ['any']},
        {'component_goal_tolerance': ['any']},
    ],
)
def test_joints_of_several_degrees_are_refused_in_words(make, fields, capfd):
    with make() as w:
        assert not send(w, FollowJointTrajectory, HOME, AWAY, **fields).accepted
    assert 'rollers have one degree of freedom' in capfd.readouterr().err


def test_our_type_has_the_fields_of_the_standard_one():
    fields = set(FollowRollerTrajectory.Goal.get_fields_and_field_types())
    only_multi = {'multi_dof_trajectory', 'component_path_tolerance', 'component_goal_tolerance'}
    assert fields == set(joint_trajectory_action.FIELDS) - only_multi
    codes = [
        'SUCCESSFUL',
        'INVALID_GOAL',
        'INVALID_JOINTS',
        'OLD_HEADER_TIMESTAMP',
        'PATH_TOLERANCE_VIOLATED',
        'GOAL_TOLERANCE_VIOLATED',
    ]
    assert [getattr(Result, name) for name in codes] == [0, -1, -2, -3, -4, -5]
