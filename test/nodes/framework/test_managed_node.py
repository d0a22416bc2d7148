# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Managed nodes: states, steps of transitions, and errors in them."""

import gc

from diagnostic_msgs.msg import DiagnosticStatus
from isotruss_msgs.action import FollowObjectPath
from isotruss_ros.core import IsotrussError
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.parameters import Spec
from lifecycle_msgs.msg import Transition
from manual_world import check_refused, Manager, world
from probe import overrides
import pytest
from rclpy.action import ActionServer
from rclpy.parameter import Parameter
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

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
