# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Length of the call paths of a twist, closure, a settled grasp and the flag `held`.

The table has five calls: one control cycle of `TwistServo.decide` with fresh inputs of a
moving robot; one cycle of the node `manipulation`, from the messages to the command; one
`analyze_grasp`, which computes closure by (10); one `settle_grasp`; and one `GraspMonitor.report`
after robot and object have moved, which includes `settle_grasp`. `sys.setprofile` counts the
called files of the package, the moves (calls and returns between two of these files), and the
calls of Python and C functions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
import sys
from types import FrameType
from typing import NamedTuple

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
#: Information of the middleware about a message whose publisher numbers nothing.
UNNUMBERED = {'publication_sequence_number': None}


class Walk(NamedTuple):
    """
    Path of a call through the package.

    :ivar files: files of the package whose functions are called.
    :ivar moves: number of calls and returns between two of these files.
    :ivar calls: number of calls of Python and C functions, also of other packages.
    """

    files: list[str]
    moves: int
    calls: int


def trace(call: Callable[[], object]) -> Walk:
    """
    Return the path of a call through the package.

    :param call: function to trace.
    """
    files: set[str] = set()
    current, moves, calls = '', 0, 0

    def note(frame: FrameType, event: str, _argument: object) -> None:
        nonlocal current, moves, calls
        calls += event in ('call', 'c_call')
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
    names = sorted(str(Path(file).relative_to(PACKAGE)) for file in files)
    return Walk(names, moves - 1, calls - 1)


def control_cycle() -> Walk:
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
    return min(paths[-5:], key=lambda walk: walk.moves)


def node_tick() -> Walk:
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
        received = [partial(take[topic], message, UNNUMBERED) for topic, message in given.items()]
        paths.append(trace(lambda calls=received: [call() for call in (*calls, node.cycle.run)]))
    assert node.details()['status'] == core.Status.OK.name, node.details()
    rclpy.shutdown()
    return min(paths[-5:], key=lambda walk: walk.moves)


def closure() -> Walk:
    """Trace one analysis of a grasp in a new configuration."""
    core.analyze_grasp(ROBOT.home, PRESSED)
    config = ROBOT.configuration(np.full(len(ROBOT.roller_names), 1e-5))
    return trace(lambda: core.analyze_grasp(config, PRESSED))


def analysis_cycle() -> Walk:
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


def walks() -> dict[str, Walk]:
    """Return the walks by the name of their call."""
    # A third call has all caches.
    settled = [trace(lambda: core.settle_grasp(ROBOT.home, PRESSED)) for _ in range(3)]
    return {
        'twist to roller command': control_cycle(),
        'tick of the node: twist': node_tick(),
        'closure by (10)': closure(),
        'settle_grasp': settled[-1],
        'flag of the node: held': analysis_cycle(),
    }


def tables() -> Iterator[Table]:
    """Yield the table of the case."""
    rows = [
        (name, f'{len(walk.files)}', f'{walk.moves}', f'{walk.calls}', ', '.join(walk.files))
        for name, walk in walks().items()
    ]
    yield Table('', ('walk', 'files', 'moves', 'calls', 'the files'), rows)
