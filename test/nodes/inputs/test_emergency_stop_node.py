# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The emergency stop: reception, execution, persistence and release."""

from isotruss_ros.core import Status
from manual_world import Manager, moving_world, report_matches, world
import numpy as np
import probe
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
