# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stamps of messages ahead of the clock, and messages that wait for their transforms."""

from types import SimpleNamespace

from geometry_msgs.msg import TwistStamped
from isotruss_ros.nodes.conversions.messages import make_header
from isotruss_ros.nodes.framework.gate import Gate, Topic
import pytest

NOW = 100.0


class Receiver:
    """Gate of a node without a middleware, whose clock the test sets."""

    def __init__(self, simulated=False):
        self.now, self.passed = NOW, []
        node = SimpleNamespace(
            values=SimpleNamespace(command_timeout=0.2),
            now=lambda: self.now,
            get_parameter=lambda _: SimpleNamespace(value=simulated),
            create_subscription=lambda *_, **__: None,
        )
        topic = Topic(TwistStamped, 'cmd_vel', lambda _: 'twist')
        self.gate = Gate(node, topic, lambda result, _: self.passed.append(result), None, False)

    def receive(self, now, stamp):
        """Return the input that results from a message with a stamp [s]."""
        self.now = now
        self.gate.receive([(TwistStamped(header=make_header(stamp, 'truss')), None)])
        return self.passed.pop() if self.passed else None


@pytest.mark.parametrize(('simulated', 'skew'), [(False, 0.01), (True, 0.1)])
def test_stamp_may_be_ahead_of_real_time_by_10_ms_and_of_simulated_time_by_100_ms(simulated, skew):
    receive = Receiver(simulated).receive
    assert receive(NOW, NOW + 0.9 * skew).time == NOW
    rejected = receive(NOW, NOW + 1.1 * skew)
    assert rejected.reason.startswith('cmd vel: stamped 0.')


def test_repeated_stamp_from_ahead_keeps_the_time_of_its_first_reception():
    receive = Receiver().receive
    assert receive(NOW, NOW + 0.008).time == NOW
    assert receive(NOW + 0.004, NOW + 0.008).time == NOW
    assert receive(NOW + 0.012, NOW + 0.008).time == NOW
    assert receive(NOW + 0.02, NOW + 0.015).time == pytest.approx(NOW + 0.015, abs=1e-6)
