# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Executable `demo`, which plans a grasp, closes the grip and carries the object along a path."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import importlib
from pathlib import Path
import sys

from isotruss_ros.demo import PERFECT, REAL
from isotruss_ros.demo.processes import parse_arguments
from isotruss_ros.extras import explained_imports
from isotruss_ros.viewer.names import ELASTIC, MUJOCO

#: Simulated robots in which friction holds the object.
PLANTS = (ELASTIC, MUJOCO)


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Run the demonstration; Ctrl-C ends it and its nodes at any time.

    :return: 0 if the object was held and reached its targets, 1 if not, 130 after Ctrl-C.
    """
    parser = argparse.ArgumentParser(prog='isotruss demo', description=__doc__)
    parser.add_argument(
        '--output', type=Path, default=Path('demo_output'), help='folder for pictures and logs'
    )
    parser.add_argument('--rate', type=float, default=100.0, help='rate of the nodes [Hz]')
    parser.add_argument('--plant', choices=PLANTS, default=ELASTIC, help='simulated plant')
    parser.add_argument(
        '--sensors',
        choices=(PERFECT, REAL),
        default=PERFECT,
        help='real: with noise, delay, dropouts, roller offsets and slip',
    )
    parser.add_argument(
        '--clock-speed',
        type=float,
        default=1.0,
        help='ratio of simulated time to real time, with the plant mujoco',
    )
    options, ros_arguments = parse_arguments(parser, arguments)
    print('demonstration: loading, usually 2 s; all of it 80 s', flush=True)
    try:
        # Ctrl-C may come while this is imported, which takes a second.
        with explained_imports():
            demo = importlib.import_module('isotruss_ros.demo.run')
        return demo.run(options, ros_arguments)
    except KeyboardInterrupt:
        print('demo stopped')
        return 130


if __name__ == '__main__':
    sys.exit(main())
