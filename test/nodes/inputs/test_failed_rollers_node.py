# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rollers that fail, and the edge of the good shapes, as the manipulation node deals with them."""

from functools import partial

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from isotruss_ros.core import ConvexObject, Grip, reachable_twists, Status
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.simulator.node import Simulator
from lifecycle_msgs.msg import Transition
from manual_world import DOWN, Manager, moving_world, UP, world
from nightly import some_now
import numpy as np
import probe
from probe import CENTER, DIAMETER, failed, LATCHED, maker, MODULE, N, overrides, ROBOT
import pytest
from std_srvs.srv import Trigger

FIRST, SECOND = ROBOT.roller_names[:2]
node = maker(Manipulation)


def names_in(w):
    status = w.probe.last('status')
    return () if status is None else tuple(status.failed_rollers)


def until_failed(w, *names, send=None):
    """Spin until the status names exactly these rollers."""
    w.until(lambda: names_in(w) == names and w.code() is not None, send or w.probe.send_all)


def until_detected(w):
    """Repeat encoder readings until rollers are detected as failed; return their names."""
    w.until(lambda: bool(names_in(w)), w.probe.send_all)
    return names_in(w)


def publish(w, *names):
    """Publish the failed rollers; return the publisher."""
    publisher = w.probe.create_publisher(DiagnosticArray, 'failed_rollers', LATCHED)
    publisher.publish(failed(*names))
    return publisher


def assert_held(w, *names, send=None):
    """Check that some cycles of commands hold these rollers at zero, and move others."""
    w.probe.seen['command'].clear()
    w.until(lambda: len(w.probe.seen['command']) > 10, send or w.probe.send_all)
    commands = np.array([m.data for _, m in w.probe.seen['command']])
    places = [ROBOT.roller_names.index(name) for name in names]
    assert not commands[:, places].any()
    assert commands.any()


def test_a_roller_that_failed_by_parameter_is_held_and_the_rest_goes_on():
    grip = Grip.at_module(ROBOT, MODULE, ConvexObject.disc(CENTER, DIAMETER))
    expected = reachable_twists(ROBOT.home, grip, {FIRST})
    with world(node(failed_rollers=[FIRST], failure_time=0.0)) as w:
        until_failed(w, FIRST)
        w.until(lambda: w.code() < Status.HALT_NO_TWIST, w.probe.send_all)
        assert w.probe.last('status').reachable_dof == len(expected)
        w.until(lambda: f'{len(expected)} of 3' in w.detail('reachable twists'), w.probe.send_all)
        assert w.detail('failed rollers') == FIRST
        assert w.report('manipulation').level == DiagnosticStatus.WARN
        assert FIRST in w.report('manipulation').message
        assert_held(w, FIRST)
        w.change(failed_rollers=[FIRST, SECOND])
        until_failed(w, FIRST, SECOND)
        assert_held(w, FIRST, SECOND)
        w.change(failed_rollers=[''])
        until_failed(w)
        w.until_code(Status.OK, w.probe.send_all)


def test_the_topic_names_failed_rollers_to_late_joiners_too():
    with world() as w:
        publisher = publish(w, SECOND, FIRST)
        w.add(Manipulation())
        until_failed(w, FIRST, SECOND)
        assert_held(w, FIRST, SECOND)
        publisher.publish(failed(SECOND))
        until_failed(w, SECOND)
        works = DiagnosticStatus(name=SECOND, level=DiagnosticStatus.WARN)
        publisher.publish(DiagnosticArray(status=[works]))
        until_failed(w)
        w.until_code(Status.OK, w.probe.send_all)


def test_the_last_message_of_a_burst_names_the_failed_rollers():
    with probe.world(node(failure_time=0.0)) as w:
        publisher = w.probe.create_publisher(DiagnosticArray, 'failed_rollers', 100)
        w.until(lambda: publisher.get_subscription_count() > 0)
        for name in 25 * (FIRST, SECOND):
            publisher.publish(failed(name))
        until_failed(w, SECOND)
        w.spin(0.2, w.probe.send_all)
        assert names_in(w) == (SECOND,)


@pytest.mark.parametrize(
    'names', some_now([[FIRST, 'W'], ['x' * 10**5], [*map(str, range(10**4)), 'ü']], 2)
)
def test_halts_on_unknown_names_of_failed_rollers(names):
    with moving_world() as w:
        publisher = publish(w, *names)
        status = w.until_code(Status.HALT_INVALID_FAILED_ROLLERS, w.probe.send_all)
        assert 'no such roller' in status.message
        assert len(status.message) < 1000
        assert not w.command().any()
        publisher.publish(failed(FIRST))
        until_failed(w, FIRST)
        w.until(lambda: w.code() < Status.HALT_NO_TWIST, w.probe.send_all)


def test_a_roller_that_does_not_move_is_detected_and_held_until_reset():
    patient = {'command_timeout': 5.0}
    stuck = ROBOT.roller_names[1]
    with world(
        lambda: Simulator(overrides(stuck_roller=stuck, **patient)),
        node(failure_time=0.3, **patient),
    ) as w:
        send = partial(w.probe.send_twist, (0.0, 0.03, 0.0))
        until_failed(w, stuck, send=send)
        assert_held(w, stuck, send=send)
        answer = w.call('reset_failed_rollers', Trigger.Request())
        assert answer.success
        assert stuck in answer.message
        until_failed(w, send=send)
        # Nothing has been repaired.
        until_failed(w, stuck, send=send)


def named(w):
    w.probe.seen['status'].clear()
    w.until(lambda: bool(w.probe.seen['status']), w.probe.send_all)
    return names_in(w)


def test_detected_rollers_persist_while_detection_is_off():
    with world(node(failure_time=0.3)) as w:
        names = until_detected(w)
        # Rollers that another node commands do not fail, but neither do they recover.
        w.until_code(Status.HALT_OTHER_COMMANDS, lambda: w.probe.send_command([0.0] * N))
        assert set(names_in(w)) >= set(names)
        for time in (0.0, 0.3, 5.0):
            w.change(failure_time=time)
            assert set(named(w)) >= set(names)
        w.change(failure_time=0.0)
        assert w.call('reset_failed_rollers', Trigger.Request()).success
        assert named(w) == ()


def test_observations_while_detection_was_off_do_not_count():
    """Drives that were off for a while, on purpose."""
    with world(node(failure_time=0.0)) as w:
        w.until(lambda: len(w.probe.seen['status']) > 50, w.probe.send_all)
        w.change(failure_time=60.0)
        assert named(w) == ()
        w.change(failure_time=0.1)
        begin = len(w.probe.seen['status'])
        until_detected(w)
        assert len(w.probe.seen['status']) > begin + 5


@pytest.mark.parametrize('is_asked', [True, False], ids=['transitions', 'error'])
def test_detected_rollers_persist_when_configured_again(is_asked):
    with world(node(failure_time=0.3)) as w:
        names, manager = until_detected(w), Manager(w, 'manipulation')
        if is_asked:
            assert all(manager.ask(transition) for transition in DOWN)
        else:
            w.nodes[1].fail(RuntimeError('an error in a callback'))
        assert manager.state() == 'unconfigured'
        # A robot file that does not exist changes nothing.
        w.change(robot='/nowhere.yaml')
        assert not manager.ask(Transition.TRANSITION_CONFIGURE)
        w.change(robot='nine_member')
        assert all(manager.ask(transition) for transition in UP)
        assert set(named(w)) >= set(names)


def test_encoders_that_stand_still_stop_the_rollers():
    """Fresh stamps, constant positions: no timeout detects that, but rollers that do not move."""
    with moving_world(failure_time=0.3) as w:
        until_detected(w)
        commands = w.probe.seen['command']
        w.until(lambda: not np.any([m.data for _, m in commands[-20:]]), w.probe.send_all)
        assert w.code() == Status.UNREACHABLE
