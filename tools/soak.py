# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Run simulator, manipulation (1 kHz) and grasp analysis for long under all kinds of disturbances.

The exit code is 1 if a node ended, printed a traceback, moved despite a fault or did not recover,
or if the memory of a node grew.

    PYTHONPATH=test/helpers python tools/soak.py --minutes 15
"""

from __future__ import annotations

import argparse
from collections import Counter
import os
from pathlib import Path
import sys
import tempfile
import time

from geometry_msgs.msg import Twist, WrenchStamped
from isotruss_ros.core import Status
from isotruss_ros.demo.processes import keep_to_this_machine
import numpy as np
from probe import Manager, N
import psutil
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters
from robot_processes import Robot, robot
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64MultiArray

RATE = 1000.0
#: Duration of each disturbance [s].
DURATION = 3.0
#: What is allocated at first and then kept does not count [s]; nor what the first times that a
#: node is configured again leave in the middleware, some 50 kB each until nothing more comes.
WARM_UP = 20.0
WARM_UP_ROUNDS = 40
#: Largest admissible growth of the median memory from an early to a late quarter [MB].
GROWTH = 1.5


class Soak:
    """
    Test that repeats all disturbances.

    :ivar statuses: number of cycles with each status.
    :ivar memory: for each node, pairs of time [s] and resident memory [MB].
    """

    def __init__(self, r: Robot) -> None:
        self._r, self._w = r, r.w
        self.statuses: Counter[str] = Counter()
        self.memory: dict[str, list[tuple[float, float]]] = {name: [] for name in r.alive}
        self._sampled = self._begun = time.monotonic()
        self._setter = self._w.probe.create_client(SetParameters, 'manipulation/set_parameters')
        self._manager = Manager(self._w, 'manipulation')

    def run(self, duration: float) -> None:
        """Cause one disturbance after another for a duration [s]."""
        things = (
            self._carry,
            self._send_nonsense,
            self._flood,
            self._stop,
            self._change_parameters,
            self._manager.restart,
        )
        for _ in range(WARM_UP_ROUNDS):
            self._manager.restart()
        done = 0
        while time.monotonic() - self._begun < duration:
            things[done % len(things)]()
            done += 1
            self._r.until_moving()

    def _for(self, duration: float, also: object = lambda: None) -> None:
        """Command a twist for a duration [s]; call a function meanwhile and watch the nodes."""
        end = time.monotonic() + duration

        def each() -> None:
            also()
            self._watch()

        self._r.until(lambda: time.monotonic() >= end, each)

    def _watch(self) -> None:
        """Check the statuses, and sample the memory at intervals."""
        for _, status in self._w.probe.seen['status']:
            self.statuses[Status(status.code).name] += 1
            if status.code >= Status.HALT_NO_TWIST:
                assert status.achieved == Twist(), status
        for heard in self._w.probe.seen.values():
            del heard[:-1]
        now = time.monotonic()
        if now - self._sampled >= 1.0:
            self._sampled = now
            for name, process in self._r.alive.items():
                size = psutil.Process(process.process.pid).memory_info().rss / 2**20
                self.memory[name].append((now - self._begun, size))

    def _carry(self) -> None:
        self._for(2.0 * DURATION)

    def _send_nonsense(self) -> None:
        probe, bad = self._w.probe, [float('nan')] * N

        def nonsense() -> None:
            probe.joint_states.publish(JointState(name=['nobody'], position=bad))
            probe.commands.publish(Float64MultiArray(data=bad))
            probe.wrenches.publish(WrenchStamped())
            probe.send_pose(frame='elsewhere')
            probe.send_twist((np.inf, 0.0, 0.0))

        self._for(DURATION, nonsense)

    def _flood(self) -> None:
        probe = self._w.probe
        large = JointState(name=[str(i) for i in range(500)], position=[0.0] * 500)

        def flood() -> None:
            for _ in range(20):
                probe.send_twist()
                probe.joint_states.publish(large)
                probe.wrenches.publish(WrenchStamped())
                probe.stops.publish(Bool(data=False))

        self._for(DURATION, flood)
        # This publisher keeps one message only: what it overwrote is lost, and that is a stop.
        self._for(0.5)
        assert self._w.release_stop().success

    def _stop(self) -> None:
        self._w.probe.stops.publish(Bool(data=True))
        self._for(DURATION)
        assert self._w.code() == Status.HALT_EMERGENCY_STOP
        self._w.probe.stops.publish(Bool(data=False))
        words = 'message is false'
        self._r.until(lambda: words in self._w.probe.last('status').message, self._watch)
        assert self._w.release_stop().success

    def _change_parameters(self) -> None:
        pending = []

        def change() -> None:
            if pending and not pending[-1].done():
                return
            diameter = 0.3 if len(pending) % 2 else -1.0
            value = ParameterValue(type=3, double_value=diameter)
            request = [Parameter(name='object_diameter', value=value)]
            pending[:] = [self._setter.call_async(SetParameters.Request(parameters=request))]

        self._for(DURATION, change)


def growth(samples: list[tuple[float, float]]) -> tuple[float, float]:
    """Return the growth of memory from an early to a late quarter, and its slope [MB, MB/h]."""
    times, sizes = np.array([s for s in samples if s[0] > WARM_UP]).T
    quarter = len(sizes) // 4
    slope = np.polyfit(times, sizes, 1)[0] * 3600.0
    return float(np.median(sizes[-quarter:]) - np.median(sizes[:quarter])), float(slope)


def main() -> int:
    """Run the test, and print its result."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument('--minutes', type=float, default=15.0)
    arguments = parser.parse_args()
    keep_to_this_machine()
    good = True
    with tempfile.TemporaryDirectory() as logs, robot(Path(logs)) as r:
        r.start('simulator')
        r.start('manipulation', rate=RATE)
        r.start('grasp_analysis')
        r.until_moving()
        soak = Soak(r)
        began = time.monotonic()
        soak.run(60.0 * arguments.minutes)
        elapsed = time.monotonic() - began
    cycles = sum(soak.statuses.values())
    print(
        f'{elapsed:.0f} s, {cycles / elapsed:.0f} cycles a second heard of, {os.cpu_count()} CPUs'
    )
    for status, count in soak.statuses.most_common():
        print(f'{count:9d} {status}')
    for name, samples in soak.memory.items():
        grown, slope = growth(samples)
        flat = grown < GROWTH
        good &= flat
        course = ' '.join(f'{size:.1f}' for _, size in samples[:: max(1, len(samples) // 12)])
        print(f'{name}: {course} MB, {grown:+.2f} MB, {slope:+.1f} MB/h:', end=' ')
        print('flat' if flat else 'NOT FLAT')
    return 0 if good else 1


if __name__ == '__main__':
    sys.exit(main())
