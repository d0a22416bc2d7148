# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Who has control of the robot, and what is commanded so."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from isotruss_ros.viewer.drag import Drag

ZERO = (0.0, 0.0, 0.0)


@dataclass
class Control:
    """At most one browser has control; what it commands ends with it."""

    browser: int | None = None  #: number of the one in control; None while nobody has it
    drag: Drag | None = None  #: under way; None while nothing is to be moved
    wrench: tuple[float, float, float] = ZERO  #: (fx, fy, m) on the object [N, N m]
    stopped: bool = False  #: an emergency stop is latched: drags do not count

    def pass_on(self, wishes: Mapping[int, bool]) -> None:
        """
        Take control from a browser that is gone or wants none; give it to one where it is free.

        :param wishes: by the number of each connected browser: whether it wants control.
        """
        if self.browser is not None and not wishes.get(self.browser, False):
            self.release()
        if self.browser is None:
            self.browser = next((browser for browser, wish in wishes.items() if wish), None)

    def release(self) -> None:
        """Leave control to nobody, and drop what was commanded."""
        self.browser, self.drag, self.wrench = None, None, ZERO

    def latch(self, stopped: bool) -> None:
        """
        Drop a drag under an emergency stop, and take none until its release.

        :param stopped: whether a stop is latched.
        """
        self.stopped = stopped
        if stopped:
            self.drag = None

    def drag_to(
        self, target: tuple[float, float], begins: bool, now: float, turns: bool = False
    ) -> None:
        """
        Move the target; one that was given up or dropped comes back with a new drag only.

        :param target: (x, y) of the handle [m].
        :param begins: whether the handle was just grabbed.
        :param now: time [s].
        :param turns: whether the handle is the one that turns the object.
        """
        if self.stopped:
            return
        if begins:
            self.drag = Drag(target, now, turns)
        elif self.drag is not None and turns == self.drag.turns:
            self.drag.target = target

    def describe(self, browser: int) -> str:
        """
        Return who has control, in words for one browser.

        :param browser: number of the browser that shows them.
        """
        if self.browser is None:
            return f'browser {browser}: nobody has control'
        if self.browser == browser:
            return f'browser {browser}: this one has control'
        return f'browser {browser}: browser {self.browser} has control'
