# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demonstration without middleware: its path, its grasp and its pictures."""

from functools import partial
import math
import signal
import subprocess
from types import SimpleNamespace

from geometry_msgs.msg import Point
from isotruss_msgs.msg import GraspState, PlannedGrasp, StateEstimate
from isotruss_ros.core import load_robot, Pose
from isotruss_ros.demo import processes, view
from isotruss_ros.demo.figures import animate, draw_panels, FRAMES_PER_SECOND, SPEED_UP
from isotruss_ros.demo.gripping import slow_down
from isotruss_ros.demo.record import PhaseRecord, Snapshot
from isotruss_ros.demo.run import OBJECT_CENTER, OBJECT_DIAMETER, PULL
from isotruss_ros.demo.sensors import truth_table
from isotruss_ros.demo.verdict import print_verdict
from isotruss_ros.nodes.conversions.path_messages import read_duration, to_trajectory_message
import numpy as np
from PIL import Image
import pytest
from rich.console import Console

ROBOT = load_robot('nine_member')


def test_pictures_are_written(tmp_path):
    (x, y), still = OBJECT_CENTER, np.zeros(6)
    up = [Snapshot(0.4 * i, still, Pose(x, y + 0.01 * i, 0.0)) for i in range(8)]
    turn = [Snapshot(3.2 + 0.4 * i, still, Pose(x, y + 0.08, 0.1 * i)) for i in range(8)]
    records = [
        PhaseRecord('start', snapshots=up[:1]),
        PhaseRecord('up', snapshots=up),
        PhaseRecord('turn', snapshots=turn, pull=PULL, pulled=(3.2, 4.2)),
    ]
    draw_panels(ROBOT, OBJECT_DIAMETER, records, tmp_path / 'demo.png')
    with Image.open(tmp_path / 'demo.png') as picture:
        pixels = np.asarray(picture.convert('L'))
        for half in np.array_split(pixels, 2):
            for quarter in np.array_split(half, 2, axis=1):
                assert quarter.std() > 10.0, 'a blank panel'
    animate(ROBOT, OBJECT_DIAMETER, records[1:2], tmp_path / 'demo.gif')
    with Image.open(tmp_path / 'demo.gif') as animation:
        assert animation.n_frames == math.ceil(FRAMES_PER_SECOND * up[-1].time / SPEED_UP)


def test_a_slower_path_to_a_grasp_touches_at_the_same_point():
    path = to_trajectory_message(ROBOT, [[0.0] * 6, [0.01] * 6, [0.02] * 6], [0.0, 0.7, 1.9])
    grasp = PlannedGrasp(path=path, touch=path.points[1].time_from_start)
    slow_down(grasp, 2.5)
    times = [read_duration(point.time_from_start) for point in path.points]
    assert times == pytest.approx([0.0, 1.75, 4.75], abs=1e-9)
    assert path.points[1].time_from_start == grasp.touch


@pytest.fixture
def started(monkeypatch):
    """Return the commands of processes by the name of the node; they end at once."""
    commands = {}

    def start(command, **_):
        commands[command[3]] = command
        return SimpleNamespace(poll=lambda: 0, wait=lambda _: 0, returncode=0)

    monkeypatch.setattr(subprocess, 'Popen', start)
    return commands


def test_an_interrupt_ends_a_program_at_the_next_check():
    steps = []

    def convert():
        with processes.deferred_interrupts() as check:
            signal.raise_signal(signal.SIGINT)
            steps.append('converted')
            check()
            steps.append('published')

    with pytest.raises(KeyboardInterrupt):
        convert()
    assert steps == ['converted']


@pytest.mark.usefixtures('started')
def test_a_printed_line_is_read_once_it_is_complete(tmp_path):
    node = processes.NodeProcess('viewer', {}, tmp_path / 'log')
    node.log.write_text('viewer: message ignored\nviewer: http://127')
    assert node.find_line('viewer: http') is None
    node.log.write_text('viewer: message ignored\nviewer: http://127.0.0.1:8080\nmore')
    assert node.find_line('viewer: http') == 'viewer: http://127.0.0.1:8080'


def test_the_table_of_the_truth_has_the_errors_of_squeeze_joints_and_pose():
    rollers = np.full(len(ROBOT.roller_names), 0.01)
    joints = ROBOT.configuration(rollers).nodes[: len(ROBOT.topology.joint_names)].copy()
    joints[2] += (0.003, 0.004)
    places = [Point(x=x, y=y) for x, y in joints.tolist()]
    places[1].x += 0.001
    record = PhaseRecord(
        'up',
        accepted=np.array([0.1, 0.2, 0.3]),
        measured=np.array([0.1, 0.202, 0.3 + np.radians(1.5)]),
        snapshots=[Snapshot(1.0, rollers, None)],
        pose_times=[1.0, 2.0, 3.0, 4.0],
        forces={1.0: [19.0, 21.0], 2.0: [14.0], 3.1: [25.0], 4.0: [22.0]},
        joints=[joints],
        estimates=[
            StateEstimate(
                joints=places,
                held=True,
                squeeze=21.0,
                travel=(rollers + 0.002).tolist(),
                offsets=[0.002] * len(rollers),
            )
        ],
    )
    table = truth_table([record], ROBOT, 20.0)
    cells = [next(iter(column.cells)) for column in table.columns]
    assert cells == ['up', '+10', '-30', '-5', '1.0', '5.0', '2.0', '1.50']


def test_a_verdict_of_an_object_not_held_names_the_rate_of_a_starved_loop(capsys):
    state = partial(GraspState, code=GraspState.OK)
    grasps = [state(held=GraspState.HELD_YES), state(held=GraspState.HELD_UNKNOWN)]
    record = PhaseRecord('arc', grasps=grasps, lowest_rate=21.3)
    assert print_verdict([record], False, 100.0, Console(width=200)) == 1
    assert capsys.readouterr().out.splitlines() == [
        'arc: the object was held in only 50.0 % of the analyses; '
        'the loop reached only 21 of 100 Hz in its slowest second'
    ]


@pytest.mark.parametrize(
    ('measured', 'commanded', 'code', 'words'),
    [
        (0.9e-3, 0.0, 0, ''),
        (1.1e-3, 0.0, 1, 'up: the error is larger than 1 mm'),
        (0.0, 5e-3, 0, 'up: limits shortened the motion by 5.0 mm'),
    ],
)
def test_a_verdict_fails_beyond_the_bound_of_the_error_and_not_for_a_limit(
    measured, commanded, code, words, capsys
):
    grasps = [GraspState(code=GraspState.OK, held=GraspState.HELD_YES)]
    record = PhaseRecord('up', grasps=grasps, lowest_rate=100.0)
    record.measured[0], record.commanded[0] = measured, commanded
    assert print_verdict([record], False, 100.0, Console(width=200)) == code
    printed = capsys.readouterr().out
    assert printed.startswith(words)
    assert bool(printed) == bool(words)


def test_an_object_of_another_shape_is_passed_to_all_nodes_of_a_view(
    started, monkeypatch, tmp_path
):
    monkeypatch.setattr(signal, 'signal', lambda *_: None)
    assert view.main(['--object', str(tmp_path / 'box.yaml')]) == 1
    shown = {name for name, command in started.items() if 'box.yaml' in ' '.join(command)}
    assert shown == started.keys() - {'grasp_planner'}
    assert 'viewer' in shown
