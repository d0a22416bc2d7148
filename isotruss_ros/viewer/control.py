# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""State of the control by browsers: which browser is in control, and its commands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from isotruss_ros.viewer.drag import Drag

ZERO = (0.0, 0.0, 0.0)


@dataclass
class Control:
    """Control of the robot by at most one browser, with the commands of this browser."""

    browser: int | None = None  #: index of the browser in control; None without one
    drag: Drag | None = None  #: active drag; None without a drag
    wrench: tuple[float, float, float] = ZERO  #: (fx, fy, m) on the object [N, N m]
    stopped: bool = False  #: whether an emergency stop is latched; then drags are ignored
    ended: str = ''  #: reason why the control was ended; empty once a browser has control

    def pass_on(self, wishes: Mapping[int, bool]) -> None:
        """
        Give control to a browser that requests it, if no other browser is in control.

        A browser that has left or no longer requests control loses it.
        """
        if self.browser is not None and not wishes.get(self.browser, False):
            self.release()
        if self.browser is None:
            self.browser = next((browser for browser, wish in wishes.items() if wish), None)
        if self.browser is not None:
            self.ended = ''

    def release(self) -> None:
        """Give up control of the robot, and discard pending commands."""
        self.browser, self.drag, self.wrench = None, None, ZERO

    def latch(self, stopped: bool) -> None:
        """Refuse drags from an emergency stop until its release."""
        self.stopped = stopped
        if stopped:
            self.drag = None

    def drag_to(
        self, target: tuple[float, float], begins: bool, now: float, turns: bool = False
    ) -> None:
        """
        Move the target of the active drag; if the handle was just grabbed, start a drag.

        :param target: (x, y) of the handle [m].
        """
        if self.stopped:
            return
        if begins:
            self.drag = Drag(target, now, turns)
        elif self.drag is not None and turns == self.drag.turns:
            self.drag.target = target

    def describe(self, browser: int) -> str:
        """Return a sentence, addressed to one browser, that names the browser in control."""
        if self.browser is None:
            return ': '.join(filter(None, (f'browser {browser}: nobody has control', self.ended)))
        if self.browser == browser:
            return f'browser {browser}: this one has control'
        return f'browser {browser}: browser {self.browser} has control'
