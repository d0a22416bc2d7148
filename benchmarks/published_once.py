"""
How often a message that is published once is received.

A process publishes once, as soon as it has one match, and exits 0.1 s later, as
`ros2 topic pub --once` does; the message counts if a running node halts for it, or for its loss, a
moment after.

    python benchmarks/published_once.py --trials 1000 [--topic failed_rollers] [--latched] [--busy]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
import contextlib
import math
import multiprocessing
import os
from pathlib import Path
import time
from typing import Any

from isotruss_ros.demo.processes import NodeProcess
from isotruss_ros.nodes.manipulation import Manipulation
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger

#: From the end of the process until the message counts as missed [s].
WAIT = 2.0
LEAVE = 0.1
BESIDE = ('simulator', 'grasp_analysis', 'path_follower', 'grasp_planner')
#: What is published; the name of a roller that there is not halts until another message comes.
MESSAGES = {'emergency_stop': Bool(data=True), 'failed_rollers': String(data='nobody')}


def publish_once(topic: str, latched: bool) -> None:
    """
    Publish one message, in a process of its own.

    :param topic: its name.
    :param latched: whether late joiners receive it too.
    """
    rclpy.init()
    node = rclpy.create_node('button')
    kept = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
    message = MESSAGES[topic]
    profile = QoSProfile(depth=1, durability=kept)
    publisher = node.create_publisher(type(message), topic, profile)
    while publisher.get_subscription_count() == 0:
        time.sleep(0.001)
    publisher.publish(message)
    time.sleep(LEAVE)
    rclpy.shutdown()


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


def count_received(trials: int, topic: str, start: Callable[[], Any]) -> tuple[int, int]:
    """
    Return how often a node halted, and how often of these for a message that was lost.

    :param trials: number of processes that publish, one after the other.
    :param topic: on which they publish.
    :param start: starts a process and returns it.
    """
    rclpy.init()
    node = Manipulation()
    set_logger_level(node.get_logger().name, LoggingSeverity.ERROR)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    halted = lost = 0
    for trial in range(trials):
        if trial and trial % 100 == 0:
            print(f'{halted} of {trial}', flush=True)
        button = start()
        while button.is_alive():
            executor.spin_once(timeout_sec=0.01)
        deadline = time.monotonic() + WAIT
        while node._halt() is None and time.monotonic() < deadline:
            executor.spin_once(timeout_sec=0.01)
        halt = node._halt()
        halted += halt is not None
        lost += halt is not None and 'left before' in halt[1]
        forget(node, topic)
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
    context = multiprocessing.get_context('forkserver')
    context.set_forkserver_preload(['rclpy', 'std_msgs.msg', '__main__'])

    def start() -> Any:
        button = context.Process(target=publish_once, args=(given.topic, given.latched))
        button.start()
        return button

    with contextlib.ExitStack() as meanwhile:
        if given.beside:
            for name in BESIDE:
                meanwhile.callback(NodeProcess(name, {}, Path(os.devnull)).stop)
        if given.busy:
            burner = multiprocessing.Process(target=turn_in_circles, daemon=True)
            burner.start()
            meanwhile.callback(burner.terminate)
        halted, lost = count_received(given.trials, given.topic, start)
    print(
        f'{given.topic}{" latched" if given.latched else ""}: halted {halted} of {given.trials}, '
        f'{lost} of them for the loss of the message'
    )


if __name__ == '__main__':
    main()
