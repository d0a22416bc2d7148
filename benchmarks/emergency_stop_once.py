"""
How often a stop that is published once stops the robot.

A process publishes true once, as soon as it has one match, and exits 0.1 s later, as
`ros2 topic pub --once` does; the stop counts if a node that runs has received it a moment after.

    python benchmarks/emergency_stop_once.py --trials 1000 [--latched] [--busy] [--beside]
"""

from __future__ import annotations

import argparse
import contextlib
import multiprocessing
import os
from pathlib import Path
import time

from isotruss_ros.demo.processes import NodeProcess
from isotruss_ros.nodes.manipulation import Manipulation
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

#: From the end of the process until the stop counts as missed [s].
WAIT = 2.0
LEAVE = 0.1
BESIDE = ('simulator', 'grasp_analysis', 'path_follower', 'grasp_planner')


def publish_once(latched: bool) -> None:
    """
    Publish one true, in a process of its own.

    :param latched: whether late joiners receive it too.
    """
    rclpy.init()
    node = rclpy.create_node('button')
    kept = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
    publisher = node.create_publisher(Bool, 'emergency_stop', QoSProfile(depth=1, durability=kept))
    while publisher.get_subscription_count() == 0:
        time.sleep(0.001)
    publisher.publish(Bool(data=True))
    time.sleep(LEAVE)
    rclpy.shutdown()


def turn_in_circles() -> None:
    """Keep a core busy."""
    while True:
        pass


def count_stops(trials: int, latched: bool) -> int:
    """
    Return how often a node stopped.

    :param trials: number of processes that publish, one after the other.
    :param latched: whether they latch.
    """
    start = multiprocessing.get_context('forkserver')
    start.set_forkserver_preload(['rclpy', 'std_msgs.msg', '__main__'])
    rclpy.init()
    node = Manipulation()
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    stopped = 0
    for _ in range(trials):
        button = start.Process(target=publish_once, args=(latched,))
        button.start()
        while button.is_alive():
            executor.spin_once(timeout_sec=0.01)
        deadline = time.monotonic() + WAIT
        while node._stop.reason is None and time.monotonic() < deadline:
            executor.spin_once(timeout_sec=0.01)
        stopped += node._stop.reason is not None
        # The service asks for a false first.
        node._stop._receive([Bool(data=False)])
        node._stop._release(Trigger.Request(), Trigger.Response())
    node.stop()
    node.destroy_node()
    rclpy.shutdown()
    return stopped


def main() -> None:
    """Print how many stops were received."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--trials', type=int, default=1000)
    parser.add_argument('--latched', action='store_true')
    parser.add_argument('--busy', action='store_true', help='keep every core busy meanwhile')
    parser.add_argument('--beside', action='store_true', help='run the other nodes beside')
    given = parser.parse_args()
    with contextlib.ExitStack() as meanwhile:
        if given.beside:
            for name in BESIDE:
                meanwhile.callback(NodeProcess(name, {}, Path(os.devnull)).stop)
        for _ in range(os.cpu_count() or 1 if given.busy else 0):
            burner = multiprocessing.Process(target=turn_in_circles, daemon=True)
            burner.start()
            meanwhile.callback(burner.terminate)
        stopped = count_stops(given.trials, given.latched)
    print(f'{stopped} of {given.trials}')


if __name__ == '__main__':
    main()
