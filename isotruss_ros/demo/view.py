# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Executable `view`, which runs a simulated robot and a viewer, and prints its address."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys
import tempfile
import time
from typing import Any

from isotruss_ros import core
from isotruss_ros.core.errors import IsotrussError
from isotruss_ros.demo.processes import (
    handle_stops,
    keep_to_this_machine,
    parse_arguments,
    running_nodes,
)
from isotruss_ros.mujoco_plant.options import write_round_robot
from isotruss_ros.viewer.names import ELASTIC, MUJOCO, PLANTS

#: Robot of the view, unless another one is given.
ROBOT = 'nine_member'
DIAMETER = 0.3
#: Initial indentation of each grasping tube by the object, which gives the squeeze [m].
INDENTATION = 0.005
#: Coefficient of friction [-]; a grip in a corner of 60 degrees needs at least 0.58.
FRICTION = 0.8
#: Friction force of the ground on a free object in the plant mujoco, which brings it to rest [N].
GROUND_FRICTION = 0.5
RATE = 50.0
#: Period of the check that all processes run [s].
PERIOD = 0.2


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Run a simulated robot and a viewer until Ctrl-C.

    :return: 0 after Ctrl-C, 1 if a node has ended.
    """
    parser = argparse.ArgumentParser(prog='isotruss view', description=__doc__)
    parser.add_argument('--robot', default=ROBOT, help='name of a preset, or path of a robot file')
    parser.add_argument('--plant', choices=PLANTS, default=ELASTIC, help='simulated plant')
    parser.add_argument('--port', type=int, default=8080, help='port of the viewer')
    parser.add_argument('--object', type=Path, help='YAML file of an object')
    parser.add_argument('--obstacles', type=Path, help='YAML file of obstacles at rest')
    parser.add_argument(
        '--browser-timeout',
        type=float,
        default=0.5,
        help='time without a drawn picture after which a page loses control [s]',
    )
    options, ros_arguments = parse_arguments(parser, arguments)
    import rclpy  # noqa: F401 - if it is missing, the nodes are not started

    shown: dict[str, Any] = {'object_diameter': DIAMETER, 'friction': FRICTION}
    room: dict[str, Any] = {}
    try:
        source = core.load_robot(options.robot).description.source
        shown['robot'] = str(Path(source).resolve())
        if options.object is not None:
            core.read_object(options.object)
            shown['object'] = str(options.object.resolve())
        if options.obstacles is not None:
            core.read_obstacles(options.obstacles)
            room['obstacles'] = str(options.obstacles.resolve())
    except IsotrussError as error:
        parser.error(str(error))
    domain = keep_to_this_machine()
    page = {'port': options.port, 'browser_timeout': options.browser_timeout}
    print(f'plant {options.plant}; ROS_DOMAIN_ID={domain}, this machine only; Ctrl-C ends it')
    handle_stops()
    try:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            if options.plant == MUJOCO:
                # The tubes of the analysis are those of the plant.
                shown['robot'] = str(write_round_robot(source, folder))
            nodes = [*list_nodes(options.plant, shown, room), ('viewer', shown | page | room)]
            return _run(nodes, folder, ros_arguments)
    except KeyboardInterrupt:
        return 0
    except IsotrussError as error:
        print(f'view failed: {error}', file=sys.stderr)
        return 1


def list_nodes(
    plant: str, shown: dict[str, Any], room: dict[str, Any] | None = None
) -> list[tuple[str, dict[str, Any]]]:
    """
    Return name and parameters of the nodes beside the viewer, for an object to be shown.

    :param room: parameter `obstacles` of the nodes that keep clear of them; None: no obstacles.
    """
    room = room or {}
    timeout = {'command_timeout': 1.0}
    common = shown | timeout | {'rate': RATE}
    start = {'plant': plant, 'indentation': INDENTATION, 'ground_friction': GROUND_FRICTION}
    return [
        ('simulator', common | start | room),
        ('manipulation', common | {'object_mass': 0.5} | room),
        ('grasp_analysis', common | {'rate': 20.0}),
        ('path_follower', shown | timeout | room),
        ('grasp_planner', {'robot': shown.get('robot', ROBOT)} | timeout | room),
        ('pick_and_place', shown | timeout | room),
    ]


def _run(
    nodes: Sequence[tuple[str, dict[str, object]]], folder: Path, ros_arguments: Sequence[str]
) -> int:
    with running_nodes(nodes, folder, ros_arguments) as processes:
        address = None
        while True:
            for process in processes:
                process.require_running()
            if address is None and (address := processes[-1].find_line('viewer: http')):
                print(address, flush=True)
            time.sleep(PERIOD)


if __name__ == '__main__':
    sys.exit(main())
