# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The nodes as processes, commanded and watched by a probe."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
import os
from pathlib import Path
import signal
import time
from unittest import mock

from isotruss_ros.core import Status
from isotruss_ros.demo.processes import NodeProcess
from isotruss_ros.nodes.conversions.messages import read_stamp
import numpy as np
from probe import DEADLINE, World, world
from sensor_msgs.msg import JointState

#: Of inputs [s].
TIMEOUT = 0.5
#: Nodes without shared memory, in which one that is killed may leave a lock: docs/safety.md.
UNSHARED = {
    'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SYSTEM_DEFAULT',
    'FASTRTPS_DEFAULT_PROFILES_FILE': str(Path(__file__).with_name('fast_dds_udp.xml')),
}


class Robot:
    """The nodes as processes (`alive`, by name), and a probe that commands a twist."""

    def __init__(self, w: World, logs: Path) -> None:
        self.w, self._logs = w, logs
        self.alive: dict[str, NodeProcess] = {}
        self._started = 0

    def start(self, name: str, **values: object) -> None:
        self._started += 1
        log = self._logs / f'{self._started}-{name}.log'
        self.alive[name] = NodeProcess(name, {'command_timeout': TIMEOUT} | values, log)

    def signal(self, name: str, which: int) -> None:
        """Send a signal to a node; after SIGKILL wait until it is gone."""
        process = self.alive[name].process
        maps = Path(f'/proc/{process.pid}/maps').read_text()
        assert '/dev/shm/fastrtps' not in maps, f'{name} shares memory: see UNSHARED'
        process.send_signal(which)
        if which == signal.SIGKILL:
            process.wait(DEADLINE)
            del self.alive[name]

    def kill(self) -> None:
        """Kill all nodes, whose state a test that failed would leave to the next one."""
        for process in self.alive.values():
            process.process.kill()
            process.wait()
        self.alive.clear()

    def close(self) -> None:
        """Stop all, and check that none of them has failed."""
        for process in self.alive.values():
            process.process.send_signal(signal.SIGCONT)
            process.interrupt()
        for process in self.alive.values():
            process.wait()
        for log in self._logs.glob('*.log'):
            printed = log.read_text()
            # A node that is hardly started may be interrupted before Python comes to our code.
            early = (
                'Failed to import the site module' in printed
                or 'Python error: init' in printed
                or ('KeyboardInterrupt' in printed and 'in run_node' not in printed)
            )
            assert early or 'Traceback' not in printed, printed

    def moving(self) -> bool:
        """Return whether the last joint states tell of a motion."""
        joints = self.w.probe.last('joints')
        return joints is not None and any(joints.velocity)

    def until_moving(self) -> None:
        """Command a twist until the rollers move, heard from now on."""
        for key in ('joints', 'status'):
            self.w.probe.seen[key].clear()
        self.until(lambda: self.moving() and self.w.code() == Status.OK)

    def until(self, what: Callable[[], bool], also: Callable[[], None] = lambda: None) -> None:
        """Command a twist to and fro, and do something else, until something holds."""

        def each() -> None:
            for process in self.alive.values():
                process.require_running()
            swing = 0.02 * np.cos(np.pi * time.monotonic())
            self.w.probe.send_twist((0.0, swing, 0.0))
            also()

        self.w.until(what, each)

    def check_rests(self, in_spite_of_twists: bool = False) -> None:
        """Check that the rollers come to rest, and stay so for some time."""
        until = self.until if in_spite_of_twists else self.w.until
        joints = self.w.probe.seen['joints']
        begun, now = len(joints), self.w.probe.past(0.0)

        def later() -> list[JointState]:
            # What comes late on a busy machine may be from before a motion.
            return [m for _, m in joints[begun:] if read_stamp(m.header) > now]

        until(lambda: len(later()) > 20 and not any(any(m.velocity) for m in later()[-20:]))
        at, counted = self.w.travel(), len(joints)
        until(lambda: len(joints) > counted + 30)
        assert not any(any(m.velocity) for _, m in joints[counted:])
        assert np.array_equal(self.w.travel(), at)


@contextlib.contextmanager
def robot(logs: Path, **options: object) -> Iterator[Robot]:
    """Return a robot of processes, stopped at the end, with the options of `world`."""
    with world(**options) as w, mock.patch.dict(os.environ, UNSHARED):
        made = Robot(w, logs)
        try:
            yield made
        finally:
            made.close()
