# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stamps ahead of the clock, messages that replace others, and joint states in parts."""

from types import SimpleNamespace

from geometry_msgs.msg import TwistStamped
from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core import inputs
from isotruss_ros.nodes.conversions.messages import make_header
from isotruss_ros.nodes.framework.gate import Gate, Topic
from isotruss_ros.nodes.framework.received_inputs import keep_latest, RollerParts
import numpy as np
import pytest
import robots

NOW, TIMEOUT = 100.0, 0.2
NEW, LATE = inputs.StampedInput('new', NOW), inputs.StampedInput('late', NOW - 0.1)
BAD = inputs.RejectedInput('bad')
NAMES = ('a', 'b', 'c')
moments = st.floats(0.0, 1.0)


def test_an_earlier_input_does_not_replace_a_later_one():
    assert keep_latest(NEW, LATE, NOW) is NEW
    assert keep_latest(LATE, NEW, NOW) is NEW


@pytest.mark.parametrize(
    ('kept', 'new', 'now'),
    [(None, LATE, NOW), (BAD, LATE, NOW), (None, BAD, NOW), (NEW, LATE, NOW - 0.1)],
    ids=['none', 'rejected', 'none by a rejection', 'before the clock was set back'],
)
def test_an_input_replaces_one_that_is_none_rejected_or_from_the_future(kept, new, now):
    assert keep_latest(kept, new, now) is new


def test_a_rejection_is_the_reason_after_the_timeout_of_the_valid_input():
    kept = keep_latest(NEW, BAD, NOW)
    with pytest.raises(inputs.InputError, match='bad') as caught:
        inputs.require_fresh(NOW + 1.01 * TIMEOUT, TIMEOUT, object_pose=kept)
    assert (caught.value.name, caught.value.fault) == ('object_pose', inputs.InputFault.INVALID)


def part(rollers, time, speed):
    """Return readings of rollers that turn evenly, each by its own speed."""
    return {number: (speed[number] * time, speed[number]) for number in rollers}


@robots.examples(100)
@given(
    st.lists(st.tuples(st.sets(st.integers(0, 2), min_size=1), moments), max_size=20),
    st.tuples(*3 * [st.floats(-0.1, 0.1)]),
)
def test_parts_in_any_order_make_the_state_of_one_time(messages, speed):
    parts, last = RollerParts(NAMES), dict.fromkeys(range(3), 0.0)
    for rollers, time in [({0, 1, 2}, 0.0), *messages]:
        parts.take(part(rollers, time, speed), time, 2.0)
        last |= {number: max(last[number], time) for number in rollers}
        result = parts.merged()
        assert result.time == min(last.values())
        assert result.value.positions == pytest.approx(np.multiply(speed, result.time), abs=1e-9)
        assert result.value.offsets == 0.0


def test_rollers_that_were_never_read_are_named():
    parts = RollerParts(NAMES)
    parts.take(part((1,), 1.0, (0.1, 0.1, 0.1)), 1.0, 2.0)
    assert 'rollers a, c are missing' in parts.merged().reason


def test_a_reading_at_the_current_time_keeps_the_earlier_ones_of_its_roller():
    parts = RollerParts(NAMES)
    for rollers, time in (((0, 1, 2), 1.0), ((1,), 1.5), ((0, 2), 2.0), ((0, 2), 2.0)):
        parts.take(part(rollers, time, (0.1, 0.1, 0.1)), time, time)
    merged = parts.merged()
    assert merged.time == 1.5
    assert merged.value.positions == pytest.approx(np.full(3, 0.15))


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
        # An older message of the same burst is not used.
        stamps = stamp - 0.01, stamp
        headers = [make_header(time, 'truss') for time in stamps]
        self.gate.receive([(TwistStamped(header=header), None) for header in headers])
        (received,) = self.passed
        self.passed.clear()
        return received


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
