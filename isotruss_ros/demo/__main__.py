"""Executable `demo`: see the robot move an object, and how well, in half a minute."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys

from isotruss_ros.core import GraspCode, IsotrussError, load_robot, Status
from isotruss_ros.demo.client import DemoClient, PhaseRecord
from isotruss_ros.demo.figures import animate, draw_panels
from isotruss_ros.demo.path import figure_9
from isotruss_ros.demo.processes import keep_to_this_machine, running_nodes
from isotruss_ros.demo.tables import grasp_table, motion_table
import numpy as np
import rclpy
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

ROBOT = 'nine_member'
GRIP_MODULE = 'north/Z'
OBJECT_DIAMETER = 0.3
#: So much nearer to the corner than where it just touches is the object, and pressed on [m].
SQUEEZE = 0.01
#: The object is to end this close to where the commands put it.
MAX_POSITION_ERROR = 1e-3
MAX_ANGLE_ERROR = np.deg2rad(0.1)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the nodes, play the path, print the table, draw the figures."""
    parser = argparse.ArgumentParser(prog='demo', description=__doc__)
    parser.add_argument(
        '--output', type=Path, default=Path('demo_output'), help='folder for pictures and logs'
    )
    parser.add_argument('--rate', type=float, default=200.0, help='of the nodes [Hz]')
    # ros2 launch and friends append arguments of their own.
    options, _ = parser.parse_known_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    console = Console()
    try:
        start, records = _play(options.output, options.rate, console)
    except IsotrussError as error:
        console.print(f'demo failed: {error}', style='red', markup=False)
        return 1
    except KeyboardInterrupt:
        console.print('demo stopped')
        return 130
    console.print(motion_table(records))
    console.print(grasp_table([start, *records]))
    robot = load_robot(ROBOT)
    with console.status('drawing'):
        draw_panels(robot, OBJECT_DIAMETER, [start, *records], options.output / 'demo.png')
        animate(robot, OBJECT_DIAMETER, records, options.output / 'demo.gif')
    console.print(f'written: {options.output / "demo.png"}, {options.output / "demo.gif"}')
    return _verdict(records, console)


def _play(output: Path, rate: float, console: Console) -> tuple[PhaseRecord, list[PhaseRecord]]:
    """Run the nodes as processes and the path through them."""
    domain = keep_to_this_machine()
    shared = {'robot': ROBOT, 'object_diameter': OBJECT_DIAMETER}
    moving = shared | {'grip_module': GRIP_MODULE, 'rate': rate}
    started = [
        ('simulator', moving | {'squeeze': SQUEEZE}),
        ('manipulation', moving),
        ('grasp_analysis', shared),
    ]
    names = ', '.join(name for name, _ in started)
    console.print(f'nodes {names}; ROS_DOMAIN_ID={domain}, this machine only')
    rclpy.init()
    client = DemoClient(load_robot(ROBOT).roller_names)
    try:
        with running_nodes(started, output) as nodes:

            def check() -> None:
                for node in nodes:
                    node.require_running()

            start = client.wait_until_ready(check)
            columns = (TextColumn('{task.description:15}'), BarColumn(), TimeElapsedColumn())
            records = []
            with Progress(*columns, console=console) as progress:
                for phase in figure_9():
                    task = progress.add_task(phase.name, total=1.0)
                    record = client.play(
                        phase, check, lambda done, task=task: progress.update(task, completed=done)
                    )
                    records.append(record)
            return start, records
    finally:
        client.destroy_node()
        rclpy.shutdown()


def _verdict(records: Sequence[PhaseRecord], console: Console) -> int:
    code = 0
    for record in records:
        odd = {str(status) for status in record.statuses - {Status.OK, Status.IDLE}}
        codes = {GraspCode(grasp.code) for grasp in record.grasps}
        odd |= {f'grasp: {code}' for code in codes - {GraspCode.OK}}
        if odd:
            console.print(f'{record.name}: {", ".join(sorted(odd))}', style='yellow')
        if record.position_error > MAX_POSITION_ERROR or record.angle_error > MAX_ANGLE_ERROR:
            console.print(
                f'{record.name}: the error is larger than 1 mm or 0.1 degrees', style='red'
            )
            code = 1
    return code


if __name__ == '__main__':
    sys.exit(main())
