# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reasons in the log, and the rate that a cycle reaches in the diagnostics."""

from types import SimpleNamespace

from diagnostic_msgs.msg import DiagnosticStatus
from isotruss_ros.core import Status
from isotruss_ros.nodes.framework import diagnostics
from isotruss_ros.nodes.framework.diagnostics import MIN_LOG_PERIOD, QUIET_TIME, ReasonLog
from manual_world import world
from probe import manipulation
import pytest


@pytest.fixture
def log(monkeypatch):
    """Return a log by a clock of its own, its `lines` and its `now`."""
    made = SimpleNamespace(now=100.0, lines=[])
    monkeypatch.setattr(diagnostics.time, 'monotonic', lambda: made.now)
    made.log = ReasonLog(made.lines.append)
    return made


def hold(log, kind, text, times, period=0.01):
    """Give a reason again and again; numbers in the text change."""
    for number in range(times):
        log.log.note(kind, text.format(0.01 * number))
        log.now += period


def test_a_reason_that_holds_is_logged_once(log):
    hold(log, 'stale', 'pose: {:.3f} s old', 30_000)
    assert log.lines == ['pose: 0.000 s old']


def test_an_ended_reason_is_logged_with_its_count(log):
    hold(log, 'stale', 'pose: {:.3f} s old', 264)
    log.log.end()
    assert len(log.lines) == 1
    log.now += QUIET_TIME
    log.log.end()
    assert log.lines[1:] == ['no longer, after 264 times: pose: 0.000 s old']


def test_the_end_of_a_slow_loop_is_logged_with_its_lowest_rate(log):
    for rate in (43.7, 21.0, 60.0):
        log.log.note('rate', f'the loop reaches {rate} of 100 Hz', rate)
    log.log.end(0.0)
    assert log.lines == [
        'the loop reaches 43.7 of 100 Hz',
        'no longer, after 3 times: the loop reaches 21.0 of 100 Hz',
    ]


def test_a_reason_that_takes_the_place_of_another_is_logged(log):
    hold(log, 'status', 'no twist', 200)
    hold(log, 'status', 'no pose', 5)
    assert log.lines == ['no twist', 'no longer, after 200 times: no twist', 'no pose']


def test_alternating_reasons_are_logged_at_a_limited_rate(log):
    for _ in range(500):
        hold(log, 'status', 'a', 1)
        hold(log, 'status', 'b', 1)
    assert len(log.lines) <= 2 * (10.0 / MIN_LOG_PERIOD + 1)


def test_a_flood_of_one_kind_does_not_hide_another(log):
    for _ in range(500):
        hold(log, 'one', 'a', 1)
        hold(log, 'other', 'b', 1)
    assert log.lines == ['a', 'b']


def test_a_halt_of_minutes_is_one_line_of_the_log(capfd):
    with world(manipulation(rate=20.0)) as w:
        w.until_code(Status.OK, w.probe.send_all)
        for _ in range(2):
            w.spin(15.0, w.probe.send_twist)
    said = [line for line in capfd.readouterr().err.splitlines() if 'joint states' in line]
    assert len(said) == 1


@pytest.mark.parametrize(('late', 'slow'), [(5.0, True), (1.4, True), (1.1, False)])
def test_a_cycle_that_does_not_reach_its_rate_is_a_warning_with_the_rate(
    late, slow, monkeypatch, capfd
):
    with world(manipulation(failure_time=0.0)) as w:
        node = w.nodes[1]
        # The loop is as late as on a machine that is too slow for it.
        node.cycle._timer.timer_period_ns = int(late * node.cycle._timer.timer_period_ns)
        w.spin(3.5, w.probe.send_all)
        report = w.report('manipulation')
    assert (report.level == DiagnosticStatus.WARN) is slow
    words = f'the loop reaches {100.0 / late:.3g} of 100 Hz'
    assert (words in report.message) is slow
    assert (words in capfd.readouterr().err) is slow
