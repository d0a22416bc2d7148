# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Managed nodes: transitions and their errors, diagnostics, reasons in the log, random goals."""

import contextlib
import copy
import gc
import math
import re
from types import SimpleNamespace

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import (
    FollowObjectPath,
    FollowRollerTrajectory,
    MoveObject,
    PickObject,
    PlaceObject,
    PlanGrasp,
)
from isotruss_msgs.msg import RollerTolerance
from isotruss_ros.core import IsotrussError, load_robot, Pose, Status, tangent_center
from isotruss_ros.core.planning.grasp_plan import GraspPlan
from isotruss_ros.nodes.conversions.messages import to_pose_message
from isotruss_ros.nodes.conversions.path_messages import to_duration
from isotruss_ros.nodes.framework import diagnostics
from isotruss_ros.nodes.framework.diagnostics import MIN_LOG_PERIOD, QUIET_TIME, ReasonLog
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.parameters import Spec
from isotruss_ros.nodes.grasp.searcher import Searcher
from isotruss_ros.nodes.grasp_analysis import GraspAnalysisNode
from isotruss_ros.nodes.grasp_planner import GraspPlanner
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.path_follower import PathFollower
from isotruss_ros.nodes.pick_and_place.node import PickAndPlace
from isotruss_ros.nodes.simulator.node import Simulator
from lifecycle_msgs.msg import Transition
from manual_world import check_refused, DOWN, Manager, UP, world
from nav_msgs.msg import Path
import numpy as np
from probe import CENTER, manipulation, N, overrides, ROBOT
import pytest
from rclpy.action import ActionServer
from rclpy.parameter import Parameter
from robots import SHARE
from std_msgs.msg import Bool, Header
from std_srvs.srv import Trigger
from trajectories import AWAY, FollowJointTrajectory, HOME, NAMES, trajectory

OUTPUTS = {
    Manipulation: ('command', 'status'),
    Simulator: ('joints', 'pose'),
    GraspAnalysisNode: ('state', 'closure'),
}


def counts(w, keys):
    """Return how many messages came of each."""
    return [len(w.probe.seen[key]) for key in keys]


@pytest.mark.parametrize('kind', OUTPUTS)
def test_waits_unconfigured_without_autostart_and_publishes_only_while_active(kind):
    keys = OUTPUTS[kind]
    with world(lambda: kind(overrides(autostart=False))) as w:
        manager = Manager(w, w.nodes[1].get_name())
        assert manager.state() == 'unconfigured'
        for transition, speaks in zip((*UP, *DOWN), (False, True, False, False), strict=True):
            assert manager.ask(transition)
            w.spin(0.1)  # what was on its way
            before = counts(w, keys)
            if speaks:
                w.until(lambda b=before: min(np.subtract(counts(w, keys), b)) > 5)
            else:
                w.spin(0.1, w.probe.send_joints)
                mine = 1 if keys[0] == 'joints' else 0
                assert counts(w, keys[mine:]) == before[mine:]


def test_manipulation_commands_zero_before_it_is_deactivated():
    with world(manipulation()) as w:
        manager = Manager(w, 'manipulation')
        for transition in (DOWN[0], Transition.TRANSITION_ACTIVE_SHUTDOWN):
            w.probe.seen['command'].clear()
            w.until(lambda: np.nan_to_num(w.command()).any(), w.probe.send_all)
            assert manager.ask(transition)
            w.until(lambda: not w.command().any())
            before = len(w.probe.seen['command'])
            w.spin(0.1, w.probe.send_all)
            assert len(w.probe.seen['command']) == before
            if manager.state() == 'inactive':
                assert manager.ask(Transition.TRANSITION_ACTIVATE)
        assert manager.state() == 'finalized'


def test_manipulation_is_configured_for_another_robot():
    with world(manipulation()) as w:
        manager = Manager(w, 'manipulation')
        w.change(grip_module='north/Z')
        w.until_code(Status.OK, w.probe.send_all)
        assert all(manager.ask(transition) for transition in DOWN)
        w.change(robot='triangle')
        # The grip module is still that of the robot before.
        assert not manager.ask(Transition.TRANSITION_CONFIGURE)
        assert manager.state() == 'unconfigured'
        w.until(lambda: w.report('manipulation').level == DiagnosticStatus.ERROR)
        assert 'no such module' in w.report('manipulation').message
        w.change(grip_module='main/T')
        assert all(manager.ask(transition) for transition in UP)
        triangle = load_robot('triangle')
        center = tangent_center(triangle.home, 'main/T', 0.3)
        names = list(triangle.roller_names)

        def send():
            w.probe.send_joints(name=names, position=[0.0] * len(names))
            w.probe.send_pose(center=center, frame=triangle.frame)
            w.probe.send_twist((0.01, 0.0, 0.0))

        w.until(lambda: w.code() is not None and w.code() < Status.HALT_NO_TWIST, send)
        w.until(lambda: len(w.probe.last('command').data) == len(names), send)
        w.until(lambda: w.report('manipulation').hardware_id == 'triangle', send)


def test_manipulation_reports_its_loop_and_its_inputs():
    with world(manipulation()) as w:
        w.until(lambda: w.report('manipulation').level == DiagnosticStatus.OK)
        assert w.detail('age of joint states [s]') == 'none received'

        def moving():
            return w.detail('status') == 'OK' and int(w.detail('cycles')) > 10

        w.until(moving, w.probe.send_all)
        assert w.report('manipulation').hardware_id == ROBOT.name
        assert w.detail('emergency stop') == 'no'
        for name in ('twist', 'joint states', 'object pose'):
            assert float(w.detail(f'age of {name} [s]')) < 0.2
        median = float(w.detail('cycle time, median [s]'))
        assert 0.0 < median <= float(w.detail('cycle time, longest [s]'))
        assert int(w.detail('overruns')) >= 0
        w.until(
            lambda: w.report('manipulation').level == DiagnosticStatus.ERROR,
            lambda: (w.probe.send_all(), w.probe.send_joints(position=[np.nan] * N)),
        )


@pytest.fixture
def log(monkeypatch):
    """Return a log by a clock of its own, its `lines` and its `now`."""
    result = SimpleNamespace(now=100.0, lines=[])
    # The clock of the machine.
    monkeypatch.setattr(diagnostics.time, 'monotonic', lambda: result.now)
    result.log = ReasonLog(result.lines.append)
    return result


def hold(log, kind, text, times, period=0.01):
    """Note a reason again and again; numbers in the text change."""
    for number in range(times):
        log.log.note(kind, text.format(0.01 * number))
        log.now += period


def test_a_reason_that_holds_is_logged_once_and_its_end_with_its_count(log):
    hold(log, 'stale', 'pose: {:.3f} s old', 30_000)
    assert log.lines == ['pose: 0.000 s old']
    log.log.end()
    assert len(log.lines) == 1
    log.now += QUIET_TIME
    log.log.end()
    assert log.lines[1:] == ['no longer, after 30000 times: pose: 0.000 s old']


def test_the_end_of_a_slow_loop_is_logged_with_its_lowest_rate(log):
    for rate in (43.7, 21.0, 60.0):
        log.log.note('rate', f'the loop reaches {rate} of 100 Hz', rate)
    log.log.end(0.0)
    assert log.lines == [
        'the loop reaches 43.7 of 100 Hz',
        'no longer, after 3 times: the loop reaches 21.0 of 100 Hz',
    ]


def test_alternating_reasons_are_logged_at_a_limited_rate(log):
    for _ in range(500):
        hold(log, 'status', 'a', 1)
        hold(log, 'status', 'b', 1)
    assert len(log.lines) <= 2 * (10.0 / MIN_LOG_PERIOD + 1)


@pytest.mark.parametrize(('late', 'slow'), [(1.4, True), (1.1, False)])
def test_a_cycle_that_does_not_reach_its_rate_is_a_warning_with_the_rate(late, slow, capfd):
    with world(manipulation(rate=40.0)) as w:
        w.busy = lambda: 0.025 * late
        w.spin(2.5, w.probe.send_all)
        report = w.report('manipulation')
    assert (report.level == DiagnosticStatus.WARN) is slow
    for words in (report.message, capfd.readouterr().err):
        rates = re.findall(r'the loop reaches ([\d.]+) of 40 Hz', words)
        assert bool(rates) is slow
        assert list(map(float, rates)) == pytest.approx([40.0 / late] * len(rates), rel=0.1)


PLACE = Spec('place', 'here', 'Where', read_only=True)
SPEED = Spec('speed', 1.0, 'How quick', bounds=(0.0, 2.0))
#: What a step of the node raises: one of ours, one that nobody thought of.
REFUSAL = IsotrussError('the place is taken')
ACCIDENT = ZeroDivisionError('an accident')
STEPS = ('configure', 'activate', 'deactivate', 'cleanup')


class Toy(ManagedNode):
    """A node with entities of every kind, whose steps can fail."""

    node_name = 'toy'
    specs = (PLACE, SPEED)
    awaited = ('input', 'act')

    def __init__(self, failures=None, **values):
        self.failures = failures or {}
        super().__init__(overrides(**values))

    def _step(self, name):
        if name in self.failures:
            raise self.failures[name]

    def configure(self):
        self.input = self.create_subscription(Bool, 'input', lambda message: None, 1)
        self.output = self.create_lifecycle_publisher(Bool, 'output', 1)
        self.service = self.create_service(Trigger, 'service', lambda request, response: response)
        self.server = ActionServer(self, FollowObjectPath, 'act', lambda goal: None)
        self.place = self.values.place
        self._step('configure')

    def _check(self, new):
        if new.get('speed') == 1.5:
            raise IsotrussError('not this speed')

    def _apply(self):
        self.applied = self.values.speed

    def activate(self):
        self.timer = self.create_timer(0.01, lambda: self.output.publish(Bool()))
        self._step('activate')

    def deactivate(self):
        self.output.publish(Bool(data=True))
        self._step('deactivate')

    def cleanup(self):
        self._step('cleanup')

    def entities(self):
        kinds = (self.timers, self.subscriptions, self.services, self.publishers, self.waitables)
        return sum(len(list(kind)) for kind in kinds)


@pytest.fixture
def waiting():
    with world(lambda: Toy(autostart=False)) as w:
        yield w.nodes[1], Manager(w, 'toy'), w


def test_the_life_cycle_leaves_nothing_behind(waiting):
    node, _, _ = waiting
    known = []
    for _ in range(3):
        for step in STEPS:
            getattr(node, f'trigger_{step}')()
        gc.collect()
        known.append((node.entities(), len(node.default_callback_group.entities)))
    assert known[-1] == known[1]


UNKNOWN = [
    *((transition, '') for transition in (*Manager.UP, Transition.TRANSITION_CLEANUP)),
    (Transition.TRANSITION_DESTROY, ''),
    (Transition.TRANSITION_CALLBACK_SUCCESS, ''),
    (255, ''),
    (0, 'fly'),
    (0, 'activate'),
]


def test_an_unknown_transition_is_rejected():
    with world(Toy) as w:
        manager = Manager(w, 'toy')
        for transition, label in UNKNOWN:
            assert not manager.ask(transition, label)
            assert manager.state() == 'active'


def test_read_only_parameters_change_while_unconfigured_only(waiting):
    node, manager, _ = waiting

    def change(name, value):
        return node.set_parameters([Parameter(name, value=value)])[0]

    assert change('place', 'there').successful
    manager.ask(Transition.TRANSITION_CONFIGURE)
    assert (node.place, node.applied) == ('there', 1.0)
    refused = change('place', 'elsewhere')
    assert not refused.successful
    assert 'read-only unless the node is unconfigured' in refused.reason
    assert change('speed', 0.5).successful
    assert node.applied == 0.5
    assert 'not this speed' in change('speed', 1.5).reason
    manager.ask(Transition.TRANSITION_CLEANUP)
    assert change('place', 'elsewhere').successful
    assert change('speed', 1.5).successful  # for `configure` to judge
    assert not manager.ask(Transition.TRANSITION_CONFIGURE)
    assert manager.state() == 'unconfigured'
    assert change('speed', 1.0).successful
    assert manager.ask(Transition.TRANSITION_CONFIGURE)
    assert node.place == 'elsewhere'


@pytest.mark.parametrize(
    ('step', 'error', 'after'),
    [
        ('activate', REFUSAL, 'inactive'),
        ('activate', ACCIDENT, 'unconfigured'),
        *(('configure', error, 'unconfigured') for error in (REFUSAL, ACCIDENT)),
        *(('deactivate', error, 'unconfigured') for error in (REFUSAL, ACCIDENT)),
        *(('cleanup', error, 'finalized') for error in (REFUSAL, ACCIDENT)),
    ],
)
def test_an_error_in_a_step_is_reported_and_the_services_remain(waiting, step, error, after):
    node, manager, w = waiting
    bare = node.entities()
    node.failures[step] = error
    for name, transition in zip(STEPS, (*Manager.UP, *Manager.DOWN), strict=True):
        assert manager.ask(transition) == (name != step)
        if name == step:
            break
    assert manager.state() == after
    reports = [array.status[0] for _, array in w.probe.seen['diagnostics']]
    errors = [report.message for report in reports if report.level == DiagnosticStatus.ERROR]
    assert any(str(error) in message for message in errors)
    node.failures.clear()
    if after == 'finalized':
        return
    if after == 'unconfigured':
        assert node.entities() == bare
        assert manager.ask(Transition.TRANSITION_CONFIGURE)
    assert manager.ask(Transition.TRANSITION_ACTIVATE)
    assert manager.state() == 'active'


@pytest.mark.parametrize('step', ['configure', 'activate'])
@pytest.mark.parametrize('error', [REFUSAL, ACCIDENT])
def test_a_node_that_fails_to_start_raises_the_reason(step, error):
    check_refused(lambda: Toy({step: error}), str(error))


def test_reports_every_second_and_at_once_when_the_level_changes():
    with world(lambda: Toy(autostart=False)) as w:
        reports = w.probe.seen['diagnostics']
        w.until(lambda: len(reports) >= 2)
        report = w.report('toy')
        assert report.level == DiagnosticStatus.WARN
        assert report.message == 'unconfigured'
        node, count = w.nodes[1], len(reports)
        for timer in list(node.timers):
            node.destroy_timer(timer)  # what comes now is not the report of every second
        node.failures['configure'] = REFUSAL
        Manager(w, 'toy').ask(Transition.TRANSITION_CONFIGURE)
        w.until(lambda: len(reports) > count)
        assert reports[-1][1].status[0].level == DiagnosticStatus.ERROR


NUMBERS = (0.0, -0.0, 1.0, -1.0, 1e-9, 1e6, 1e308, -1e308, 5e-324, math.nan, math.inf, -math.inf)
INTEGERS = (0, 1, -1, 2**31 - 1, -(2**31))
TEXTS = ('', 'nobody', 'x' * 1000, 'ö/☃', 'north/Z', 'north/R-P', 'truss')
IN_TRUSS = Header(frame_id='truss')
COUNT = max(20, round(300 * SHARE))


def is_message(value):
    return hasattr(value, 'get_fields_and_field_types')


def leaves(message):
    """Yield the messages and the names of the fields that contain numbers, texts or lists."""
    for name in message.get_fields_and_field_types() if is_message(message) else vars(message):
        value = getattr(message, name)
        for part in value if isinstance(value, list) else [value]:
            if is_message(part):
                yield from leaves(part)
        if not is_message(value):
            yield message, name


def change(value, rng):
    """Return another value of the same type; an empty list, a list twice, or another element."""
    chosen = {str: TEXTS, bool: (True, False), int: INTEGERS, float: NUMBERS}.get(type(value))
    if chosen is not None:
        return type(value)(rng.choice(chosen))
    values = value.tolist() if hasattr(value, 'tolist') else value.copy()
    how = 2 if isinstance(value, np.ndarray) else rng.integers(4)  # arrays have one length
    if how > 1 and values and not is_message(values[0]):
        place = rng.integers(len(values))
        values[place] = change(values[place], rng)
        return values
    return how % 2 * 2 * values


def vary(message, rng):
    """Return a copy of a message with one to three fields, however deep, replaced."""
    changed = copy.deepcopy(message)
    for _ in range(rng.integers(1, 4)):
        fields = list(leaves(changed))
        owner, name = fields[rng.integers(len(fields))]
        # The type of the message may refuse the value.
        with contextlib.suppress(AssertionError, ValueError):
            setattr(owner, name, change(getattr(owner, name), rng))
    return changed


class IdlePlanner(GraspPlanner):
    """Planner whose searches find nothing, at once and without processes."""

    searcher_type = staticmethod(
        lambda _: Searcher(1, lambda *_, **__: GraspPlan((), True, None, 0, 0, 0.0))
    )


def path(*steps):
    poses = np.cumsum([(*CENTER, 0.3), *steps], axis=0)
    poses = [PoseStamped(pose=to_pose_message(Pose(*pose))) for pose in poses.tolist()]
    return Path(header=IN_TRUSS, poses=poses)


LYING = PoseStamped(header=IN_TRUSS, pose=to_pose_message(Pose(*map(float, CENTER), 0.0)))
FOLLOWED = {
    'trajectory': trajectory(HOME, AWAY),
    'path_tolerance': [RollerTolerance(name=NAMES[0], position=0.01)],
    'goal_tolerance': [RollerTolerance(name=NAMES[1], position=0.01)],
    'goal_time_tolerance': to_duration(0.5),
}
GOALS = {
    'FollowRollerTrajectory': (Manipulation, lambda: FollowRollerTrajectory.Goal(**FOLLOWED)),
    'FollowJointTrajectory': (Manipulation, lambda: FollowJointTrajectory.Goal(**FOLLOWED)),
    'FollowObjectPath': (PathFollower, lambda: FollowObjectPath.Goal(path=path((0.0, 0.02, 0.0)))),
    'PlanGrasp': (IdlePlanner, lambda: PlanGrasp.Goal(object_pose=LYING, object_diameter=0.3)),
    'PickObject': (PickAndPlace, lambda: PickObject.Goal(module='north/Z', squeeze=10.0)),
    'PlaceObject': (PickAndPlace, PlaceObject.Goal),
    'MoveObject': (PickAndPlace, lambda: MoveObject.Goal(path=path((0.0, 0.02, 0.0)))),
}


@pytest.mark.parametrize('name', GOALS)
def test_random_goals_are_answered_and_nodes_continue(name, monkeypatch):
    kind, good = GOALS[name]
    FollowJointTrajectory.install(monkeypatch)
    rng = np.random.default_rng(7)
    with world(lambda: kind(overrides(command_timeout=1.0))) as w:
        w.spin(0.2, w.probe.send_all)
        for _ in range(COUNT):
            goal = w.send_goal(vary(good(), rng))
            w.spin(0.02, w.probe.send_all)
            if goal.accepted and not goal.ended:
                goal.cancel()
                w.spin(0.02, w.probe.send_all)
            assert w.nodes[1].active


def test_a_second_goal_is_refused_with_the_name_of_the_active_one():
    with world(lambda: PickAndPlace(overrides())) as w:
        w.spin(0.2, w.probe.send_all)
        first = w.send_goal(PickObject.Goal())
        second = w.send_goal(PlaceObject.Goal())
        _, result = w.finish(second, w.probe.send_all)
        assert first.accepted
        assert result.code == PlaceObject.Result.NOT_READY
        assert 'PickObject has been executed for ' in result.message
