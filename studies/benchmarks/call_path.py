# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Length of the call paths of a twist, closure and the flag `held`, in files and moves.

The first table has four calls: one control cycle of `TwistServo.decide` with fresh inputs of a
moving robot; one cycle of the node `manipulation`, from the messages to the command; one
`analyze_grasp`, which computes closure by (10); and one `GraspMonitor.report` after robot and
object have moved, which includes `settle_grasp`. `sys.setprofile` counts the called files of the
package, and the moves: calls and returns between two of these files. The second table has the
number of files that the parts of the core import, directly or indirectly, and their lines. Each
row includes the rows before it.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
import sys
from types import FrameType

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
import isotruss_ros
from isotruss_ros import core
from isotruss_ros.core.inputs import LatestInputs, RollerState, StampedInput
from isotruss_ros.core.safety.roller_failure import FAILURE_TIME
from isotruss_ros.core.servo.servo_settings import ServoSettings
from isotruss_ros.nodes.conversions import messages
from isotruss_ros.nodes.grasp.grasp_monitor import GraspMonitor
from isotruss_ros.nodes.grasp.grasp_report import GraspCode, GraspQuery
from isotruss_ros.nodes.manipulation.node import Manipulation
import numpy as np
import rclpy
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from studies.benchmarks.measuring import Table

PACKAGE = str(Path(isotruss_ros.__file__).parent)
MODULE, DIAMETER, PERIOD, TWIST = 'east/Q', 0.3, 0.005, (0.02, 0.03, 0.1)
ROBOT = core.load_robot('nine_member')
#: Object pressed into the corner at the module.
PRESSED = core.ConvexObject.disc(
    core.tangent_center(ROBOT.home, MODULE, DIAMETER, 0.002), DIAMETER
)
#: Number of cycles after which the rollers have accelerated to the twist [-].
CYCLES = 60

#: First modules of the rows in the second table, below `isotruss_ros.core`.
PARTS = {
    'twist': ('manipulation.solve_twist',),
    '+ analysis': ('fixed_object.analyze_grasp',),
    '+ equilibrium': ('holding.settle_grasp',),
    '+ safety': ('safety.shape_guard', 'safety.roller_failure'),
    '+ servo': ('servo.twist_servo',),
    '+ paths': ('paths.path_servo', 'paths.roller_trajectory'),
    '+ estimator': ('estimation.state_estimator',),
    '+ planner': ('planning.plan_grasps',),
}


def trace(call: Callable[[], object]) -> tuple[list[str], int]:
    """
    Return the files of the package on a call path, and the moves between them.

    :param call: function to trace.
    """
    files: set[str] = set()
    current, moves = '', 0

    def note(frame: FrameType, event: str, _argument: object) -> None:
        nonlocal current, moves
        file = frame.f_code.co_filename
        if not file.startswith(PACKAGE) or event not in ('call', 'return'):
            return
        if event == 'return':
            caller = frame.f_back
            while caller is not None and not caller.f_code.co_filename.startswith(PACKAGE):
                caller = caller.f_back
            if caller is None:
                return
            file = caller.f_code.co_filename
        files.add(file)
        moves += file != current
        current = file

    sys.setprofile(note)
    try:
        call()
    finally:
        sys.setprofile(None)
    return sorted(str(Path(file).relative_to(PACKAGE)) for file in files), moves - 1


def control_cycle() -> tuple[list[str], int]:
    """Trace the shortest of the last cycles of the twist servo."""
    center = core.tangent_center(ROBOT.home, MODULE, DIAMETER)
    grip = core.Grip.at_module(ROBOT, MODULE, core.ConvexObject.disc(center, DIAMETER))
    servo = core.TwistServo(ROBOT, ServoSettings(grip, PERIOD, 0.2, failure_time=FAILURE_TIME))
    held = core.RollingGrip.attach(ROBOT.home, grip)
    positions = held.config.roller_positions
    now, paths = 0.0, []
    for _ in range(CYCLES):
        found = []
        servo.receive(
            twist=StampedInput(TWIST, now),
            rollers=StampedInput(RollerState(positions, np.zeros(len(positions))), now - 0.002),
        )
        held = held.moved_to(ROBOT.configuration(positions))
        servo.receive(pose=StampedInput(held.pose, now - 0.002))
        paths.append(trace(lambda now=now, found=found: found.append(servo.decide(now))))
        positions = positions + PERIOD * found[0].command.roller_velocities
        now += PERIOD
    assert found[0].command.status is core.Status.OK, found[0].message
    # By rounding, a cycle may meet a configuration that a cache has, and compare them.
    return min(paths[-5:], key=lambda path: path[1])


def node_tick() -> tuple[list[str], int]:
    """Trace the shortest of the last ticks of `manipulation`, each with fresh messages."""
    rclpy.init()
    # In simulated time, the inputs are as old on a busy machine as on an idle one.
    values = {'grip_module': MODULE, 'use_sim_time': True}
    node = Manipulation([Parameter(name, value=value) for name, value in values.items()])
    take = {each.topic_name.strip('/'): each.callback for each in node.subscriptions}
    paths = []
    for step in range(CYCLES):
        take['clock'](Clock(clock=Time(nanosec=10_000_000 * (step + 1))))
        header, travel = messages.make_header(node.now(), ROBOT.frame), 1e-6 * step
        pose = messages.to_pose_message(PRESSED.pose._replace(y=PRESSED.pose.y - 0.002 + travel))
        rollers = JointState(header=header, name=ROBOT.roller_names, position=[travel] * 6)
        given = {
            'cmd_vel': messages.to_twist_message(TWIST),
            'joint_states': rollers,
            'object_pose': PoseStamped(header=header, pose=pose),
        }
        received = [partial(take[topic], message) for topic, message in given.items()]
        paths.append(trace(lambda calls=received: [call() for call in (*calls, node.cycle.run)]))
    assert node.details()['status'] == core.Status.OK.name, node.details()
    rclpy.shutdown()
    return min(paths[-5:], key=lambda path: path[1])


def closure() -> tuple[list[str], int]:
    """Trace one analysis of a grasp in a new configuration."""
    core.analyze_grasp(ROBOT.home, PRESSED)
    config = ROBOT.configuration(np.full(len(ROBOT.roller_names), 1e-5))
    return trace(lambda: core.analyze_grasp(config, PRESSED))


def analysis_cycle() -> tuple[list[str], int]:
    """Trace one analysis of the grasp monitor, after some cycles that are not traced."""
    query = GraspQuery((), PRESSED, 0.5, (0.0, 0.0, 0.0), 0.005)
    monitor = GraspMonitor(ROBOT, query, 0.5, LatestInputs())
    for step in range(5):
        positions = np.full(len(ROBOT.roller_names), 1e-5 * step)
        monitor.inputs.rollers = StampedInput(RollerState(positions, 0.0 * positions), float(step))
        pose = PRESSED.pose._replace(y=PRESSED.pose.y - 1e-5 * step)
        monitor.inputs.pose = StampedInput(pose, float(step))
        traced = trace(lambda step=step: monitor.report(float(step)))
    assert monitor.report(4.0).code is GraspCode.OK
    return traced


def import_closure(modules: Iterable[str]) -> set[Path]:
    """
    Return the files of modules and of their direct and indirect imports.

    :param modules: names of modules below `isotruss_ros.core`.
    """
    found: set[Path] = set()
    waiting = list(modules)
    while waiting:
        path = Path(PACKAGE, 'core', *waiting.pop().split('.')).with_suffix('.py')
        if path in found or not path.is_file():
            continue
        found.add(path)
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if isinstance(node, ast.ImportFrom) and 'isotruss_ros.core.' in (node.module or ''):
                inside = node.module.removeprefix('isotruss_ros.core.')
                waiting += [inside, *(f'{inside}.{alias.name}' for alias in node.names)]
    return found


def part_rows() -> list[tuple[str, ...]]:
    """Return the rows of the second table."""
    rows, modules = [], []
    for name, own in PARTS.items():
        modules += own
        files = import_closure(modules)
        lines = sum(len(path.read_text(encoding='utf-8').splitlines()) for path in files)
        rows.append((name, f'{len(files)}', f'{lines}'))
    return rows


def tables() -> Iterator[Table]:
    """Yield the tables of the case."""
    walks = {
        'twist to roller command': control_cycle(),
        'tick of the node: twist': node_tick(),
        'closure by (10)': closure(),
        'flag of the node: held': analysis_cycle(),
    }
    rows = [(name, f'{len(w)}', f'{moves}', ', '.join(w)) for name, (w, moves) in walks.items()]
    yield Table('', ('walk', 'files', 'moves', 'the files'), rows)
    yield Table('', ('imports of', 'files', 'lines'), part_rows())
