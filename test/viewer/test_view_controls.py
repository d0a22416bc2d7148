# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What counts of what a browser sends, and for how long."""

import contextlib
import math
import time

from fake_browser import FakeBrowser
from isotruss_ros.core import load_robot, Pose
from isotruss_ros.viewer.control import Control
from isotruss_ros.viewer.picture import Picture
import pytest

pytest.importorskip('viser')
from isotruss_ros.viewer.controls import Controls  # noqa: E402,I100
from isotruss_ros.viewer.requests import check_request, list_choices, RequestError  # noqa: E402
from isotruss_ros.viewer.view import View  # noqa: E402

ROBOT = load_robot('nine_member')
CHOICES = list_choices(['P', 'Q'])
#: Far more than anything needs here [s].
DEADLINE = 60.0


class Session:
    """
    A view without a node, and a browser that has control.

    :param timeout: control ends without a sign of life for so long [s].
    """

    def __init__(self, timeout):
        self.view = View(Picture(ROBOT, 0.3), '127.0.0.1', 0)
        self.refused, self.taken = [], []
        self.controls = Controls(
            self.view.server, self.view.picture, 0.5, timeout, self.refused.append
        )
        self.control = self.controls.control
        self.browser = FakeBrowser(self.view.address)
        self.set('control', True)
        self.until(lambda: self.control.browser is not None)

    def set(self, label, value):  # noqa: A003
        """Give a control of the page a value; True presses a button."""
        self.until(lambda: label in self.browser.controls)
        self.browser.set(label, value)

    def until(self, what):
        """Take requests until something holds."""
        end = time.monotonic() + DEADLINE
        while not what():
            assert time.monotonic() < end, (self.control, self.refused, self.taken)
            self.taken += self.controls.take(time.monotonic())
            self.controls.update(Pose(0.0, 0.0, 0.0))
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
    """Return a session whose browser froze in mid-drag, and has lost control for it."""
    with contextlib.closing(Session(2.0)) as s:
        s.browser.drag('handle', 'start', 0.1, 0.0)
        s.until(lambda: s.control.drag is not None)
        s.browser.frozen = True
        s.until(lambda: s.control.browser is None)
        yield s


def test_a_browser_that_freezes_during_a_drag_loses_control_and_target(frozen):
    assert frozen.control == Control()
    (words,) = frozen.refused
    assert words.endswith('sent no heartbeat for 2 s')


def test_a_late_drag_of_a_frozen_browser_is_ignored(frozen):
    frozen.browser.frozen = False
    frozen.browser.drag('handle', 'start', 0.2, 0.0)
    frozen.set('stop', True)
    frozen.until(lambda: frozen.taken)
    assert frozen.control == Control()


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
