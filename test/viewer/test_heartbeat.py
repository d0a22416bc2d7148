# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Delays of the pictures that pages draw, and the timeouts of control."""

import math

import pytest

pytest.importorskip('viser')
from isotruss_ros.viewer.heartbeat import Heartbeats, LONGEST_TIMEOUT  # noqa: E402,I100
import viser  # noqa: E402

BROWSER, LEAST, PERIOD = 3, 0.5, 0.05


@pytest.fixture(scope='module')
def server():
    server = viser.ViserServer(port=0, verbose=False)
    yield server
    server.stop()


class Page:
    """Page that draws pictures, which are sent 20 times a second, by the last that had arrived."""

    def __init__(self, server):
        self.now = 100.0
        self.heartbeats = Heartbeats(server, lambda *_: None)
        self.heartbeats.begin(BROWSER, self.now)

    def draw(self, duration):
        """Draw a picture, and return whether the page lost control meanwhile."""
        self.wait(0.0)
        drawn, lost = self.now, self.wait(duration)
        self.heartbeats.note(BROWSER, str(drawn), self.now)
        return lost

    def wait(self, duration):
        """Draw nothing; return whether the page lost control."""
        lost = False
        for _ in range(max(1, round(duration / PERIOD))):
            self.now += PERIOD
            self.heartbeats.mark(self.now)
            lost = lost or self.is_lost
        return lost

    @property
    def is_lost(self):
        delay = self.heartbeats.delay(BROWSER, self.now)
        return delay > self.heartbeats.timeout(BROWSER, LEAST)


@pytest.fixture
def page(server):
    return Page(server)


def test_a_page_with_two_pictures_a_second_keeps_control(page):
    page.draw(0.4)
    page.draw(0.4)
    assert not any(page.draw(duration) for duration in (0.5, 0.6, 0.45, 0.7) * 5)


@pytest.mark.parametrize('duration', [PERIOD, 0.3, 0.5, 1.0, 3.0])
def test_a_frozen_page_loses_control_after_two_seconds_at_most(page, duration):
    for _ in range(20):
        page.draw(duration)
    fast = duration == PERIOD
    assert page.wait((LEAST if fast else LONGEST_TIMEOUT) + 2.0 * PERIOD)


def test_a_page_that_has_become_fast_loses_control_as_early_as_a_fast_one(page):
    page.draw(1.0)
    for _ in range(60):
        page.draw(PERIOD)
    assert page.wait(LEAST + 2.0 * PERIOD)


def test_a_pause_of_the_sender_is_no_delay_of_a_page(page):
    page.draw(PERIOD)
    page.heartbeats.note(BROWSER, str(page.now), page.now)
    page.now += 30.0
    assert not page.is_lost


@pytest.mark.parametrize('value', [None, '', 'nan', '-1.0', 1, math.inf, '1e400', '٣.٣'])
def test_a_heartbeat_without_a_picture_does_not_count(page, value):
    page.wait(LEAST + 2.0 * PERIOD)
    page.heartbeats.note(BROWSER, value, page.now)
    assert page.is_lost


def test_a_picture_from_the_future_counts_as_the_present_one(page):
    page.wait(1.0)
    page.heartbeats.note(BROWSER, '1000.0', page.now)
    assert not page.is_lost
    assert page.wait(LONGEST_TIMEOUT + 2.0 * PERIOD)
