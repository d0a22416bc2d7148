# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Control cycle that continues when the clock jumps, and the executor of the cycle."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
import math
import time

from isotruss_ros.nodes.framework.rclpy_handles import call_timer, can_pace
from isotruss_ros.nodes.framework.topics import take_waiting
from rclpy.executors import SingleThreadedExecutor, TimeoutException
from rclpy.node import Node

#: Period of the check whether simulated time stands still [s].
WATCH_PERIOD = 0.02
#: Time before a cycle at which its inputs are read [s].
INPUT_LEAD = 1e-3
#: Smallest ratio of the measured to the desired rate that causes no warning [-].
MIN_RATE_SHARE = 0.8
#: Averaging time of the measured rate [s].
RATE_PERIOD = 1.0
#: Rate of simulated time above which a step of two periods or more is a jump of the clock [-].
MAX_CLOCK_RATE = 30.0
#: Longest delay of other callbacks by a slow cycle [s].
MAX_CALLBACK_DELAY = 0.02


class Cycle:
    """
    Control cycle, which calls a function at a fixed rate until the node stops its timers.

    :ivar is_steady: whether the cycles are timed by the steady clock and not by simulated time.
    :param node: node with the parameters `rate` [Hz] and `command_timeout` [s]. The clock is
        regarded as stopped if it does not advance for `command_timeout`.
    :param step: callback that is called in each cycle with the current time [s].
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
        self.duration = 0.0  #: computing time of the last cycle [s]
        #: Computing times of the latest cycles since the last summary [s].
        self._times: deque[float] = deque(maxlen=10_000)
        #: Number of cycles counted for the measured rate, and time at which the count began [s].
        self._count, self._since = 0, None
        self._counted = 0.0, 0.0  #: time and steady time of the cycle counted last [s]
        self.rate = math.inf  #: rate measured last [Hz]
        self.slowness = ''  #: measured rate in words if it is too low; else empty
        self.is_steady = not node.get_parameter('use_sim_time').value
        self._clocks = [
            subscription
            for subscription in node.subscriptions
            if subscription.topic_name == '/clock'
        ]
        # Timers of the system clock would stop for an hour if it is set back by an hour.
        create_timer = node.create_steady_timer if self.is_steady else node.create_timer
        self._timer = create_timer(1.0 / self._values.rate, self._tick)
        #: Whether `PacedExecutor` calls the cycle in place of its timer.
        self.is_paced = self.is_steady and can_pace(self._timer, node.subscriptions)
        if stopped is not None and not self.is_steady:
            node.create_steady_timer(WATCH_PERIOD, self._check)

    def apply(self) -> None:
        """Apply the current value of the node's parameter `rate` to the cycle."""
        self._timer.timer_period_ns = int(1e9 / self._values.rate)
        self._since = None

    def time_left(self) -> float:
        """Return the time until the next cycle [s], which is negative if the cycle is late."""
        return 1e-9 * self._timer.time_until_next_call()

    def run(self) -> None:
        """Run the next cycle; called by `PacedExecutor` in place of a timer."""
        call_timer(self._timer)
        self._tick()

    def summary(self) -> dict[str, object]:
        """Return the number, computing times and overruns of the cycles since the last summary."""
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
        # After a long callback the inputs may be newer than a time taken before it.
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
        self._count_rate(1e-9 * now.nanoseconds, time.monotonic())

    def _count_rate(self, now: float, steady: float) -> None:
        """Count a cycle; update the measured rate once a second."""
        if self.is_steady:
            now = steady
        (before, steady_before), self._counted = self._counted, (now, steady)
        step = now - before
        has_jumped = step > max(2.0 / self._values.rate, MAX_CLOCK_RATE * (steady - steady_before))
        if self._since is None or step < 0.0 or has_jumped:
            self._count, self._since = 0, now  # type: ignore[assignment]
            return
        self._count += 1
        elapsed, wanted = now - self._since, self._values.rate
        if elapsed < RATE_PERIOD:
            return
        self.rate = self._count / elapsed
        slow = self.rate < MIN_RATE_SHARE * wanted
        self.slowness = f'the loop reaches {self.rate:.3g} of {wanted:g} Hz' if slow else ''
        self._count, self._since = 0, now

    def _check(self) -> None:
        now, elapsed = self._clock.now(), time.monotonic()
        if now.nanoseconds != self._read:
            self._read, self._changed = now.nanoseconds, elapsed
        elif elapsed - self._changed > self._values.command_timeout:
            self._stopped(1e-9 * now.nanoseconds)


class PacedExecutor(SingleThreadedExecutor):
    """
    Executor that runs, in each period, each ready callback once and then the control cycle.

    Before each wait, rclpy collects all entities of a node in Python. The executors of rclpy wait
    once per message, this executor only once per cycle. With `SingleThreadedExecutor`, which
    works as well, `manipulation` takes 1.25 to 1.6 times the CPU time (three runs in turn at 100
    Hz on a busy machine).

    :param node: the only node that is executed; its `cycle` is None or a `Cycle`.
    """

    def __init__(self, node: Node) -> None:
        super().__init__()
        self.add_node(node)
        self._node = node

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """
        Wait for the next control cycle and run it; without a paced cycle, as rclpy.

        :param timeout_sec: longest wait if the node has no paced cycle [s].
        """
        cycle = self._node.cycle
        if cycle is None or not cycle.is_paced:
            super().spin_once(timeout_sec)
            return
        time.sleep(max(0.0, min(cycle.time_left() - INPUT_LEAD, MAX_CALLBACK_DELAY)))
        self._execute_waiting()
        # The callbacks may have destroyed the cycle.
        if self._node.cycle is cycle and cycle.time_left() <= INPUT_LEAD:
            time.sleep(max(0.0, cycle.time_left()))
            cycle.run()

    def _execute_waiting(self) -> None:
        """Execute each ready callback of the node once."""
        while True:
            try:
                handler, _entity, _node = self.wait_for_ready_callbacks(timeout_sec=0.0)
            except TimeoutException:
                return
            handler()
            handler.result()  # raises the exception of the callback
