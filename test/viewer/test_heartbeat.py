# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Timeouts of pages by their heartbeats, which pause while a page draws or is frozen."""

import time
from types import SimpleNamespace

import pytest

pytest.importorskip('viser')
from isotruss_ros.viewer.heartbeat import Heartbeats, LONGEST_TIMEOUT  # noqa: E402,I100

BROWSER, LEAST, PERIOD = 3, 0.5, 0.1


class Page:
    """Page whose heartbeats, ten a second, arrive together after each picture."""

    def __init__(self, monkeypatch):
        self.now = 100.0
        monkeypatch.setattr(time, 'monotonic', lambda: self.now)
        socket = SimpleNamespace(register_handler=lambda *_: None)
        self.heartbeats = Heartbeats(SimpleNamespace(_websock_server=socket))
        self.heartbeats.note(BROWSER)

    def draw(self, picture_time):
        """Draw a picture, which blocks the page; return whether it was silent meanwhile."""
        self.now += picture_time - 1e-6
        silent = self.is_silent()
        self.now += 1e-6
        for _ in range(max(1, round(picture_time / PERIOD))):
            self.heartbeats.note(BROWSER)
        return silent

    def is_silent(self):
        """Return whether the page has lost control."""
        return self.heartbeats.is_silent(BROWSER, self.heartbeats.timeout(BROWSER, LEAST))


@pytest.fixture
def page(monkeypatch):
    """Return a page on a clock of its own."""
    return Page(monkeypatch)


def test_a_page_that_draws_twice_a_second_is_not_silent_between_pictures(page):
    page.draw(0.6)
    assert not any(page.draw(picture_time) for picture_time in (0.5, 0.6, 0.45, 0.7) * 5)


def test_a_fast_page_that_freezes_is_silent_after_the_least_timeout(page):
    for _ in range(50):
        page.draw(PERIOD)
    page.now += LEAST + 0.01
    assert page.is_silent()


@pytest.mark.parametrize('picture_time', [0.3, 0.5, 1.0, 3.0])
def test_a_frozen_page_is_silent_after_two_seconds_at_most(page, picture_time):
    for _ in range(20):
        page.draw(picture_time)
    page.now += min(2.0 * picture_time, LONGEST_TIMEOUT) + 0.01
    assert page.is_silent()


def test_a_page_that_has_become_fast_has_the_least_timeout_again(page):
    page.draw(1.0)
    for _ in range(60):
        page.draw(PERIOD)
    assert page.heartbeats.timeout(BROWSER, LEAST) == LEAST
