# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A view with controls, without a node, and a browser in control of it."""

import time

from fake_browser import FakeBrowser
from isotruss_ros.core import load_robot, Pose
from isotruss_ros.viewer.controls import Controls
from isotruss_ros.viewer.picture import Picture
from isotruss_ros.viewer.view import View

ROBOT = load_robot('nine_member')
#: Longest wait of a test [s].
DEADLINE = 60.0
OBJECT_POSE = Pose(0.5, 0.2, 0.3)


class Session:
    """View without a node, and a browser that has control until a timeout without pictures [s]."""

    def __init__(self, timeout):
        self.view = View(Picture(ROBOT, 0.3), '127.0.0.1', 0)
        self.refused, self.log, self.taken, self.stops = [], [], [], 0
        self.controls = Controls(
            self.view.server, self.view.picture, 0.5, timeout, self.refused.append, self.log.append
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
        self.controls.update(OBJECT_POSE)
        self.view.update(now)
        self.controls.mark(now)

    def until(self, what):
        """Step until a condition is true."""
        end = time.monotonic() + DEADLINE
        while not what():
            assert time.monotonic() < end, (self.control, self.refused, self.taken)
            self.step()
            time.sleep(0.01)

    def grab(self):
        """Begin a drag of the object."""
        self.browser.drag('handle', 'start', 0.1, 0.0)
        self.until(lambda: self.control.drag is not None)

    def press_stop(self):
        """Press the stop, after which all earlier messages have been read."""
        self.set('stop', True)
        self.until(lambda: self.stops)

    def close(self):
        """End browser and server."""
        self.browser.close()
        self.view.close()
