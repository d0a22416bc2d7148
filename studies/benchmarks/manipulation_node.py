# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Processor shares and cycle times of the nodes with the real topics.

Simulator and manipulation run as processes at the same rate. Twists arrive at 100 Hz; commands and
status are published in each cycle. The peer runs at the same time: a node with a timer at 200 Hz
that only publishes the same two messages, so it shows the cost of rclpy.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import contextlib
from dataclasses import dataclass, field
import math
from pathlib import Path
import subprocess
import sys
import tempfile
import time

from geometry_msgs.msg import Twist
from isotruss_msgs.msg import ManipulationStatus
from isotruss_ros.core import Status
from isotruss_ros.demo.processes import keep_to_this_machine, running_nodes
from isotruss_ros.nodes.conversions.messages import read_stamp, to_twist_message
import numpy as np
import psutil
import rclpy
from rclpy.node import Node
from studies.benchmarks.measuring import SHARE, Table

WARM_UP = 3.0
#: Longest time until the first status [s].
COMING_UP = 60
DURATION = max(0.5, 12.0 * SHARE)
#: Diameter [m], friction [-] and depth [m] of the object held by elastic tubes.
HELD = {'object_diameter': 0.3, 'friction': 0.8}
INDENTATION, SQUEEZE = 0.005, 10.0


@dataclass(frozen=True)
class Case:
    """Settings of a measurement."""

    name: str
    rate: float  #: rate of manipulation [Hz]
    simulator: Mapping[str, object] = field(default_factory=dict)
    manipulation: Mapping[str, object] = field(default_factory=dict)
    #: parameters of further nodes; if there are any, the shares of all nodes are added
    others: Mapping[str, Mapping[str, object]] = field(default_factory=dict)


CASES = (
    Case('manipulation', 100.0),
    Case(
        'with squeeze_force',
        100.0,
        HELD | {'plant': 'elastic', 'indentation': INDENTATION},
        HELD | {'squeeze_force': SQUEEZE},
    ),
    Case('and simulator, analysis', 100.0, others={'grasp_analysis': {'rate': 100.0}}),
    Case(
        'with squeeze_force, and simulator, analysis, estimator',
        100.0,
        HELD | {'plant': 'elastic', 'indentation': INDENTATION},
        HELD | {'squeeze_force': SQUEEZE},
        {'grasp_analysis': HELD, 'state_estimator': HELD},
    ),
    Case('manipulation', 200.0),
    Case('manipulation', 1000.0),
)


@dataclass
class Load:
    """Processor shares of nodes and peer [-], rate [Hz], cycle times [s]."""

    share: float
    peer: float
    rate: float
    cycles: np.ndarray


def cpu_time(processes: list[psutil.Process]) -> float:
    """Return the CPU time of processes [s]."""
    times = [process.cpu_times() for process in processes]
    return sum(time.user + time.system for time in times)


@contextlib.contextmanager
def running_peer() -> Iterator[psutil.Process]:
    """Run the peer while a block is executed."""
    with subprocess.Popen(
        [sys.executable, Path(__file__).with_name('peer.py'), 'peer/commands']
    ) as process:
        try:
            yield psutil.Process(process.pid)
        finally:
            process.kill()


def measure_nodes(case: Case) -> Load:
    """Measure manipulation, or all nodes of the case, while the object moves to and fro."""
    rclpy.init()
    node = Node('benchmark')
    statuses: list[ManipulationStatus] = []
    node.create_subscription(ManipulationStatus, 'manipulation/status', statuses.append, 1000)
    twists = node.create_publisher(Twist, 'cmd_vel', 1)
    begin = time.monotonic()

    def spin(duration: float) -> None:
        end, due = time.monotonic() + duration, 0.0
        while (now := time.monotonic()) < end:
            if now >= due:
                swing = math.cos(math.pi * (now - begin))
                twists.publish(to_twist_message((0.02 * swing, 0.03 * swing, 0.1 * swing)))
                due = now + 0.01
            rclpy.spin_once(node, timeout_sec=due - now)

    patient = {'command_timeout': 1.0}
    nodes = [
        ('simulator', patient | {'rate': min(case.rate, 200.0)} | dict(case.simulator)),
        ('manipulation', patient | {'rate': case.rate} | dict(case.manipulation)),
        *((name, patient | dict(values)) for name, values in case.others.items()),
    ]
    with (
        tempfile.TemporaryDirectory() as logs,
        running_peer() as peer,
        running_nodes(nodes, Path(logs)) as processes,
    ):
        for _ in range(COMING_UP):
            if not statuses:
                spin(1.0)
        spin(WARM_UP)
        statuses.clear()
        started = [psutil.Process(process.process.pid) for process in processes]
        watched = started if case.others else started[1:2]
        before, peer_before, measured = cpu_time(watched), cpu_time([peer]), time.monotonic()
        spin(DURATION)
        passed = time.monotonic() - measured
        share = (cpu_time(watched) - before) / passed
        peer_share = (cpu_time([peer]) - peer_before) / passed
    node.destroy_node()
    rclpy.shutdown()
    moving = [status for status in statuses if status.code == Status.OK]
    if len(moving) < 0.9 * len(statuses):
        print(f'{len(moving)} of {len(statuses)} cycles moved the object', file=sys.stderr)
    times = [read_stamp(status.header) for status in statuses]
    return Load(
        share,
        peer_share,
        (len(times) - 1) / (times[-1] - times[0]),
        np.array([status.cycle_time for status in moving]),
    )


def tables() -> Iterator[Table]:
    """Yield the tables of the case."""
    keep_to_this_machine()
    rows = []
    for case in CASES:
        ours = measure_nodes(case)
        cycles = (f'{1e6 * value:.0f}' for value in np.percentile(ours.cycles, [50.0, 99.0]))
        shares = f'{100 * ours.share:.1f}', f'{100 * ours.peer:.1f}'
        rows.append([case.name, f'{case.rate:.0f}', f'{ours.rate:.1f}', *shares, *cycles])
    header = ('nodes', 'rate [Hz]', 'reached', 'core [%]', 'peer [%]', 'cycle [us]', 'p99 [us]')
    yield Table('', header, rows)
