"""
What the node `manipulation` takes of a core, and how long its cycle is, with its real topics.

Simulator and manipulation run as processes; twists come at 100 Hz, joint states and object pose at
200 Hz, commands and status leave in every cycle. The peer is a node with a timer at the same rate
that only publishes the same two messages: what rclpy itself takes.

    python benchmarks/manipulation_node.py
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from pathlib import Path
import subprocess
import sys
import tempfile
import time

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

WARM_UP = 2.0
DURATION = 15.0
RATES = (200.0, 1000.0)
#: What is asked for at the highest rate: share of a core, 99th percentile of the cycle [s].
MAX_SHARE = 0.8
MAX_CYCLE = 1e-3


@dataclass
class Load:
    """Share of a core, rate [Hz], cycle times [s] (none for the peer)."""

    share: float
    rate: float
    cycles: np.ndarray


def share_of_a_core(process: psutil.Process, spin: object) -> float:
    """Return the CPU time that a process takes while `spin` runs, over the time that passes."""
    before, begin = process.cpu_times(), time.monotonic()
    spin()
    after, end = process.cpu_times(), time.monotonic()
    used = after.user + after.system - before.user - before.system
    return used / (end - begin)


def measure_manipulation(rate: float) -> Load:
    """Drive the object to and fro and watch the node."""
    rclpy.init()
    node = Node('benchmark')
    statuses: list[ManipulationStatus] = []
    node.create_subscription(ManipulationStatus, 'manipulation/status', statuses.append, 1000)
    from geometry_msgs.msg import Twist

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

    parameters = {'command_timeout': 1.0}
    nodes = [('simulator', parameters), ('manipulation', parameters | {'rate': rate})]
    with tempfile.TemporaryDirectory() as logs, running_nodes(nodes, Path(logs)) as processes:
        spin(WARM_UP)
        statuses.clear()
        watched = psutil.Process(processes[1].process.pid)
        share = share_of_a_core(watched, lambda: spin(DURATION))
    node.destroy_node()
    rclpy.shutdown()
    moving = [status for status in statuses if status.code == Status.OK]
    if len(moving) < 0.9 * len(statuses):
        print(f'only {len(moving)} of {len(statuses)} cycles moved the object')
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


def measure_peer(rate: float) -> Load:
    """Watch an empty node."""
    process = subprocess.Popen([sys.executable, __file__, '--peer', str(rate)])
    try:
        time.sleep(WARM_UP)  # it says nothing that could be waited for
        share = share_of_a_core(psutil.Process(process.pid), lambda: time.sleep(0.5 * DURATION))
    finally:
        process.kill()
        process.wait()
    return Load(share, rate, np.zeros(0))


def main() -> None:
    """Print the table."""
    print_machine()
    keep_to_this_machine()
    rows = []
    for rate in RATES:
        ours, peer = measure_manipulation(rate), measure_peer(rate)
        median, tail = np.percentile(ours.cycles, [50.0, 99.0])
        good = ours.share < MAX_SHARE and tail < MAX_CYCLE
        rows.append(
            [
                f'{rate:.0f}',
                f'{ours.rate:.1f}',
                f'{100 * ours.share:.1f}',
                f'{100 * peer.share:.1f}',
                f'{ours.share / peer.share:.1f}',
                f'{1e6 * median:.0f}',
                f'{1e6 * tail:.0f}',
                ('pass' if good else 'FAIL') if rate == max(RATES) else '',
            ]
        )
    header = ['rate', 'reached', '% core', 'peer %', 'ratio', 'cycle us', 'p99 us']
    print_table([*header, f'< {100 * MAX_SHARE:.0f} %, p99 < 1 ms'], rows)


if __name__ == '__main__':
    if sys.argv[1:2] == ['--peer']:
        run_peer(float(sys.argv[2]))
    else:
        main()
