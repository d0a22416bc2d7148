# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What the live view costs: memory and share of a core of the node `viewer`, watched by a browser.

Beside it run the elastic plant, manipulation at 100 Hz and the analysis; the object swings.
Headless Chromium watches, since a view that nobody watches sends nothing.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import shutil
import tempfile
import time

from geometry_msgs.msg import Twist
from isotruss_ros.demo.processes import keep_to_this_machine, NodeProcess, running_nodes
import numpy as np
from playwright.sync_api import sync_playwright
import psutil
import rclpy

#: Between samples [s].
PERIOD = 1.0
#: Start-up that does not count [s].
WARM_UP = 30.0


def wait_for_address(viewer: NodeProcess) -> str:
    """Return the address that the viewer prints."""
    while 'viewer: http' not in (words := viewer.log.read_text()):
        viewer.require_running()
        time.sleep(0.1)
    return words.partition('viewer: ')[2].split()[0]


def main() -> None:
    """Run all of it, and print a table by quarters of the time."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--minutes', type=float, default=10.0)
    options = parser.parse_args()
    chromium = shutil.which('chromium')
    if chromium is None:
        print('needs a browser: apt-get install chromium')
        return
    keep_to_this_machine()
    shown = {'object_diameter': 0.3, 'friction': 0.8}
    common = shown | {'rate': 100.0, 'command_timeout': 1.0}
    nodes = [
        ('simulator', common | {'plant': 'elastic', 'indentation': 0.01}),
        ('manipulation', common),
        ('grasp_analysis', {**common, 'rate': 20.0}),
        ('viewer', shown | {'port': 0}),
    ]
    rclpy.init()
    with (
        tempfile.TemporaryDirectory() as logs,
        running_nodes(nodes, Path(logs)) as processes,
        sync_playwright() as playwright,
    ):
        address = wait_for_address(processes[-1])
        browser = playwright.chromium.launch(
            executable_path=chromium,
            args=['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--no-sandbox'],
        )
        # Small: drawing without hardware takes the cores from the nodes.
        page = browser.new_page(viewport={'width': 500, 'height': 400})
        page.goto(address)
        rows = sample(psutil.Process(processes[-1].process.pid), WARM_UP + 60 * options.minutes)
        browser.close()
    rclpy.try_shutdown()
    print('quarter  memory [MB]  share of a core [%]')
    for number, part in enumerate(np.array_split(rows, 4), 1):
        memory, share = part.mean(axis=0)
        print(f'{number:7}  {memory:11.2f}  {share:19.1f}')


def sample(process: psutil.Process, duration: float) -> np.ndarray:
    """Swing the object, and return memory [MB] and share of a core [%] by time."""
    node = rclpy.create_node('swing')
    twists = node.create_publisher(Twist, 'cmd_vel', 10)
    began, rows = time.monotonic(), []
    spent = last = 0.0
    due = began + WARM_UP
    while (now := time.monotonic()) < began + duration:
        twist = Twist()
        twist.linear.y = 0.02 * float(np.cos(0.5 * now))
        twists.publish(twist)
        time.sleep(0.02)
        if now >= due:
            used = sum(process.cpu_times()[:2])
            if spent:
                share = 100.0 * (used - spent) / (now - last)
                rows.append((process.memory_info().rss / 1e6, share))
            spent, last, due = used, now, due + PERIOD
    node.destroy_node()
    return np.array(rows)


if __name__ == '__main__':
    main()
