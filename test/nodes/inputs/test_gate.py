# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Times of messages that are stamped ahead of the clock."""

from types import SimpleNamespace

from geometry_msgs.msg import TwistStamped
from isotruss_ros.core.inputs import check_stamp, InputError, RejectedInput
from isotruss_ros.nodes.conversions.messages import make_header, read_stamp
from isotruss_ros.nodes.framework import gate
from isotruss_ros.nodes.framework.common_parameters import COMMAND_TIMEOUT
from isotruss_ros.nodes.framework.robot_frame import NoTransformError
import pytest

NOW = 100.0


@pytest.fixture
def receive(monkeypatch):
    """Return a function from clock, stamp [s] and kind of clock to what a gate passes on."""
    monkeypatch.setattr(gate, 'subscribe_newest', lambda *_: None)
    topic = gate.Topic(TwistStamped, 'cmd_vel', lambda message: 'twist')
    node = SimpleNamespace(values=SimpleNamespace(command_timeout=0.2))
    gates, passed = {}, []
    for simulated in (False, True):
        parameter = SimpleNamespace(value=simulated)
        node.get_parameter = lambda _, parameter=parameter: parameter
        gates[simulated] = gate.Gate(node, topic, lambda r, _: passed.append(r), None, False)

    def receive(now, stamp, simulated=False):
        node.now = lambda: now
        gates[simulated].receive(TwistStamped(header=make_header(stamp, 'truss')))
        return passed.pop()

    return receive


@pytest.mark.parametrize(
    ('ahead', 'simulated'), [(0.009, False), (0.011, False), (0.09, True), (0.11, True)]
)
def test_a_stamp_may_be_ahead_of_real_time_by_10_ms_and_of_simulated_time_by_100_ms(
    receive, ahead, simulated
):
    received = receive(NOW, NOW + ahead, simulated)
    if ahead in (0.009, 0.09):
        assert received.time == NOW
    else:
        assert isinstance(received, RejectedInput)
        assert received.reason.startswith('cmd vel: stamped 0.')


def test_a_repeated_stamp_from_ahead_keeps_the_time_of_its_first_reception(receive):
    assert receive(NOW, NOW + 0.008).time == NOW
    assert receive(NOW + 0.004, NOW + 0.008).time == NOW
    assert receive(NOW + 0.012, NOW + 0.008).time == NOW
    assert receive(NOW + 0.02, NOW + 0.015).time == pytest.approx(NOW + 0.015, abs=1e-6)


def test_another_stamp_from_ahead_counts_from_its_own_reception(receive):
    assert receive(NOW, NOW + 0.008).time == NOW
    assert receive(NOW + 0.004, NOW + 0.006).time == NOW + 0.004


def test_inputs_of_more_than_ten_seconds_are_always_too_old():
    timeout = COMMAND_TIMEOUT.bounds[1]
    assert check_stamp('twist', 0.0, 10.0, timeout) == 0.0
    with pytest.raises(InputError):
        check_stamp('twist', 0.0, 10.1, timeout)


def test_at_most_100_messages_wait_for_their_transform(monkeypatch):
    def read(_message):
        raise NoTransformError('no transform')

    monkeypatch.setattr(gate, 'subscribe_newest', lambda *_: None)
    node = SimpleNamespace(
        values=SimpleNamespace(command_timeout=0.2),
        now=lambda: NOW,
        get_parameter=lambda _: SimpleNamespace(value=False),
    )
    topic = gate.Topic(TwistStamped, 'cmd_vel', read)
    queue = gate.Gate(node, topic, lambda *_: None, None, False)
    for number in range(102):
        stamp = NOW - 1e-3 * (102 - number)
        queue.receive(TwistStamped(header=make_header(stamp, 'truss')))
    assert len(queue.waiting) == 100
    assert read_stamp(queue.waiting[0][0].header) == pytest.approx(NOW - 0.1)
