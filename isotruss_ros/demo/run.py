# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Demonstration: a grasp is planned and closed; the object is carried, and a force acts on it."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
import time

from isotruss_msgs.action import PlanGrasp
from isotruss_ros.core import IsotrussError, load_robot
from isotruss_ros.demo import REAL
from isotruss_ros.demo.client import DemoClient
from isotruss_ros.demo.figures import animate, draw_panels
from isotruss_ros.demo.film import film
from isotruss_ros.demo.gripping import Gripping, slow_down
from isotruss_ros.demo.path import figure_9
from isotruss_ros.demo.processes import (
    deferred_interrupts,
    handle_stops,
    keep_to_this_machine,
    running_nodes,
)
from isotruss_ros.demo.record import PhaseRecord
from isotruss_ros.demo.sensors import REAL_SENSORS, truth_table
from isotruss_ros.demo.tables import contact_table, grasp_table, motion_table, plan_table
from isotruss_ros.demo.verdict import print_verdict
from isotruss_ros.mujoco_plant.options import write_round_robot
from isotruss_ros.mujoco_plant.rendering import require_egl
from isotruss_ros.nodes.framework.command_line import start_ros
from isotruss_ros.viewer.names import MUJOCO
import rclpy
from rclpy.signals import SignalHandlerOptions
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

ROBOT = 'nine_member'
OBJECT_DIAMETER = 0.2
#: Initial position of the free object, inside the tube `north` [m].
OBJECT_CENTER = (0.6, 0.3)
#: Module whose members grasp the object. Its roller is driven, so the robot can roll the object.
GRIP_MODULE = 'north/Z'
FRICTION = 0.5
#: Normal force of each of the two members [N], with which friction resists the external force. Its
#: grasp uses 76 % of the wrinkling moment of a tube.
SQUEEZE = 22.0
#: Value in place of `SQUEEZE` with simulated sensor faults, without external force [N]. With 22 N
#: three of five robots with random roller offsets of 10 mm exceed 80 % of the wrinkling moment;
#: with 18 N, five use 60 to 73 %.
REAL_SQUEEZE = 18.0
#: Factor by which the path to the grasp is slowed for a robot with masses [-]. At full speed one
#: member would hit the object before the other one.
SLOWDOWN_FACTOR = 2.0
#: Friction force of the ground on the free object in the plant mujoco [N].
GROUND_FRICTION = 0.5
#: Name of the file with the recorded states of MuJoCo, from which the animation is drawn.
RECORDING = 'plant.recording'
#: External force on the object in the middle of the arc, directed out of the grip [N], and mass of
#: the object [kg].
LOAD, OBJECT_MASS = 5.0, 0.5
PULL = (0.0, -LOAD, 0.0)
#: Largest age of the inputs of the nodes [s]. It is longer than the default because processes
#: pause on a busy machine. A third less aborts the path to the grasp after a pause of 1.01 s; with
#: 3 s the pose predicted after 1.7 s without measurements left the contacts.
INPUT_TIMEOUT = 1.5
#: Time after the last command at which the simulated rollers stop [s].
COMMAND_TIMEOUT = 1.0
#: Rate of grasp analyses [Hz]. Each takes 20 to 40 ms on a core that the control loop needs too.
ANALYSIS_RATE = 5.0

#: Usual durations of the steps on two free cores [s].
USUAL_DURATIONS = {
    'start nodes': 5,
    'plan a grasp': 10,
    'approach and grip': 13,
    'up': 7,
    'turn in place': 8,
    'arc': 16,
    'draw': 10,
}
#: Period of the lines with the progress of a step where the output is no terminal [s].
LINE_PERIOD = 5.0


class Steps:
    """Progress of the steps of the demonstration: bars in a terminal, otherwise lines."""

    def __init__(self, console: Console) -> None:
        self._console = console
        columns = (TextColumn('{task.description:34}'), BarColumn(), TimeElapsedColumn())
        self._bars = Progress(*columns, console=console)

    def __enter__(self) -> Steps:
        """Begin to show bars."""
        if self._console.is_terminal:
            self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the bars as they are."""
        if self._console.is_terminal:
            self._bars.stop()

    def begin(self, name: str) -> Callable[[float], None]:
        """Return a function that shows the completed fraction of a step [-]."""
        usual, start = f'usually {USUAL_DURATIONS[name]} s', time.monotonic()
        task = self._bars.add_task(f'{name} ({usual})', total=1.0)
        shown, ended = -LINE_PERIOD, False

        def show(done: float) -> None:
            nonlocal shown, ended
            self._bars.update(task, completed=done)
            passed = time.monotonic() - start
            if ended or self._console.is_terminal:
                return
            if done >= 1.0 or passed - shown >= LINE_PERIOD:
                shown, ended = passed, done >= 1.0
                self._console.print(f'{name}: {100.0 * done:.0f} % after {passed:.0f} s, {usual}')

        show(0.0)
        return show


def run(options: argparse.Namespace, ros_arguments: Sequence[str]) -> int:
    """
    Run the demonstration, print tables and draw figures.

    :param ros_arguments: further arguments of the nodes, which begin with `--ros-args`.
    :return: 0 if the object was held and reached its targets, else 1.
    """
    options.output.mkdir(parents=True, exist_ok=True)
    console, round_tubes = Console(), options.plant == MUJOCO
    handle_stops()
    try:
        if round_tubes:
            require_egl()
        file = str(write_round_robot(ROBOT, options.output)) if round_tubes else ROBOT
        # An interrupt within rclpy would end in an error of a conversion.
        with deferred_interrupts() as check:
            records, plan = _play(options, file, ros_arguments, console, check)
    except IsotrussError as error:
        console.print(f'demo failed: {error}', style='red', markup=False)
        return 1
    moved = records[3:]
    console.print(plan_table(plan))
    console.print(motion_table(moved))
    robot = load_robot(file)
    if options.sensors == REAL:
        console.print(truth_table(moved, robot, REAL_SQUEEZE))
    else:
        console.print(grasp_table([part for record in records[2:] for part in record.parts()]))
        if not round_tubes:
            console.print(contact_table(records[2:]))
    with Steps(console) as steps:
        show = steps.begin('draw')
        shown = [record for record in records if record.name != 'approach']
        picture = options.output / 'demo.png'
        draw_panels(robot, OBJECT_DIAMETER, shown, picture)
        if round_tubes:
            film(options.output / RECORDING, records[1:], options.output / 'demo.gif')
        else:
            animate(robot, OBJECT_DIAMETER, records[1:], options.output / 'demo.gif')
        show(1.0)
    console.print(f'written: {options.output / "demo.png"}, {options.output / "demo.gif"}')
    return print_verdict(moved, options.sensors == REAL, options.rate, console)


def _play(
    options: argparse.Namespace,
    robot: str,
    ros_arguments: Sequence[str],
    console: Console,
    check_interrupts: Callable[[], None],
) -> tuple[list[PhaseRecord], PlanGrasp.Result]:
    """Run the nodes as processes, plan and reach a grasp, and follow the path."""
    domain = keep_to_this_machine()
    output, rate, plant = options.output, options.rate, options.plant
    # A machine that is too slow for MuJoCo takes longer, and nothing lags.
    simulated = plant == MUJOCO
    common = {'robot': robot, 'command_timeout': INPUT_TIMEOUT, 'use_sim_time': simulated}
    shared = common | {'object_diameter': OBJECT_DIAMETER, 'friction': FRICTION}
    gripping = shared | {'grip_module': GRIP_MODULE, 'rate': rate}
    x, y = OBJECT_CENTER
    lying = {'plant': plant, 'object_is_free': True, 'object_pose': [x, y, 0.0]}
    lying |= {'command_timeout': COMMAND_TIMEOUT}
    # With noise, a loop that expects loads takes errors of a millimetre for some newtons.
    real = options.sensors == REAL
    pull = None if real else PULL
    squeeze = REAL_SQUEEZE if real else SQUEEZE
    regulated = {'squeeze_force': squeeze, 'object_mass': OBJECT_MASS}
    if not real:
        regulated['expected_load'] = LOAD
    if simulated:
        lying |= {'ground_friction': GROUND_FRICTION, 'clock_speed': options.clock_speed}
        lying['recording'] = str(output.resolve() / RECORDING)
    started = [
        ('simulator', gripping | lying | (REAL_SENSORS if real else {})),
        ('manipulation', gripping | regulated),
        ('grasp_analysis', shared | {'rate': ANALYSIS_RATE}),
        ('grasp_planner', common),
    ]
    if real:
        held = {'object_diameter': OBJECT_DIAMETER, 'grip_module': GRIP_MODULE}
        started.append(('state_estimator', common | held))
    names = ', '.join(name for name, _ in started)
    console.print(f'nodes {names}; ROS_DOMAIN_ID={domain}, this machine only')
    # Those of rclpy would close the context before the nodes are stopped.
    start_ros(ros_arguments, SignalHandlerOptions.NO)
    client = None
    try:
        client = DemoClient(load_robot(ROBOT).roller_names, simulated, real)
        with running_nodes(started, output, ros_arguments) as nodes:

            def check() -> None:
                check_interrupts()
                for node in nodes:
                    node.require_running()
                client.require_alone()

            gripper = Gripping(client, check)
            with Steps(console) as steps:
                records = [gripper.wait_until_ready(steps.begin('start nodes'), real)]
                goal = PlanGrasp.Goal(
                    object_diameter=OBJECT_DIAMETER,
                    module=GRIP_MODULE,
                    friction=FRICTION,
                    squeeze=squeeze,
                    count=3,
                )
                grasp, plan = gripper.plan(goal, steps.begin('plan a grasp'))
                if simulated:
                    slow_down(grasp, SLOWDOWN_FACTOR)
                records += gripper.approach(grasp, steps.begin('approach and grip'))
                client.wait_for_rest(check, 'a manipulation that is ready')
                for phase in figure_9(pull):
                    records.append(client.play(phase, check, steps.begin(phase.name)))
            return records, plan
    finally:
        if client is not None:
            client.destroy_node()
        rclpy.try_shutdown()
