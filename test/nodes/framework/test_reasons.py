# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reasons in the log, and the rate that a cycle reaches in the diagnostics."""

import re
from types import SimpleNamespace

from diagnostic_msgs.msg import DiagnosticStatus
from isotruss_ros.nodes.framework import diagnostics
from isotruss_ros.nodes.framework.diagnostics import MIN_LOG_PERIOD, QUIET_TIME, ReasonLog
from manual_world import world
from probe import manipulation
import pytest


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
    with world(manipulation(failure_time=0.0)) as w:
        w.busy = lambda: 0.01 * late
        w.spin(2.5, w.probe.send_all)
        report = w.report('manipulation')
    assert (report.level == DiagnosticStatus.WARN) is slow
    for words in (report.message, capfd.readouterr().err):
        rates = re.findall(r'the loop reaches ([\d.]+) of 100 Hz', words)
        assert bool(rates) is slow
        assert list(map(float, rates)) == pytest.approx([100.0 / late] * len(rates), rel=0.1)
