# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What plant `mujoco` takes of a core, with the default mesh and commands at 200 Hz.

First the plant alone, in the CPU time of its thread: an object pressed into the grip at home, the
rollers at rest and moving. Then the node `simulator` as a process, by the time of the wall; where
the machine is busy otherwise, the lag that it reports is what other processes took.

    python benchmarks/mujoco_plant.py
"""

from __future__ import annotations

import os
from pathlib import Path
import tempfile
import time

os.environ.update(OPENBLAS_NUM_THREADS='1', OMP_NUM_THREADS='1')  # before NumPy comes in

from diagnostic_msgs.msg import DiagnosticArray
from isotruss_ros.core import (
    ConvexObject,
    load_robot,
    RollerFaults,
    tangent_center,
)
from isotruss_ros.demo.processes import keep_to_this_machine, running_nodes
from isotruss_ros.mujoco_plant.driven_robot import DrivenRobot
from isotruss_ros.mujoco_plant.options import PlantOptions
from measuring import print_machine, print_table, SHARE, timed
import numpy as np
import psutil
import rclpy
from std_msgs.msg import Float64MultiArray

RATE, DURATION = 200.0, max(0.1, 5.0 * SHARE)
DIAMETER, INDENTATION, FRICTION = 0.3, 0.02, 0.8
#: Of the rollers, to and fro [m/s].
SPEEDS = 0.02 * np.array([1.0, -1.0, 0.5, 0.3, -0.4, 0.2])
#: For the nodes to find each other [s], and for how long the node is watched [s].
WARM_UP, WATCHED = max(1.0, 3.0 * SHARE), max(0.5, 15.0 * SHARE)
LAG = 'lag of the simulation [s]'


def driven(options: PlantOptions) -> DrivenRobot:
    """Return a robot that presses on an object."""
    robot = load_robot('nine_member')
    center = tangent_center(robot.home, 'north/Z', DIAMETER, INDENTATION)
    return DrivenRobot(robot, ConvexObject.disc(center, DIAMETER), False, options, RollerFaults())


def plant_row(name: str, options: PlantOptions, speeds: np.ndarray) -> list[str]:
    """Return the CPU time of a simulated second, and the longest cycle."""
    robot, cycles = driven(options), round(RATE * DURATION)
    times = []
    for k in range(cycles):
        robot.command(speeds if k < 0.5 * cycles else -speeds)
        times.append(timed(lambda: robot.advance(1.0 / RATE))[0])
    assert sum(force.normal > 0.0 for force in robot.plant.contact_forces().values()) == 2
    share = sum(times) / DURATION
    late = 1e3 * float(np.percentile(times, 99))
    return [name, str(robot.plant.model.nv), f'{share:.2f}', f'{1.0 / share:.1f}', f'{late:.1f}']


def node_row() -> list[str]:
    """Return the share of a core that the node takes, and its lag."""
    rclpy.init()
    node = rclpy.create_node('benchmark')
    lags: list[float] = []

    def receive(message: DiagnosticArray) -> None:
        for status in message.status:
            lags.extend(float(pair.value) for pair in status.values if pair.key == LAG)

    node.create_subscription(DiagnosticArray, '/diagnostics', receive, 10)
    commands = node.create_publisher(Float64MultiArray, 'roller_velocity_controller/commands', 1)

    def spin(duration: float) -> None:
        end = time.monotonic() + duration
        while (now := time.monotonic()) < end:
            speeds = SPEEDS if int(now) % 2 else -SPEEDS
            commands.publish(Float64MultiArray(data=speeds.tolist()))
            rclpy.spin_once(node, timeout_sec=1.0 / RATE)

    parameters = {'plant': 'mujoco', 'friction': FRICTION, 'indentation': INDENTATION}
    nodes = [('simulator', parameters | {'rate': RATE, 'command_timeout': 1.0})]
    with tempfile.TemporaryDirectory() as logs, running_nodes(nodes, Path(logs)) as processes:
        while not lags:
            spin(0.5)
        spin(WARM_UP)
        process = psutil.Process(processes[0].process.pid)
        before, lag, begin = process.cpu_times(), lags[-1], time.monotonic()
        spin(WATCHED)
        after, lost, passed = process.cpu_times(), lags[-1] - lag, time.monotonic() - begin
    node.destroy_node()
    rclpy.shutdown()
    used = after.user + after.system - before.user - before.system
    simulated = passed - lost
    return [f'{used / simulated:.2f}', f'{simulated / used:.1f}', f'{100.0 * lost / passed:.0f}']


def main() -> None:
    """Measure and print."""
    print_machine()
    still = np.zeros_like(SPEEDS)
    fine = PlantOptions(friction=FRICTION, segments=16)
    rows = [
        plant_row('at rest', PlantOptions(friction=FRICTION), still),
        plant_row('rollers moving', PlantOptions(friction=FRICTION), SPEEDS),
        plant_row('twice as many segments', fine, SPEEDS),
    ]
    header = [
        'plant',
        'coordinates',
        'core / simulated s',
        'times real time',
        '99 % of cycles [ms]',
    ]
    print_table(header, rows)
    keep_to_this_machine()
    print_table(
        ['node', 'core / simulated s', 'times real time', 'lag [%]'],
        [[f'simulator, {RATE:g} Hz', *node_row()]],
    )


if __name__ == '__main__':
    main()
