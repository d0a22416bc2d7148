# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node `teleop`: the keyboard moves the grasped object, by the Twist that any teleop publishes."""

from __future__ import annotations

from collections.abc import Sequence
import os
import sys
import termios
import threading
import time
import tty
from typing import Any

from isotruss_ros.core import IsotrussError
from isotruss_ros.nodes.components import common_parameters as common
from isotruss_ros.nodes.components.commands import create_twist_publisher
from isotruss_ros.nodes.framework.cycle import create_steady_timer
from isotruss_ros.nodes.framework.parameters import FixedSpec, Spec
from isotruss_ros.nodes.framework.runner import StoppableNode

HELP = """
Move the grasped object (hold a key; let go to stop):

        w up                q turn left (counter-clockwise)
  a left     d right        e turn right (clockwise)
        s down              space stop

  + faster   - slower       Ctrl-C quit
"""

#: Key to direction (vx, vy, omega).
KEYS = {
    'w': (0.0, 1.0, 0.0),
    's': (0.0, -1.0, 0.0),
    'a': (-1.0, 0.0, 0.0),
    'd': (1.0, 0.0, 0.0),
    'q': (0.0, 0.0, 1.0),
    'e': (0.0, 0.0, -1.0),
    ' ': (0.0, 0.0, 0.0),
}
FASTER = {'+': 1.25, '-': 0.8}

SPECS = (
    Spec('rate', 20.0, 'Twists per second [Hz]', (1.0, 200.0)),
    Spec('speed', 0.03, 'Speed of translation [m/s]', (0.0, 1.0)),
    Spec('turn', 0.2, 'Speed of rotation [rad/s]', (0.0, 10.0)),
    Spec(
        'key_timeout',
        0.6,
        'A key counts this long; longer than the delay of the key repeat [s]',
        (0.01, 5.0),
    ),
    common.USE_STAMPED_TWIST,
    FixedSpec('frame_id', '', 'Frame of a TwistStamped'),
)


class TerminalError(IsotrussError, OSError):
    """There is no keyboard to read."""


class Teleop(StoppableNode):
    """Publish the twist of the last key at `rate`, and zero once the key is released."""

    node_name = 'teleop'
    specs = SPECS
    #: How the terminal was before its keys were read.
    _before: list[Any] | None = None

    def start(self) -> None:
        """Begin to publish."""
        self._twists = create_twist_publisher(
            self, self.values.use_stamped_twist, self.values.frame_id
        )
        self._direction = KEYS[' ']
        self._pressed = time.monotonic()
        self._gain = 1.0
        create_steady_timer(self, 1.0 / self.values.rate, self._cycle)

    def press(self, key: str) -> None:
        """
        Apply a pressed key.

        :param key: one character; others than those of `KEYS` and `FASTER` stop the object.
        """
        self._gain = min(10.0, max(0.1, self._gain * FASTER.get(key, 1.0)))
        if key not in FASTER:
            self._direction = KEYS.get(key, KEYS[' '])
            self._pressed = time.monotonic()

    def begin(self) -> None:
        """
        Read every key at once and without echo.

        :raises TerminalError: standard input is no terminal.
        """
        if not sys.stdin.isatty():
            raise TerminalError('standard input is not a terminal; run it in one')
        self._before = termios.tcgetattr(sys.stdin)
        tty.setcbreak(sys.stdin)
        print(HELP)
        threading.Thread(target=self._read_keys, daemon=True).start()

    def stop(self) -> None:
        """Publish a zero twist before the node ends, and restore the terminal."""
        self._publish_twist(KEYS[' '])
        if self._before is not None:
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._before)

    def _read_keys(self) -> None:
        # Not sys.stdin.read, which would wait for more than there is.
        while keys := os.read(sys.stdin.fileno(), 64):
            for key in keys.decode(errors='replace'):
                self.press(key)

    def _cycle(self) -> None:
        held = time.monotonic() - self._pressed
        self._publish_twist(self._direction if held < self.values.key_timeout else KEYS[' '])

    def _publish_twist(self, direction: Sequence[float]) -> None:
        speed, turn = self._gain * self.values.speed, self._gain * self.values.turn
        self._twists([speed * direction[0], speed * direction[1], turn * direction[2]])
