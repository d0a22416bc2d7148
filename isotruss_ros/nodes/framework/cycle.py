# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A control cycle that continues when clocks are set, and detects one that jumps back or stops."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import time

from isotruss_ros.nodes.framework.subscriptions import take_waiting
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.time import Time
from rclpy.timer import Timer

#: A stopped clock is detected within the timeout and this share of it, or this time [s].
WATCH_SHARE, SHORTEST_WATCH = 0.5, 0.01


class Cycle:
    """
    Call back at a rate until it is destroyed with the node's other timers.

    :param node: its clock, simulated or not, is the one that times are read from.
    :param rate: cycles per second of the clock of the timer [Hz].
    :param step: called in every cycle with the time.
    :param jumped_back: called before the step when the clock reads less than in the step before.
    :param stopped: called repeatedly instead of steps while simulated time does not advance.
    :param progress_timeout: time without a change after which the clock counts as stopped [s].
    """

    def __init__(
        self,
        node: Node,
        rate: float,
        step: Callable[[Time], None],
        jumped_back: Callable[[], None],
        stopped: Callable[[Time], None] | None = None,
        progress_timeout: float = 1.0,
    ) -> None:
        self._clock, self._step, self._jumped_back = node.get_clock(), step, jumped_back
        self._stopped, self._progress_timeout = stopped, progress_timeout
        self._last = self._read = 0
        self._changed = time.monotonic()
        simulated = node.get_parameter('use_sim_time').value
        self._times = [each for each in node.subscriptions if each.topic_name == '/clock']
        # Timers of the system's clock would stop for an hour when that is set back by an hour.
        create_timer = node.create_timer if simulated else partial(create_steady_timer, node)
        self._timer = create_timer(1.0 / rate, self._tick)
        self._watchdog: Timer | None = None
        if stopped is not None and simulated:
            self._watchdog = create_steady_timer(
                node, _watch_period(progress_timeout), self._check
            )

    def change(self, rate: float, progress_timeout: float | None = None) -> None:
        """
        Continue at another rate.

        :param rate: cycles per second [Hz].
        :param progress_timeout: see above; unchanged where left out [s].
        """
        self._timer.timer_period_ns = int(1e9 / rate)
        if self._watchdog is not None and progress_timeout is not None:
            self._progress_timeout = progress_timeout
            self._watchdog.timer_period_ns = int(1e9 * _watch_period(progress_timeout))

    @property
    def is_steady(self) -> bool:
        """Return whether the cycles follow each other by the steady clock."""
        return self._timer.clock.clock_type == ClockType.STEADY_TIME

    def time_left(self) -> float:
        """Return the time until the next cycle is due; negative where it is late [s]."""
        return 1e-9 * self._timer.time_until_next_call()

    def run(self) -> None:
        """Run the next cycle without an executor."""
        self._timer.handle.call_timer()
        self._tick()

    def _tick(self) -> None:
        # After a long callback the inputs may be newer than the time that was taken before it.
        for subscription in self._times:
            for message in take_waiting([], subscription, 1):
                subscription.callback(message)
        now = self._clock.now()
        if now.nanoseconds < self._last:
            self._jumped_back()
        self._last = now.nanoseconds
        self._step(now)

    def _check(self) -> None:
        now, elapsed = self._clock.now(), time.monotonic()
        if now.nanoseconds != self._read:
            self._read, self._changed = now.nanoseconds, elapsed
        elif elapsed - self._changed > self._progress_timeout:
            self._stopped(now)


def create_steady_timer(node: Node, period: float, callback: Callable[[], None]) -> Timer:
    """
    Return a timer that goes on where simulated time stands still, or the system's clock is set.

    :param node: owns the timer.
    :param period: from callback to callback [s].
    :param callback: called without arguments.
    """
    return node.create_timer(period, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))


def _watch_period(progress_timeout: float) -> float:
    """Return the period at which a clock is read [s]."""
    return max(WATCH_SHARE * progress_timeout, SHORTEST_WATCH)
