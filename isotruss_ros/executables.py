# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The nodes as executables: `ros2 run isotruss_ros NODE`, `python -m isotruss_ros.executables NODE`.

Importing a node takes about a second. A signal that comes meanwhile ends the process at once: no
roller turns yet, and there is nothing to print.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import importlib
import importlib.util
import os
import signal
import sys
from types import FrameType

from isotruss_ros.nodes import NO_MESSAGES

NODES = (
    'simulator',
    'manipulation',
    'grasp_analysis',
    'path_follower',
    'grasp_planner',
    'pick_and_place',
    'viewer',
    'record',
    'state_estimator',
    'pluck',
    'calibration',
    'check_rollers',
    'preflight',
)


def _leave(_signal: int, _frame: FrameType | None) -> None:
    os._exit(0)


def run_node(name: str) -> int:
    """
    Run a node until it is interrupted.

    :param name: one of `NODES`.
    :return: exit code of the process.
    """
    for which in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(which, _leave)
    if importlib.util.find_spec('isotruss_msgs') is None:
        print(NO_MESSAGES, file=sys.stderr)
        return 1
    runner = importlib.import_module('isotruss_ros.nodes.framework.runner')
    return runner.run(runner.find_node(name))


def __getattr__(name: str) -> Callable[[], int]:
    """Return the function of an executable, as the console scripts name it."""
    if name in NODES:
        return partial(run_node, name)
    raise AttributeError(name)


if __name__ == '__main__':
    node = sys.argv.pop(1)
    sys.exit(run_node(node))
