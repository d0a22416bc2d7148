# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A control cycle that continues when clocks are set, and the executor that waits for it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
import time

from isotruss_ros.nodes.framework.topics import take_waiting
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.executors import SingleThreadedExecutor, TimeoutException
from rclpy.node import Node
from rclpy.timer import Timer

#: A stopped clock is detected within the timeout and this time [s].
WATCH_PERIOD = 0.02
#: So long before a cycle its inputs are read [s].
LEAD = 1e-3
#: Of the rate that is asked for, a loop that reaches less is too slow [-].
SLOW = 0.8
#: The rate that is reached is counted over this time [s].
RATE_PERIOD = 1.0
#: All other callbacks wait no longer than this, however slow the cycle is [s].
LONGEST_WAIT = 0.02


class Cycle:
    """
    Call back at a rate until it is destroyed with the node's other timers.

    :ivar is_steady: whether the cycles follow each other by the steady clock.
    :ivar duration: computing time of the last cycle [s].
    :ivar slowness: the rate that is reached in words, where it is too low; empty otherwise.
    :param node: has the clock that times are read from, simulated or not, and, in `values`, the
        parameters `rate` [Hz] and `command_timeout`: a clock without a change for so long has
        stopped [s].
    :param step: called in every cycle with the time [s].
    :param jumped_back: called before the step when the clock reads less than in the step before.
    :param stopped: called repeatedly instead of steps while simulated time does not advance.
    """

    def __init__(
        self,
        node: Node,
        step: Callable[[float], None],
        jumped_back: Callable[[], None],
        stopped: Callable[[float], None] | None = None,
    ) -> None:
        self._node, self._values = node, node.values
        self._clock, self._step, self._jumped_back = node.get_clock(), step, jumped_back
        self._stopped = stopped
        self._last = self._read = 0
        self._changed = time.monotonic()
        self.duration = 0.0
        #: Of the cycles since the last summary; bounded, should nobody ask for one.
        self._times: deque[float] = deque(maxlen=10_000)
        #: The cycles since a time on the clock that they go by [s], for the rate.
        self._count, self._since = 0, None
        self.slowness = ''
        self.is_steady = not node.get_parameter('use_sim_time').value
        self._clocks = [each for each in node.subscriptions if each.topic_name == '/clock']
        # Timers of the system's clock would stop for an hour when that is set back by an hour.
        create_timer = partial(create_steady_timer, node) if self.is_steady else node.create_timer
        self._timer = create_timer(1.0 / self._values.rate, self._tick)
        if stopped is not None and not self.is_steady:
            create_steady_timer(node, WATCH_PERIOD, self._check)

    def apply(self) -> None:
        """Continue with the present values of the parameters."""
        self._timer.timer_period_ns = int(1e9 / self._values.rate)
        self._since = None

    def time_left(self) -> float:
        """Return the time until the next cycle is due; negative where it is late [s]."""
        return 1e-9 * self._timer.time_until_next_call()

    def run(self) -> None:
        """Run the next cycle without an executor."""
        self._timer.handle.call_timer()
        self._tick()

    def summary(self) -> dict[str, object]:
        """Return count, computing times and overruns of the cycles since this was called last."""
        times, period = sorted(self._times), 1e-9 * self._timer.timer_period_ns
        self._times.clear()
        if not times:
            return {'cycles': 0}
        return {
            'cycles': len(times),
            'cycle time, median [s]': round(times[len(times) // 2], 6),
            'cycle time, longest [s]': round(times[-1], 6),
            'overruns': sum(time > period for time in times),
        }

    def _tick(self) -> None:
        # After a long callback the inputs may be newer than the time that was taken before it.
        for subscription in self._clocks:
            for message in take_waiting([], subscription, 1):
                subscription.callback(message)
        began, now = time.perf_counter(), self._clock.now()
        if now.nanoseconds < self._last:
            self._jumped_back()
        self._last = now.nanoseconds
        if self._node.inputs is not None:
            self._node.inputs.settle()
        self._step(1e-9 * now.nanoseconds)
        self.duration = time.perf_counter() - began
        self._times.append(self.duration)
        self._count_rate(time.monotonic() if self.is_steady else 1e-9 * now.nanoseconds)

    def _count_rate(self, now: float) -> None:
        """Take note of a cycle; once a second, of the rate that was reached."""
        if self._since is None or now < self._since:
            self._count, self._since = 0, now
            return
        self._count += 1
        elapsed, wanted = now - self._since, self._values.rate
        if elapsed < RATE_PERIOD:
            return
        reached = self._count / elapsed
        slow = reached < SLOW * wanted
        self.slowness = f'runs at {reached:.3g} Hz, not at {wanted:g} Hz' if slow else ''
        self._count, self._since = 0, now

    def _check(self) -> None:
        now, elapsed = self._clock.now(), time.monotonic()
        if now.nanoseconds != self._read:
            self._read, self._changed = now.nanoseconds, elapsed
        elif elapsed - self._changed > self._values.command_timeout:
            self._stopped(1e-9 * now.nanoseconds)


class PacedExecutor(SingleThreadedExecutor):
    """
    Execute what waits once before each cycle, and then the cycle.

    rclpy collects all entities of a node anew for each wait, in Python, and would do so for every
    input as it comes. `SingleThreadedExecutor` in place of this class works too: `manipulation`
    then takes 1.25 to 1.6 times the CPU time, three runs in turn at 100 Hz on a busy machine.

    :param node: the only one that is executed; its `cycle` is None or a `Cycle`.
    """

    def __init__(self, node: Node) -> None:
        super().__init__()
        self.add_node(node)
        self._node = node

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """
        Wait for the next cycle, or as rclpy does where there is none by the steady clock.

        :param timeout_sec: without a cycle, longest wait [s].
        :raises Exception: what a callback has raised.
        """
        cycle = self._node.cycle
        if cycle is None or not cycle.is_steady:
            super().spin_once(timeout_sec)
            return
        time.sleep(max(0.0, min(cycle.time_left() - LEAD, LONGEST_WAIT)))
        self._execute_waiting()
        # The callbacks may have ended the cycle.
        if self._node.cycle is cycle and cycle.time_left() <= LEAD:
            time.sleep(max(0.0, cycle.time_left()))
            cycle.run()

    def _execute_waiting(self) -> None:
        """Execute the callbacks that are ready, each once."""
        while True:
            try:
                handler, _entity, _node = self.wait_for_ready_callbacks(timeout_sec=0.0)
            except TimeoutException:
                return
            handler()
            handler.result()  # raises what the callback has raised


def create_steady_timer(node: Node, period: float, callback: Callable[[], None]) -> Timer:
    """
    Return a timer that goes on where simulated time stands still, or the system's clock is set.

    :param node: owns the timer.
    :param period: from callback to callback [s].
    :param callback: called without arguments.
    """
    return node.create_timer(period, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))
