# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Processor time of imports, and time from the start of a node to its first command.

Each measurement is a new process. The peers are the import of NumPy and SciPy's optimisation, and
an empty rclpy node that publishes the same type of message at the same rate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Any

from isotruss_ros.demo.processes import keep_to_this_machine
import numpy as np
import rclpy
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from studies.benchmarks.measuring import part, Table

TRIALS = part(7)
COMMANDS = 'roller_velocity_controller/commands'
#: Longest silence of a process [s].
DEADLINE = 30.0
PEER_IMPORT = 'import numpy, scipy.optimize'
#: Code of a new process, by what it loads.
IMPORTS = {
    'all names of `isotruss_ros.core`': 'from isotruss_ros.core import *',
    '`core.analyze_grasp`': 'from isotruss_ros.core import analyze_grasp',
    '`isotruss plan_grasps --help`': 'import isotruss_ros.cli.plan_grasps as p; p._parser()',
    '`isotruss fit_tube_stiffness --help`': (
        'import isotruss_ros.cli.fit_tube_stiffness as p; p._parser()'
    ),
}
#: Arguments which start the manipulation node (its first command is zero without inputs).
NODE = ('-m', 'isotruss_ros.executables', 'manipulation', '--ros-args', '-p', 'rate:=200.0')
PEER = (str(Path(__file__).with_name('peer.py')), COMMANDS)


def environment() -> dict[str, str]:
    """Return the environment of a process which may keep the modules it compiles."""
    return {k: v for k, v in os.environ.items() if k != 'PYTHONDONTWRITEBYTECODE'}


def time_import(statement: str) -> float:
    """Return the processor time of code in a new process, without the start of Python [s]."""
    measured = f'import time; t = time.process_time(); {statement}; print(time.process_time() - t)'
    done = subprocess.run(
        [sys.executable, '-c', measured],
        env=environment(),
        capture_output=True,
        text=True,
        check=True,
    )
    return float(done.stdout)


class Watch:
    """Subscription to commands; it is created once, because the first discovery takes seconds."""

    def __init__(self) -> None:
        rclpy.init()
        self._node = Node('watch')
        self._seen: list[float] = []
        self._node.create_subscription(
            Float64MultiArray, COMMANDS, lambda _: self._seen.append(time.monotonic()), 1
        )

    def time_first_command(self, arguments: Sequence[str]) -> float:
        """Return the time from the start of Python to the first command [s]."""
        began = time.monotonic()
        process = subprocess.Popen(
            [sys.executable, *arguments], env=environment(), stderr=subprocess.DEVNULL
        )
        try:
            while not self._seen:
                rclpy.spin_once(self._node, timeout_sec=0.1)
                if time.monotonic() > began + DEADLINE:
                    raise RuntimeError(f'no command within {DEADLINE} s: {arguments}')
            return self._seen[0] - began
        finally:
            process.send_signal(signal.SIGINT)
            process.wait()
            while self._node.count_publishers(COMMANDS):
                rclpy.spin_once(self._node, timeout_sec=0.1)
            # The last message waits still.
            rclpy.spin_once(self._node, timeout_sec=0.1)
            self._seen.clear()


def tables() -> Iterator[Table]:
    """Yield the tables of the case."""
    keep_to_this_machine()
    yield compare('imports', time_import, IMPORTS, PEER_IMPORT)
    starts = {'start to first command': NODE}
    yield compare('nodes', Watch().time_first_command, starts, PEER)


def compare(
    title: str, measure: Callable[[Any], float], cases: dict[str, Any], peer: Any
) -> Table:
    """Return a table with the median times of cases, each measured in turn with its peer."""
    rows = []
    for what, ours in cases.items():
        pairs = [(measure(ours), measure(peer)) for _ in range(TRIALS)]
        own, other = np.median(pairs, axis=0).tolist()
        rows.append([what, f'{own:.2f}', f'{other:.2f}', f'{own / other:.1f}'])
    return Table(title, ('what', 'ours [s]', 'peer [s]', 'ratio'), rows)
