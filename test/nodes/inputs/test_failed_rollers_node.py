# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rollers that fail, and the edge of the good shapes, as the manipulation node deals with them."""

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from isotruss_ros.core import ConvexObject, Grip, reachable_twists, Status
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.simulator.node import Simulator
from lifecycle_msgs.msg import Transition
from manual_world import DOWN, Manager, UP, world
import numpy as np
from probe import CENTER, DIAMETER, failed, LATCHED, maker, MODULE, overrides, ROBOT
import pytest
from std_srvs.srv import Trigger

FIRST, SECOND = ROBOT.roller_names[:2]


node = maker(Manipulation)


def until_failed(w, *names, send=None):
    """Spin until the status names exactly these rollers."""
    w.until(
        lambda: (
            w.probe.last('status') is not None
            and list(w.probe.last('status').failed_rollers) == list(names)
        ),
        send or w.probe.send_all,
    )
    return w.probe.last('status')


def say(w, *names):
    """Publish the failed rollers; return the publisher."""
    publisher = w.probe.create_publisher(DiagnosticArray, 'failed_rollers', LATCHED)
    publisher.publish(failed(*names))
    return publisher


def assert_held(w, *names):
    """Check that some cycles of commands hold these rollers at zero, and move others."""
    w.probe.seen['command'].clear()
    w.until(lambda: len(w.probe.seen['command']) > 10, w.probe.send_all)
    commands = np.array([m.data for _, m in w.probe.seen['command']])
    places = [ROBOT.roller_names.index(name) for name in names]
    assert not commands[:, places].any()
    assert commands.any()


def test_a_roller_that_failed_by_parameter_is_held_and_the_rest_goes_on():
    expected = reachable_twists(
        ROBOT.home, Grip.at_module(ROBOT, MODULE, ConvexObject.disc(CENTER, DIAMETER)), {FIRST}
    )
    with world(node(failed_rollers=[FIRST])) as w:
        status = until_failed(w, FIRST)
        w.until(lambda: w.code() < Status.HALT_NO_TWIST, w.probe.send_all)
        assert w.probe.last('status').reachable_dof == len(expected)
        assert_held(w, FIRST)
        assert status.code < Status.HALT_NO_TWIST or not status.reachable_dof
        w.change(failed_rollers=[FIRST, SECOND])
        until_failed(w, FIRST, SECOND)
        assert_held(w, FIRST, SECOND)
        w.change(failed_rollers=[''])
        until_failed(w)
        w.until_code(Status.OK, w.probe.send_all)


def test_the_topic_names_failed_rollers_to_late_joiners_too():
    with world() as w:
        publisher = say(w, SECOND, FIRST)
        w.add(Manipulation())
        until_failed(w, FIRST, SECOND)
        assert_held(w, FIRST, SECOND)
        publisher.publish(failed(SECOND))
        until_failed(w, SECOND)
        publisher.publish(failed())
        until_failed(w)
        w.until_code(Status.OK, w.probe.send_all)


@pytest.mark.parametrize(
    'names', [[FIRST, 'nobody'], ['x' * 10**5], [*map(str, range(10**4)), 'ü']]
)
def test_halts_on_unknown_names_of_failed_rollers(names):
    with world(node()) as w:
        w.until_code(Status.OK, w.probe.send_all)
        publisher = say(w, *names)
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
        twist = (0.0, 0.03, 0.0)

        def send():
            w.probe.send_twist(twist)

        until_failed(w, stuck, send=send)
        w.probe.seen['command'].clear()
        w.until(lambda: len(w.probe.seen['command']) > 20, send)
        late = np.array([m.data for _, m in w.probe.seen['command']])
        assert not late[:, 1].any()
        assert late.any()
        answer = w.call('reset_failed_rollers', Trigger.Request())
        assert answer.success
        assert stuck in answer.message
        until_failed(w, send=send)
        # Nothing has been repaired.
        until_failed(w, stuck, send=send)


def until_found(w):
    """Repeat encoder readings until rollers are detected as failed; return their names."""

    def failed():
        status = w.probe.last('status')
        return set() if status is None else set(status.failed_rollers)

    w.until(lambda: bool(failed()), w.probe.send_all)
    return failed()


def named(w):
    """Return which rollers the next status names."""
    w.probe.seen['status'].clear()
    w.until(lambda: bool(w.probe.seen['status']), w.probe.send_all)
    return set(w.probe.last('status').failed_rollers)


def reset(w):
    """Call the service; return its answer."""
    return w.call('reset_failed_rollers', Trigger.Request())


def test_detected_rollers_persist_while_detection_is_off():
    with world(node(failure_time=0.3)) as w:
        names = until_found(w)
        for time in (0.0, 0.3, 5.0):
            w.change(failure_time=time)
            assert named(w) >= names
        w.change(failure_time=0.0)
        assert reset(w).success
        assert named(w) == set()


def test_observations_while_detection_was_off_do_not_count():
    """Drives that were off for a while, on purpose."""
    with world(node(failure_time=0.0)) as w:
        w.until(lambda: len(w.probe.seen['status']) > 150, w.probe.send_all)
        w.change(failure_time=60.0)
        assert named(w) == set()
        w.change(failure_time=0.1)
        begin = len(w.probe.seen['status'])
        until_found(w)
        assert len(w.probe.seen['status']) > begin + 5


@pytest.mark.parametrize('how', ['asked', 'mistaken'])
def test_detected_rollers_persist_when_configured_again(how):
    with world(node(failure_time=0.3)) as w:
        names, manager = until_found(w), Manager(w, 'manipulation')
        if how == 'asked':
            assert all(manager.ask(transition) for transition in DOWN)
        else:
            w.nodes[1].fail(RuntimeError('a mistake of ours'))
        assert manager.state() == 'unconfigured'
        # A robot that there is not changes nothing.
        w.change(robot='/nowhere.yaml')
        assert not manager.ask(Transition.TRANSITION_CONFIGURE)
        w.change(robot='nine_member')
        assert all(manager.ask(transition) for transition in UP)
        assert named(w) >= names


def test_encoders_that_stand_still_stop_the_rollers():
    """Fresh stamps, old places: no time-out finds that, but rollers that do not move."""
    with world(node(failure_time=0.3)) as w:
        w.until_code(Status.OK, w.probe.send_all)

        def given_up():
            latest = [m.data for _, m in w.probe.seen['command'][-20:]]
            return bool(w.probe.last('status').failed_rollers) and not np.any(latest)

        w.until(given_up, w.probe.send_all)
        assert w.code() == Status.UNREACHABLE


def test_diagnostics_list_failed_rollers_and_reachable_twists():
    with world(node(failed_rollers=[FIRST])) as w:
        w.until(lambda: w.detail('failed rollers') == FIRST, w.probe.send_all)
        w.until(lambda: 'of 3' in w.detail('reachable twists'), w.probe.send_all)
        assert w.report('manipulation').level == DiagnosticStatus.WARN
        assert FIRST in w.report('manipulation').message
