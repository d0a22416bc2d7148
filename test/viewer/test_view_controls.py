# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Requests of browsers: which of them have an effect, and for how long."""

import asyncio
import cmath
import contextlib
import math
import sys
import threading
import time

from isotruss_ros.viewer.control import Control
from isotruss_ros.viewer.drag import LEVER_LENGTH
import pytest

pytest.importorskip('viser')
from fake_browser import CAMERA, CLICK, FakeBrowser, HEARTBEAT, Session  # noqa: E402,I100
from isotruss_ros.viewer.heartbeat import Heartbeats, LONGEST_TIMEOUT  # noqa: E402
from isotruss_ros.viewer.requests import check_request, list_choices, RequestError  # noqa: E402
import viser  # noqa: E402

CHOICES = list_choices(['P', 'Q'])
#: Number of cycles under a flood of messages, of which unlocked reading fails in some percent [-].
CYCLES = 300
#: Interval between switches of threads [s].
SWITCH_INTERVAL = sys.getswitchinterval()
STOP_OFF = {'type': 'GuiUpdateMessage', 'updates': {'removed': True}}


@pytest.fixture
def session():
    """Return a session whose browser may be as slow as the machine makes it."""
    with contextlib.closing(Session()) as opened:
        yield opened


def test_target_of_a_drag_is_the_pointer_less_the_offset_at_which_the_handle_was_grabbed(session):
    def drag(phase, x, y, grabbed, target):
        session.browser.drag('handle', phase, x, y, grabbed)
        there = pytest.approx(target)
        session.until(lambda: session.control.drag and session.control.drag.target == there)

    drag('start', 0.62, 0.33, (0.52, 0.23), (0.6, 0.3))
    drag('update', 0.72, 0.13, (0.52, 0.23), (0.7, 0.1))
    drag('start', 0.7, 0.2, (0.72, 0.23), (0.68, 0.07))


def test_the_object_is_turned_by_the_angle_of_the_pointer_around_it(session):
    center = complex(*Session.POSE[:2])

    def turn(phase, angle, target):
        start, pointer = (center + cmath.rect(0.3, value) for value in (0.25, angle))
        place = (start.real, start.imag)
        session.browser.drag('turner', phase, pointer.real, pointer.imag, place)
        there = pytest.approx((LEVER_LENGTH * target, 0.0))
        session.until(lambda: session.control.drag and session.control.drag.target == there)

    # Grabbed 0.05 rad beside the middle of the handle, which is at the angle of the object.
    turn('start', 0.25, 0.3)
    for angle in (2.25, 4.25, 7.25, 5.25):
        turn('update', angle, angle + 0.05)
    assert session.control.drag.turns


@pytest.mark.parametrize(
    ('label', 'value', 'ends'),
    [
        ('drag', 'P', True),
        ('pick', True, True),
        ('place', True, True),
        ('object', 'box', True),
        ('plant', 'mujoco', True),
        ('reset', True, True),
        ('resume', True, False),
        ('friction', 0.7, False),
    ],
)
def test_a_request_that_replaces_a_motion_ends_the_drag(session, label, value, ends):
    session.grab()
    session.set(label, value)
    session.until(lambda: session.taken)
    assert (session.control.drag is None) == ends
    name = {'drag': 'dragged', 'object': 'shape'}.get(label, label)
    assert session.taken == [(name, 0.0 if value is True else value)]


def test_a_browser_that_freezes_during_a_drag_loses_control_and_target():
    with contextlib.closing(Session(2.0)) as session:
        session.grab()
        session.browser.frozen = True
        session.until(lambda: session.control.browser is None)
        (reason,) = [line.removeprefix('control ended: ') for line in session.log]
        assert session.control == Control(ended=reason)
        assert reason.endswith('for 2 s; switch control on again')
        session.browser.frozen = False
        session.browser.drag('handle', 'start', 0.2, 0.0)
        session.press_stop()
        assert session.control == Control(ended=reason)
        session.until(lambda: session.browser.shows(reason))
        session.set('control', True)
        session.until(lambda: session.control.browser is not None)
        session.until(lambda: not session.browser.shows(reason))


def test_a_browser_that_leaves_in_mid_drag_loses_control_and_target(session):
    session.grab()
    session.browser.close()
    session.until(lambda: session.control == Control())


def test_a_browser_without_control_commands_nothing(session):
    with contextlib.closing(FakeBrowser(session.view.address)) as other:
        session.until(lambda: 'control' in other.controls)
        other.drag('handle', 'start', 0.1, 0.0)
    session.until(lambda: len(session.view.server.get_clients()) == 1)
    session.step()
    assert session.control.drag is None


def test_a_flood_of_messages_from_other_threads_ends_nothing(session):
    done = threading.Event()

    def flood():
        while not done.is_set():
            session.browser.send(HEARTBEAT | {'value': '1.0'})

    threads = [threading.Thread(target=flood) for _ in range(2)]
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
    session.grab()


def test_pictures_wake_the_loop_of_the_server_in_its_own_thread(session):
    loop = session.view.server.get_event_loop()
    event = session.view.server._websock_server.get_message_buffer().message_event

    async def wait(parked):
        event.clear()
        loop.call_soon(parked.set)
        return await event.wait()

    # In this mode, a loop raises RuntimeError if another thread wakes one of its tasks.
    loop.set_debug(True)
    for _ in range(3):
        parked = threading.Event()
        woken = asyncio.run_coroutine_threadsafe(wait(parked), loop)
        assert parked.wait(60.0)
        session.step()
        assert woken.result(60.0)


@pytest.mark.parametrize('handle', ['handle', 'turner', 'obstacle_handles/placed 1'])
def test_the_report_of_a_drag_goes_with_the_next_drag(session, handle):
    session.set('add obstacle', True)
    session.until(lambda: session.browser.is_clickable)
    session.browser.click(1.0, 2.0)
    session.until(lambda: '/obstacle_handles/placed 1' in session.browser.scene)
    session.refused.append('drag aborted: no progress')
    session.browser.drag(handle, 'start', 0.1, 0.0)
    session.until(lambda: session.refused[-1] == '')
    session.browser.drag(handle, 'update', 0.2, 0.0)
    session.press_stop()
    assert session.refused == ['drag aborted: no progress', '']


def test_a_stop_ends_control_until_the_switch_is_switched_on_again(session):
    session.grab()
    session.press_stop()
    session.step()
    assert session.control == Control()
    session.set('control', True)
    session.until(lambda: session.control.browser is not None)
    assert session.stops == 1


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


@pytest.mark.parametrize(
    'message',
    [
        STOP_OFF,
        STOP_OFF | {'updates': {'value': True, 'update_cb': []}},
        STOP_OFF | {'updates': 'value'},
        CAMERA | {'position': [0.0] * 5},
        CAMERA | {'look_at': [math.nan, 0.0, 0.0]},
        CAMERA | {'image_height': 'high'},
        CLICK | {'ray_direction': None},
        CLICK | {'ray_origin': [0.0, math.inf, 0.0]},
        CLICK | {'event_type': 'rect-select'},
        CLICK | {'screen_pos': []},
        {'type': 'ShareUrlRequest'},
        {'type': 'Other'},
        {'type': 'ViewerCameraMessage'},
        {},
        [],
        b'',
        b'\xc1',
        'text',
    ],
    ids=str,
)
def test_a_message_that_no_page_sends_is_reported_and_ignored(session, capfd, message):
    session.until(lambda: 'stop' in session.browser.controls)
    if isinstance(message, (bytes, str)):
        session.browser.send_packed(message)
    elif 'updates' in message:
        session.browser.send(message | {'uuid': session.browser.controls['stop']})
    else:
        session.browser.send(message)
    session.press_stop()
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith('viewer: message of a page ignored: ')


@pytest.mark.parametrize(('width', 'height'), [(0, 0), (0, 100), (100, 0)])
def test_a_page_without_an_area_is_served(session, width, height):
    session.browser.send(CAMERA | {'image_width': width, 'image_height': height})
    session.set('moment [N m]', 1.5)
    session.until(lambda: session.control.wrench == (0.0, 0.0, 1.5))


@pytest.mark.parametrize(
    ('name', 'value'),
    [
        ('friction', '0.5'),
        ('squeeze', None),
        ('diameter', 0.0),
        ('plant', 'other'),
        ('plant', ['mujoco']),
        ('dragged', 'nowhere'),
        ('target', (True, (0.0,), (0.0, 0.0))),
        ('target', (True, (0.0, 0.0), (0.0, math.inf))),
        ('target', (True, (0.0, 0.0), (1e9, 0.0))),
        ('turn', (True, 'ab', (0.0, 0.0))),
        ('placed', ((math.nan, 0.0),)),
        ('moved', ('placed 1', True, (0.0, 0.0), (1e9, 0.0))),
        ('shutdown', 0.0),
    ],
)
def test_a_request_that_no_control_makes_is_refused(name, value):
    with pytest.raises(RequestError, match=f'{name}: .* from a browser: must be '):
        check_request(name, value, CHOICES)


BROWSER, LEAST, PERIOD = 3, 0.5, 0.05
#: Times of pictures [s].
DURATIONS = (PERIOD, 0.3, 0.5, 1.0, 3.0)


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


@pytest.mark.parametrize(('first', 'duration'), [(1.0, PERIOD), *((d, d) for d in DURATIONS)])
def test_a_frozen_page_loses_control_after_two_seconds_at_most(page, first, duration):
    """A fast page loses it earlier, also one that has become fast."""
    page.draw(first)
    for _ in range(60):
        page.draw(duration)
    fast = duration == PERIOD
    assert page.wait((LEAST if fast else LONGEST_TIMEOUT) + 2.0 * PERIOD)


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
