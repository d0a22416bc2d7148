# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Executables of the package, run by `isotruss NAME` or `ros2 run isotruss_ros NAME`.

setup.py reads the tables of this module before the package is installed, so this module imports no
other module of the package. The import of a node takes about a second. A signal during the import
ends the process at once, because no roller moves yet.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
import importlib
import os
import signal
import sys
from types import FrameType
from typing import NoReturn

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
#: Purpose, and function as `module:name`, of each program that is not a node.
PROGRAMS = {
    'demo': ('plan a grasp, grip an object, carry and hold it', 'isotruss_ros.demo.__main__:main'),
    'view': ('drag a simulated robot in the browser', 'isotruss_ros.demo.view:main'),
    'replay': ('show a recording in the browser', 'isotruss_ros.cli.replay:main'),
    'compare': (
        'compare a recorded run with the model and name what deviates',
        'isotruss_ros.cli.compare:main',
    ),
    'plan_grasps': ('search grasps of an object', 'isotruss_ros.cli.plan_grasps:main'),
    'fit_tube_stiffness': (
        'fit the stiffness of a tube to measured points',
        'isotruss_ros.cli.fit_tube_stiffness:main',
    ),
    'calibrate_home': (
        'fit the roller offsets to measured joints',
        'isotruss_ros.cli.calibrate:home',
    ),
    'calibrate_stiffness': (
        'fit the tube stiffness to joints under a known force',
        'isotruss_ros.cli.calibrate:stiffness',
    ),
    'grasp_dataset': (
        'write a data set of random grasps',
        'isotruss_ros.cli.grasp_dataset:main',
    ),
    'sweep': ('plan grasps for many robots and objects', 'isotruss_ros.cli.sweep:main'),
    'export_mujoco': ('write a robot as a MuJoCo model', 'isotruss_ros.cli.export_mujoco:main'),
}
#: Names of the commands that send a request to the running nodes.
REQUESTS = ('pick', 'move', 'place', 'stop', 'release', 'resume', 'clear-obstacles')
#: Function of these commands as `module:name`; `stop` has a module of its own with few imports.
OPERATE, STOP = 'isotruss_ros.cli.operate:main', 'isotruss_ros.cli.stop:main'


def _leave(_signal: int, _frame: FrameType | None) -> None:
    os._exit(0)


def run_node(name: str) -> NoReturn:
    """
    Run a node until it is interrupted, and end the process.

    :param name: name of a node in `NODES`.
    """
    for which in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(which, _leave)
    try:
        runner = importlib.import_module('isotruss_ros.nodes.framework.runner')
        node = runner.find_node(name)
    except ModuleNotFoundError as error:
        raise _explain_missing(error) from None
    code = runner.run(node)
    sys.stdout.flush()
    sys.stderr.flush()
    # The node has left the network. Destructors of the middleware's libraries are not executed: at
    # the end of 1 of 300 processes on a busy machine one of them crashed.
    os._exit(code)


def run_program(name: str) -> int:
    """Run a program of `PROGRAMS`, or a request of `REQUESTS`; return its exit code."""
    purpose = PROGRAMS.get(name, ('', STOP if name == 'stop' else OPERATE))
    module, function = purpose[1].split(':')
    try:
        return getattr(importlib.import_module(module), function)()
    except ModuleNotFoundError as error:
        raise _explain_missing(error) from None


def __getattr__(name: str) -> Callable[[], int]:
    """Return the function of an executable by its name in the console scripts."""
    if name in NODES:
        return partial(run_node, name)
    if name in PROGRAMS:
        return partial(run_program, name)
    raise AttributeError(name)


def _explain_missing(error: ModuleNotFoundError) -> SystemExit:
    """Return an end of the program that explains how a package is installed."""
    # It imports the core, for which `stop` has no time.
    return SystemExit(importlib.import_module('isotruss_ros.extras').explain_missing(error))


def isotruss() -> int:
    """
    Run the executable named by the first argument of the process with the other arguments.

    :return: exit code of the process.
    """
    name = sys.argv[1] if len(sys.argv) > 1 else ''
    if name in REQUESTS:
        return run_program(name)  # its first argument is the name
    if name not in NODES and name not in PROGRAMS:
        _explain()
    del sys.argv[1]
    return run_node(name) if name in NODES else run_program(name)


def _explain() -> None:
    """Print the help, or an error for an unknown first argument."""
    lines = [f'  {name:<20} {words}' for name, (words, _) in PROGRAMS.items()]
    lines.append(f'requests to the running nodes: {", ".join(REQUESTS)}')
    lines.append(f'nodes: {", ".join(NODES)}')
    parser = argparse.ArgumentParser(
        prog='isotruss',
        usage='%(prog)s [-h] COMMAND ...',
        description='Isoperimetric truss robots: commands and nodes.',
        epilog='\n'.join(['programs:', *lines]),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    choices = [*REQUESTS, *PROGRAMS, *NODES]
    parser.add_argument(
        'command', choices=choices, metavar='COMMAND', help='-h after it: its help'
    )
    parser.parse_args(sys.argv[1:2])


if __name__ == '__main__':
    sys.exit(isotruss())
