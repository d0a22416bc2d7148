"""
How often a message that is published once is received.

A process publishes once, as soon as it has one match, and exits 0.1 s later, as
`ros2 topic pub --once` does; the message counts if a running node halts for it, or for its loss, a
moment after.

    python benchmarks/published_once.py --trials 1000 [--topic failed_rollers] [--latched] [--busy]
"""

from __future__ import annotations

import argparse
import contextlib
import math
import multiprocessing
import os
from pathlib import Path
import select
import subprocess
import sys
import time

from button import MESSAGES
from isotruss_ros.demo.processes import NodeProcess
from isotruss_ros.nodes.framework.paced_executor import PacedExecutor
from isotruss_ros.nodes.manipulation import Manipulation
import rclpy
from rclpy.logging import LoggingSeverity, set_logger_level
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger

#: From the end of the process until the message counts as missed [s].
WAIT = 2.0
BESIDE = ('simulator', 'grasp_analysis', 'path_follower', 'grasp_planner')


def turn_in_circles() -> None:
    """Keep a core busy."""
    while True:
        pass


def forget(node: Manipulation, topic: str) -> None:
    """
    Go on as if nothing had been received.

    :param node: received a message.
    :param topic: of the message.
    """
    if topic == 'failed_rollers':
        owner = node._failed_rollers
        owner._receive([String()])
    else:
        # The service asks for a false first.
        owner = node._stop
        owner._receive([Bool(data=False)])
        owner._release(Trigger.Request(), Trigger.Response())
    # That a publisher left is not noticed within a second of a message.
    owner._messages._received = -math.inf


def count_received(trials: int, topic: str, kind: str) -> tuple[int, int]:
    """
    Return how often a node halted, and how often of these for a message that was lost.

    :param trials: number of processes that publish, one after the other.
    :param topic: on which they publish.
    :param kind: `latched` or `volatile`.
    """
    buttons = subprocess.Popen(
        [sys.executable, Path(__file__).with_name('button.py')],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    rclpy.init()
    node = Manipulation()
    set_logger_level(node.get_logger().name, LoggingSeverity.ERROR)
    executor = PacedExecutor(node)
    halted = lost = 0
    for trial in range(trials):
        if trial and trial % 100 == 0:
            print(f'{halted} of {trial}', flush=True)
        buttons.stdin.write(f'{topic} {kind}\n')
        buttons.stdin.flush()
        while not select.select([buttons.stdout], [], [], 0.0)[0]:
            executor.spin_once()
        buttons.stdout.readline()
        deadline = time.monotonic() + WAIT
        while node._halt() is None and time.monotonic() < deadline:
            executor.spin_once()
        halt = node._halt()
        halted += halt is not None
        lost += halt is not None and 'left before' in halt[1]
        forget(node, topic)
    buttons.communicate()
    node.stop()
    node.destroy_node()
    rclpy.shutdown()
    return halted, lost


def main() -> None:
    """Print how many messages were received."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--trials', type=int, default=1000)
    parser.add_argument('--topic', choices=MESSAGES, default='emergency_stop')
    parser.add_argument('--latched', action='store_true')
    parser.add_argument('--busy', action='store_true', help='keep a core busy meanwhile')
    parser.add_argument('--beside', action='store_true', help='run the other nodes beside')
    given = parser.parse_args()
    kind = 'latched' if given.latched else 'volatile'
    with contextlib.ExitStack() as meanwhile:
        if given.beside:
            for name in BESIDE:
                meanwhile.callback(NodeProcess(name, {}, Path(os.devnull)).stop)
        if given.busy:
            burner = multiprocessing.Process(target=turn_in_circles, daemon=True)
            burner.start()
            meanwhile.callback(burner.terminate)
        halted, lost = count_received(given.trials, given.topic, kind)
    print(
        f'{given.topic} {kind}: halted {halted} of {given.trials}, '
        f'{lost} of them for the loss of the message'
    )


if __name__ == '__main__':
    main()
