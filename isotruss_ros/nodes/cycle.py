"""A cycle that goes on when clocks are set, and notices when one runs back or stands still."""

from __future__ import annotations

from collections.abc import Callable
import time

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.time import Time
from rclpy.timer import Timer

#: A clock that stands still is noticed within the patience and this share of it, or this time [s].
WATCH_SHARE, SHORTEST_WATCH = 0.5, 0.01


class Cycle:
    """
    Calls back at a rate until it is destroyed with the node's other timers.

    :param node: its clock, simulated or not, is the one that times are read from.
    :param rate: cycles per second, of `pace` [Hz].
    :param step: called in every cycle with the time.
    :param jumped_back: called before the step when the clock reads less than in the step before.
    :param stands: called instead of steps, again and again, while simulated time does not go on.
    :param patience: time without a change after which the clock stands still [s].
    """

    def __init__(
        self,
        node: Node,
        rate: float,
        step: Callable[[Time], None],
        jumped_back: Callable[[], None],
        stands: Callable[[Time], None] | None = None,
        patience: float = 1.0,
    ) -> None:
        self._clock = node.get_clock()
        self._step, self._jumped_back, self._stands = step, jumped_back, stands
        self._patience = patience
        self._last = self._read = 0
        self._changed = time.monotonic()
        self._timer = node.create_timer(1.0 / rate, self._tick, clock=pace(node))
        self._watching: Timer | None = None
        if stands is not None and node.get_parameter('use_sim_time').value:
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self._watching = node.create_timer(_watch(patience), self._check, clock=steady)

    def change(self, rate: float, patience: float | None = None) -> None:
        """Go on at another rate [Hz] and with another patience [s]."""
        self._timer.timer_period_ns = int(1e9 / rate)
        if self._watching is not None and patience is not None:
            self._patience = patience
            self._watching.timer_period_ns = int(1e9 * _watch(patience))

    def _tick(self) -> None:
        now = self._clock.now()
        if now.nanoseconds < self._last:
            self._jumped_back()
        self._last = now.nanoseconds
        self._step(now)

    def _check(self) -> None:
        now, elapsed = self._clock.now(), time.monotonic()
        if now.nanoseconds != self._read:
            self._read, self._changed = now.nanoseconds, elapsed
        elif elapsed - self._changed > self._patience:
            self._stands(now)


def pace(node: Node) -> Clock:
    """
    Return the clock by which a node goes on: that of the simulation, or one that nobody sets.

    The system's clock will not do: set back by an hour, its timers are silent for an hour.
    """
    if node.get_parameter('use_sim_time').value:
        return node.get_clock()
    return Clock(clock_type=ClockType.STEADY_TIME)


def _watch(patience: float) -> float:
    """Return how often a clock is looked at [s]."""
    return max(WATCH_SHARE * patience, SHORTEST_WATCH)
