# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Emergency stop and failed rollers, in the manipulation node."""

from functools import partial

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from isotruss_ros.core import ConvexObject, Grip, reachable_twists, Status
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.simulator.node import Simulator
from lifecycle_msgs.msg import Transition
from manual_world import DOWN, Manager, moving_world, report_matches, UP, world
from nightly import some_now
import numpy as np
import probe
from probe import CENTER, DIAMETER, failed, LATCHED, maker, MODULE, N, overrides, ROBOT
from probe import manipulation as node
import pytest
from rclpy.publisher import Publisher
from std_msgs.msg import Bool
from std_srvs.srv import Trigger


def press(w, pressed=True):
    w.probe.stops.publish(Bool(data=pressed))


def until_stopped(w):
    """Spin until the robot is stopped; return the message of its status."""
    return w.until_code(Status.HALT_EMERGENCY_STOP, w.probe.send_all).message


def assert_stays_stopped(w, cycles=20):
    """Check that many cycles of good inputs move nothing."""
    w.probe.seen['command'].clear()
    w.probe.seen['status'].clear()
    w.until(lambda: len(w.probe.seen['status']) >= cycles, w.probe.send_all)
    assert {s.code for _, s in w.probe.seen['status']} == {Status.HALT_EMERGENCY_STOP}
    assert not any(any(m.data) for _, m in w.probe.seen['command'])


def test_stops_within_a_cycle_and_stays_stopped():
    with moving_world(rate=10.0) as w:
        # Right after a command: it is a long way to the next cycle.
        w.probe.seen['command'].clear()
        w.until(lambda: bool(w.probe.seen['command']), w.probe.send_all)
        assert w.command().any()
        w.probe.seen['command'].clear()
        press(w)
        until_stopped(w)
        since = [np.array(m.data) for _, m in w.probe.seen['command']]
        # One at most that was on its way.
        assert sum(command.any() for command in since) <= 1
        assert w.probe.last('status').scale == 0.0
        assert 'release_emergency_stop' in w.probe.last('status').message
        assert_stays_stopped(w, 5)


def test_is_released_by_the_service_unless_the_last_message_is_true():
    with moving_world(command_timeout=1.0) as w:
        press(w)
        until_stopped(w)
        refused = w.release_stop()
        assert not refused.success
        assert 'is true' in refused.message
        assert_stays_stopped(w)
        press(w, False)
        w.until(lambda: 'message is false' in w.probe.last('status').message, w.probe.send_all)
        assert_stays_stopped(w)
        assert w.release_stop().success
        # What was commanded before the release is no reason to move.
        w.until_code(Status.HALT_NO_TWIST, w.probe.send_measured)
        assert 'none received yet' in w.probe.last('status').message
        w.until_code(Status.OK, w.probe.send_all)
        assert w.command().any()


@pytest.mark.parametrize('releases', [1, 500])
def test_a_press_stops_however_many_releases_follow_in_its_batch(releases):
    with probe.world(node()) as w:
        stops = w.probe.create_publisher(Bool, 'emergency_stop', 1000)
        w.until(lambda: stops.get_subscription_count() > 0)
        w.until_code(Status.OK, w.probe.send_all)
        for pressed in (True, *[False] * releases):
            stops.publish(Bool(data=pressed))
        until_stopped(w)


def test_the_service_stops_and_responds_with_the_reason():
    with moving_world() as w:
        w.probe.seen['command'].clear()
        response = w.call('emergency_stop', Trigger.Request())
        assert response.success
        assert 'stopped by the service /emergency_stop' in response.message
        # No cycle is needed: the last command before the response is zero.
        assert not w.command().any()
        assert_stays_stopped(w)
        assert w.release_stop().message == 'released'
        w.until_code(Status.OK, w.probe.send_all)


@pytest.mark.parametrize('events', [[(1, 0), (0, 1)], [(1, 1)]], ids=['in two', 'in one'])
def test_a_publisher_that_left_before_its_message_counts_as_a_stop(events):
    with moving_world() as w:
        report_matches(w.nodes[1], 'emergency_stop', *events)
        assert 'left before a message was received' in until_stopped(w)


@pytest.mark.parametrize('message_first', [True, False])
def test_a_publisher_that_left_after_its_message_is_no_stop(message_first):
    """The executor may call back with the message before the match."""
    with moving_world() as w:
        press(w, False)
        for is_message in (message_first, not message_first):
            if is_message:
                w.deliver()
            else:
                report_matches(w.nodes[1], 'emergency_stop', (1, 0))
        report_matches(w.nodes[1], 'emergency_stop', (0, 1))
        w.spin(0.1, w.probe.send_all)
        assert w.code() == Status.OK


def test_moves_nothing_before_the_first_message_if_it_is_required():
    with world(node(require_emergency_stop=True)) as w:
        assert 'no message of emergency_stop yet' in until_stopped(w)
        assert_stays_stopped(w)
        press(w, False)
        w.until_code(Status.OK, w.probe.send_all)
    with moving_world() as w:
        w.change(require_emergency_stop=True)
        until_stopped(w)


@pytest.mark.parametrize('state', ['active', 'unconfigured'])
def test_a_stop_persists_from_every_state_of_the_node(state):
    with world(node(autostart=state == 'active')) as w:
        manager = Manager(w, 'manipulation')
        press(w)
        w.until(lambda: 'emergency_stop' in w.detail('emergency stop'), w.probe.send_all)
        press(w, False)
        if state == 'active':
            manager.restart()
        else:
            assert all(map(manager.ask, Manager.UP))
        assert_stays_stopped(w)


def test_the_service_fails_if_a_drive_has_not_received_zero(monkeypatch):
    with moving_world() as w:
        monkeypatch.setattr(Publisher, 'wait_for_all_acked', lambda *_: False)
        response = w.call('emergency_stop', Trigger.Request())
        assert not response.success
        assert 'not every subscriber has acknowledged it; stopped by' in response.message
        assert_stays_stopped(w)


FIRST, SECOND = ROBOT.roller_names[:2]
detecting = maker(Manipulation)


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
    with world(detecting(failed_rollers=[FIRST], failure_time=0.0)) as w:
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
    with probe.world(detecting(failure_time=0.0)) as w:
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
        detecting(failure_time=0.3, **patient),
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
    with world(detecting(failure_time=0.3)) as w:
        names = until_detected(w)
        # Rollers that another detecting commands do not fail, but neither do they recover.
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
    with world(detecting(failure_time=0.0)) as w:
        w.until(lambda: len(w.probe.seen['status']) > 50, w.probe.send_all)
        w.change(failure_time=60.0)
        assert named(w) == ()
        w.change(failure_time=0.1)
        begin = len(w.probe.seen['status'])
        until_detected(w)
        assert len(w.probe.seen['status']) > begin + 5


@pytest.mark.parametrize('is_asked', [True, False], ids=['transitions', 'error'])
def test_detected_rollers_persist_when_configured_again(is_asked):
    with world(detecting(failure_time=0.3)) as w:
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
