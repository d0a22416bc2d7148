# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How often a message that is published once is received.

A process publishes once, as soon as it has one match, and exits 0.1 s later, as
`ros2 topic pub --once` does; the message counts if a running node halts for it, or for its loss, a
moment after, or where it halts nothing, if the node's function for it, or for its loss, is called.

    python benchmarks/published_once.py --trials 1000 [--topic failed_rollers] [--latched] [--busy]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
import contextlib
from functools import partial
import math
import multiprocessing
import os
from pathlib import Path
import select
import subprocess
import sys
import time
from typing import Protocol

from isotruss_ros.demo.processes import NodeProcess
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.manipulation.sparse_messages import SparseMessages
from isotruss_ros.nodes.manipulation.trajectory_following import TOPIC as TRAJECTORIES
from isotruss_ros.nodes.manipulation.trajectory_following import TrajectoryFollowing
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.logging import LoggingSeverity, set_logger_level
from std_msgs.msg import Bool, String

#: From the end of the process until the message counts as missed [s].
WAIT = 2.0
BESIDE = ('simulator', 'grasp_analysis', 'path_follower', 'grasp_planner')


def turn_in_circles() -> None:
    """Keep a core busy."""
    while True:
        pass


class Listener(Protocol):
    """A running node that listens."""

    node: ManagedNode

    def heard(self) -> str | None:
        """Return what the node says of the message, None where it has not received it."""

    def forget(self) -> None:
        """Go on as if nothing had been received."""


class Halting:
    """
    Manipulation, which halts for a message or for its loss.

    :param topic: of the message.
    """

    def __init__(self, topic: str) -> None:
        self.node = Manipulation()
        self._topic = topic

    def heard(self) -> str | None:
        """Return why the rollers are halted."""
        halt = self.node._find_halt()
        return None if halt is None else halt[1]

    def forget(self) -> None:
        """Receive what ends the halt."""
        if self._topic == 'failed_rollers':
            owner = self.node._failed_rollers
            owner._receive([String()])
        else:
            # The service asks for a false first.
            owner = self.node._stop
            owner._receive([Bool(data=False)])
            owner._release()


class Called:
    """Manipulation with functions that are called for a trajectory, and for the loss of one."""

    def __init__(self) -> None:
        self._heard: str | None = None
        # Before the node subscribes with them.
        TrajectoryFollowing._receive = lambda *_: self._note('received')
        TrajectoryFollowing._report_missing = lambda _, why: self._note(why)
        self.node = Manipulation()

    def _note(self, what: str) -> None:
        self._heard = what

    def heard(self) -> str | None:
        """Return what a function was called for."""
        return self._heard

    def forget(self) -> None:
        """Wait for the next call."""
        self._heard = None


LISTENERS: dict[str, Callable[[], Listener]] = {
    'emergency_stop': partial(Halting, 'emergency_stop'),
    'failed_rollers': partial(Halting, 'failed_rollers'),
    TRAJECTORIES: Called,
}


def expect_the_next(node: ManagedNode) -> None:
    """Have a node notice that a publisher left less than a second after a message, too."""
    for subscription in node.subscriptions:
        for handler in subscription.event_handlers:
            owner = getattr(handler.callback, '__self__', None)
            if isinstance(owner, SparseMessages):
                owner._received = -math.inf


def count_received(trials: int, topic: str, kind: str) -> tuple[int, int]:
    """
    Return how often a node heard a message, and how often of these only that one was lost.

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
    listener = LISTENERS[topic]()
    node = listener.node
    set_logger_level(node.get_logger().name, LoggingSeverity.ERROR)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    heard = lost = 0
    for trial in range(trials):
        if trial and trial % 100 == 0:
            print(f'{heard} of {trial}', flush=True)
        buttons.stdin.write(f'{topic} {kind}\n')
        buttons.stdin.flush()
        while not select.select([buttons.stdout], [], [], 0.0)[0]:
            executor.spin_once()
        buttons.stdout.readline()
        deadline = time.monotonic() + WAIT
        while listener.heard() is None and time.monotonic() < deadline:
            executor.spin_once()
        reason = listener.heard()
        heard += reason is not None
        lost += reason is not None and 'left before' in reason
        listener.forget()
        expect_the_next(node)
    buttons.communicate()
    node.stop()
    node.destroy_node()
    rclpy.shutdown()
    return heard, lost


def main() -> None:
    """Print how many messages were received."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--trials', type=int, default=1000)
    parser.add_argument('--topic', choices=LISTENERS, default='emergency_stop')
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
        heard, lost = count_received(given.trials, given.topic, kind)
    print(
        f'{given.topic} {kind}: received {heard} of {given.trials}, '
        f'{lost} of them as the loss of the message'
    )


if __name__ == '__main__':
    main()
