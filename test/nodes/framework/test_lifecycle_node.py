# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Managed nodes: silent while inactive, reconfigured, and with diagnostics."""

from diagnostic_msgs.msg import DiagnosticStatus
from isotruss_ros.core import load_robot, Status, tangent_center
from isotruss_ros.nodes.grasp_analysis import GraspAnalysisNode
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.simulator.node import Simulator
from lifecycle_msgs.msg import Transition
from manual_world import DOWN, Manager, UP, world
import numpy as np
from probe import manipulation, N, overrides, ROBOT
import pytest

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
        for transition in (
            Transition.TRANSITION_DEACTIVATE,
            Transition.TRANSITION_ACTIVE_SHUTDOWN,
        ):
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
