# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What the nodes take of a core, and how long a cycle is, with the real topics.

Simulator and manipulation run as processes; twists come at 100 Hz, joint states and object pose at
200 Hz, commands and status leave in every cycle. The peer, in the same minute, is a node with a
timer at the same rate that only publishes the same two messages: what rclpy itself takes.

    python benchmarks/manipulation_node.py
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
import contextlib
from dataclasses import dataclass, field
import math
import multiprocessing
import os
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
from measuring import print_machine, print_table
import numpy as np
import psutil
import rclpy
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

WARM_UP = 3.0
DURATION = 12.0
#: Diameter, friction and depth of the object that elastic tubes hold.
HELD = {'object_diameter': 0.3, 'friction': 0.8}
INDENTATION, SQUEEZE = 0.01, 10.0


@dataclass(frozen=True)
class Case:
    """
    What is measured.

    :ivar rate: of manipulation [Hz].
    :ivar goal: what is asked for, in words.
    :ivar beside: busy processes that run meanwhile.
    """

    name: str
    rate: float
    goal: str
    simulator: Mapping[str, object] = field(default_factory=dict)
    manipulation: Mapping[str, object] = field(default_factory=dict)
    analysis: bool = False
    beside: int = 0


CORES = os.cpu_count() or 1
CASES = (
    Case('manipulation', 200.0, '2.5 x'),
    Case(
        'with squeeze_force',
        200.0,
        '4 x',
        HELD | {'plant': 'elastic', 'indentation': INDENTATION},
        HELD | {'squeeze_force': SQUEEZE},
    ),
    Case('and simulator, analysis', 200.0, '', analysis=True),
    Case('manipulation', 1000.0, '999 Hz, p99 500 us'),
    Case(f'beside {CORES} busy', 200.0, '', beside=CORES),
    Case(f'beside {CORES} busy', 1000.0, '990 Hz, p99 1000 us', beside=CORES),
)


@dataclass
class Load:
    """Share of a core of the nodes, rate [Hz], cycle times [s] (none for the peer)."""

    share: float
    rate: float
    cycles: np.ndarray


def turn_in_circles() -> None:
    """Keep a core busy."""
    while True:
        pass


@contextlib.contextmanager
def busy_processes(count: int) -> Iterator[None]:
    """Keep cores busy during a block."""
    burners = [multiprocessing.Process(target=turn_in_circles, daemon=True) for _ in range(count)]
    for burner in burners:
        burner.start()
    try:
        yield
    finally:
        for burner in burners:
            burner.terminate()


def share_of_a_core(processes: list[psutil.Process], spin: Callable[[], None]) -> float:
    """Return the CPU time that processes take while `spin` runs, over the time that passes."""

    def used() -> float:
        times = [process.cpu_times() for process in processes]
        return sum(time.user + time.system for time in times)

    before, begin = used(), time.monotonic()
    spin()
    return (used() - before) / (time.monotonic() - begin)


def measure_nodes(case: Case) -> Load:
    """Drive the object to and fro and watch manipulation, or all nodes with the analysis."""
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
        ('simulator', patient | {'rate': 200.0} | dict(case.simulator)),
        ('manipulation', patient | {'rate': case.rate} | dict(case.manipulation)),
    ]
    if case.analysis:
        nodes.append(('grasp_analysis', patient | {'rate': 100.0}))
    with tempfile.TemporaryDirectory() as logs, running_nodes(nodes, Path(logs)) as processes:
        spin(WARM_UP)
        statuses.clear()
        watched = [psutil.Process(process.process.pid) for process in processes]
        with busy_processes(case.beside):
            share = share_of_a_core(
                watched if case.analysis else watched[1:2], lambda: spin(DURATION)
            )
    node.destroy_node()
    rclpy.shutdown()
    moving = [status for status in statuses if status.code == Status.OK]
    if len(moving) < 0.9 * len(statuses):
        print(f'{case.name}: only {len(moving)} of {len(statuses)} cycles moved the object')
    times = [read_stamp(status.header) for status in statuses]
    return Load(
        share,
        (len(times) - 1) / (times[-1] - times[0]),
        np.array([status.cycle_time for status in moving]),
    )


def run_peer(rate: float) -> None:
    """Publish from a timer that does nothing else, until killed."""
    rclpy.init()
    node = Node('peer')
    commands = node.create_publisher(Float64MultiArray, 'peer/commands', 1)
    statuses = node.create_publisher(ManipulationStatus, 'peer/status', 1)
    command, status = Float64MultiArray(data=[0.0] * 6), ManipulationStatus()
    status.header.frame_id = 'truss'

    def publish() -> None:
        commands.publish(command)
        statuses.publish(status)

    node.create_timer(1.0 / rate, publish)
    rclpy.spin(node)


def measure_peer(case: Case) -> float:
    """Return the share of a core that the peer takes."""
    process = subprocess.Popen([sys.executable, __file__, '--peer', str(case.rate)])
    try:
        time.sleep(WARM_UP)  # it says nothing that could be waited for
        with busy_processes(case.beside):
            return share_of_a_core(
                [psutil.Process(process.pid)], lambda: time.sleep(0.5 * DURATION)
            )
    finally:
        process.kill()
        process.wait()


def main() -> None:
    """Print the table."""
    print_machine()
    keep_to_this_machine()
    rows = []
    for case in CASES:
        ours, peer = measure_nodes(case), measure_peer(case)
        rows.append(
            [
                case.name,
                f'{case.rate:.0f}',
                f'{ours.rate:.1f}',
                f'{100 * ours.share:.1f}',
                f'{100 * peer:.1f}',
                f'{ours.share / peer:.1f}',
                *(f'{1e6 * value:.0f}' for value in np.percentile(ours.cycles, [50.0, 99.0])),
                case.goal,
            ]
        )
    header = ['nodes', 'rate', 'reached', '% core', 'peer %', 'ratio', 'cycle us', 'p99 us']
    print_table([*header, 'goal'], rows)


if __name__ == '__main__':
    if sys.argv[1:2] == ['--peer']:
        run_peer(float(sys.argv[2]))
    else:
        main()
