# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Requests of browsers: which of them have an effect, and for how long."""

import asyncio
import contextlib
import math
import sys
import threading
import time

from fake_browser import CAMERA, FakeBrowser
from isotruss_ros.core import load_robot, Pose
from isotruss_ros.viewer.control import Control
from isotruss_ros.viewer.picture import Picture
import pytest

pytest.importorskip('viser')
from isotruss_ros.viewer.controls import Controls  # noqa: E402,I100
from isotruss_ros.viewer.requests import check_request, list_choices, RequestError  # noqa: E402
from isotruss_ros.viewer.view import View  # noqa: E402
from viser._messages import LocalStorageGetItemResponseMessage  # noqa: E402

ROBOT = load_robot('nine_member')
CHOICES = list_choices(['P', 'Q'])
#: Longest wait of a test [s].
DEADLINE = 60.0
#: Number of cycles under a flood of messages, of which unlocked reading fails in some percent [-].
CYCLES = 300
#: Interval between switches of threads [s].
SWITCH_INTERVAL = sys.getswitchinterval()


class Session:
    """
    View without a node, and a browser in control.

    :param timeout: time without a drawn picture after which control ends [s].
    """

    def __init__(self, timeout):
        self.view = View(Picture(ROBOT, 0.3), '127.0.0.1', 0)
        self.refused, self.taken, self.stops = [], [], 0
        self.controls = Controls(
            self.view.server, self.view.picture, 0.5, timeout, self.refused.append
        )
        self.control = self.controls.control
        self.browser = FakeBrowser(self.view.address)
        self.set('control', True)
        self.until(lambda: self.control.browser is not None)

    def set(self, label, value):  # noqa: A003
        """Set a control of the page; True presses a button."""
        self.until(lambda: label in self.browser.controls)
        self.browser.set(label, value)

    def step(self):
        """Take requests and send a picture, as the node does."""
        now = time.monotonic()
        self.stops += self.controls.hear(now)
        self.taken += self.controls.take(now, now)
        self.controls.update(Pose(0.0, 0.0, 0.0))
        self.view.update(now)
        self.controls.mark(now)

    def until(self, what):
        """Step until a condition is true."""
        end = time.monotonic() + DEADLINE
        while not what():
            assert time.monotonic() < end, (self.control, self.refused, self.taken)
            self.step()
            time.sleep(0.01)

    def close(self):
        """End browser and server."""
        self.browser.close()
        self.view.close()


@pytest.fixture
def session():
    """Return a session whose browser may be as slow as the machine makes it."""
    with contextlib.closing(Session(DEADLINE)) as opened:
        yield opened


@pytest.fixture
def frozen():
    """Return a session whose browser froze in a drag, and has lost control."""
    with contextlib.closing(Session(2.0)) as s:
        s.browser.drag('handle', 'start', 0.1, 0.0)
        s.until(lambda: s.control.drag is not None)
        s.browser.frozen = True
        s.until(lambda: s.control.browser is None)
        yield s


def test_a_browser_that_freezes_during_a_drag_loses_control_and_target(frozen):
    assert frozen.control == Control()
    (words,) = frozen.refused
    assert words.endswith('has drawn no new picture for 2 s')


def test_a_late_drag_of_a_frozen_browser_is_ignored(frozen):
    frozen.browser.frozen = False
    frozen.browser.drag('handle', 'start', 0.2, 0.0)
    frozen.set('stop', True)
    frozen.until(lambda: frozen.stops)
    assert frozen.control == Control()


def flood(session, done):
    """Receive heartbeats in this thread, as viser receives them in its own, until the end."""
    loop, server = asyncio.new_event_loop(), session.view.server._websock_server
    browser, received = session.control.browser, server._handle_incoming_message
    beat = LocalStorageGetItemResponseMessage(value='1.0', error=None, request_uuid='')
    while not done.is_set():
        loop.run_until_complete(received(browser, beat))
    loop.close()


def test_a_flood_of_messages_from_other_threads_ends_nothing(session):
    done = threading.Event()
    threads = [threading.Thread(target=flood, args=(session, done)) for _ in range(2)]
    for thread in threads:
        thread.start()
    sys.setswitchinterval(1e-5)
    try:
        for _ in range(CYCLES):
            now = time.monotonic()
            session.controls.hear(now)
            session.controls.take(now, now)
    finally:
        sys.setswitchinterval(SWITCH_INTERVAL)
        done.set()
        for thread in threads:
            thread.join()
    session.browser.drag('handle', 'start', 0.1, 0.0)
    session.until(lambda: session.control.drag is not None)


def test_a_stop_ends_control_until_the_switch_is_switched_on_again(session):
    session.browser.drag('handle', 'start', 0.1, 0.0)
    session.until(lambda: session.control.drag is not None)
    session.set('stop', True)
    session.until(lambda: session.stops)
    session.step()
    assert session.control == Control()
    session.set('control', True)
    session.until(lambda: session.control.browser is not None)
    assert session.stops == 1


def test_an_error_ends_control_and_is_shown_until_the_next_picture(session):
    session.controls.give_up('division by zero')
    assert session.control == Control()
    while not session.browser.shows('division by zero'):
        time.sleep(0.01)
    session.until(lambda: not session.browser.shows('division by zero'))


def test_a_drag_during_a_latched_stop_is_ignored(session):
    session.browser.drag('handle', 'start', 0.1, 0.0)
    session.until(lambda: session.control.drag is not None)
    session.control.latch(True)
    assert session.control.drag is None
    session.browser.drag('handle', 'start', 0.2, 0.0)
    session.set('pick', True)
    session.until(lambda: ('pick', 0.0) in session.taken)
    assert session.control.drag is None


@pytest.mark.parametrize('value', [1e9, -20.5, math.nan, math.inf])
def test_a_force_beyond_the_range_of_its_slider_is_ignored(session, value):
    session.set('force x [N]', value)
    session.until(lambda: session.refused)
    assert session.control.wrench == (0.0, 0.0, 0.0)
    assert session.refused[0].startswith(f"fx: '{value}' from a browser: must be from -20 to 20")


@pytest.mark.parametrize('value', ['much\n', None, [1.0, 2.0], {}])
def test_a_malformed_value_of_a_control_is_reported_in_one_line(session, capfd, value):
    session.set('force x [N]', value)
    session.set('force x [N]', 3.0)
    session.until(lambda: session.control.wrench[0] == 3.0)
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith('viewer: message of a page ignored: ')


STOP_OFF = {'type': 'GuiUpdateMessage', 'updates': {'removed': True}}


@pytest.mark.parametrize(
    'message',
    [
        STOP_OFF,
        STOP_OFF | {'updates': {'value': True, 'update_cb': []}},
        STOP_OFF | {'updates': 'value'},
        CAMERA | {'position': [0.0] * 5},
        CAMERA | {'look_at': [math.nan, 0.0, 0.0]},
        CAMERA | {'image_height': 'high'},
        {'type': 'ShareUrlRequest'},
        {'type': 'Other'},
        {'type': 'ViewerCameraMessage'},
        {},
        [],
    ],
    ids=str,
)
def test_a_message_that_no_page_sends_is_reported_and_ignored(session, capfd, message):
    session.until(lambda: 'stop' in session.browser.controls)
    if message and 'updates' in message:
        message = message | {'uuid': session.browser.controls['stop']}
    session.browser.send(message)
    session.set('stop', True)
    session.until(lambda: session.stops)
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith('viewer: message of a page ignored: ')


@pytest.mark.parametrize('packed', [b'', b'\xc1', b'\xff' * 20, 'text'])
def test_bytes_that_are_no_message_are_reported_and_ignored(session, capfd, packed):
    session.browser.send_packed(packed)
    session.set('stop', True)
    session.until(lambda: session.stops)
    assert capfd.readouterr().err.count('viewer: message of a page ignored: ') == 1


@pytest.mark.parametrize('size', [(0, 0), (0, 100), (100, 0)])
def test_a_page_without_an_area_is_served(session, size):
    session.browser.send(CAMERA | dict(zip(('image_width', 'image_height'), size, strict=True)))
    session.set('force x [N]', 3.0)
    session.until(lambda: session.control.wrench[0] == 3.0)


def test_a_drag_of_an_unknown_joint_is_ignored(session):
    session.set('drag', 'nowhere')
    session.until(lambda: session.refused)
    assert session.controls.dragged == 'object'
    assert not session.taken


@pytest.mark.parametrize('place', [(math.nan, 0.0), (0.0, math.inf), (1e9, 0.0)])
def test_a_drag_to_a_position_that_is_not_finite_is_ignored(session, place):
    session.browser.drag('handle', 'start', *place)
    session.until(lambda: session.refused)
    assert session.control.drag is None


@pytest.mark.parametrize(
    ('name', 'value'),
    [
        ('friction', '0.5'),
        ('squeeze', None),
        ('diameter', 0.0),
        ('plant', 'other'),
        ('plant', ['mujoco']),
        ('target', (True, (0.0,), (0.0, 0.0))),
        ('turn', (True, 'ab', (0.0, 0.0))),
        ('shutdown', 0.0),
    ],
)
def test_a_request_that_no_control_makes_is_refused(name, value):
    with pytest.raises(RequestError, match=f'{name}: .* from a browser: must be '):
        check_request(name, value, CHOICES)
