# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demonstration: its pictures, processes, verdict and node, and locks of domains."""

import contextlib
from functools import partial
import io
import itertools
import math
import os
import signal
import subprocess
import sys
import threading
from types import SimpleNamespace

from geometry_msgs.msg import Point, PoseStamped
from isotruss_msgs.action import PlanGrasp
from isotruss_msgs.msg import GraspState, ManipulationStatus, PlannedGrasp, StateEstimate
from isotruss_ros.core import load_robot, Pose, Status
from isotruss_ros.demo import domains, processes, view
from isotruss_ros.demo.client import DemoClient, DemoError, FINAL_HALTS, REST_TIME
from isotruss_ros.demo.gripping import find_unknown_offsets, Gripping, slow_down
from isotruss_ros.demo.record import PhaseRecord, Snapshot
from isotruss_ros.demo.run import Steps
from isotruss_ros.demo.sensors import truth_table
from isotruss_ros.demo.verdict import print_verdict
from isotruss_ros.mujoco_plant.options import RIGID_SECTION_STIFFNESS
from isotruss_ros.nodes.conversions.messages import make_header
from isotruss_ros.nodes.conversions.path_messages import read_duration, to_trajectory_message
from isotruss_ros.nodes.framework.topics import RELIABLE
import numpy as np
from probe import begin_context
import pytest
import rclpy
from rclpy.action import ActionServer
from rclpy.executors import SingleThreadedExecutor
from rich.console import Console
from sensor_msgs.msg import JointState

ROBOT = load_robot('nine_member')
TRIANGLE = load_robot('triangle')


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
def test_verdict_fails_for_an_error_not_for_a_limit(measured, commanded, code, words, capsys):
    grasps = [GraspState(code=GraspState.OK, held=GraspState.HELD_YES)]
    record = PhaseRecord('up', grasps=grasps, lowest_rate=100.0)
    record.measured[0], record.commanded[0] = measured, commanded
    assert print_verdict([record], False, 100.0, Console(width=200)) == code
    printed = capsys.readouterr().out
    assert printed.startswith(words)
    assert bool(printed) == bool(words)


def test_object_of_another_shape_is_passed_to_all_nodes_of_a_view(started, monkeypatch, tmp_path):
    handled = {}
    monkeypatch.setattr(signal, 'signal', handled.__setitem__)
    file = tmp_path / 'box.yaml'
    file.write_text('{shape: ellipse, semi_axes: [0.1, 0.15]}')
    assert view.main(['--object', str(file)]) == 1
    assert {signal.SIGTERM, signal.SIGHUP} <= handled.keys()  # as Ctrl-C, which ends the nodes
    shown = {name for name, command in started.items() if 'box.yaml' in ' '.join(command)}
    assert shown == started.keys() - {'grasp_planner'}
    assert 'viewer' in shown


def test_nodes_of_a_view_of_mujoco_analyse_with_tubes_that_do_not_flatten(monkeypatch):
    robots = {}

    @contextlib.contextmanager
    def run_nodes(nodes, *_):
        robots.update({name: load_robot(values['robot']) for name, values in nodes})
        raise KeyboardInterrupt
        yield

    monkeypatch.setattr(view, 'running_nodes', run_nodes)
    monkeypatch.setattr(signal, 'signal', lambda *_: None)
    assert view.main(['--plant', 'mujoco', '--robot', 'triangle']) == 0
    assert {'simulator', 'grasp_analysis', 'pick_and_place'} <= robots.keys()
    stiffness = {robot.description.local_stiffness for robot in robots.values()}
    assert stiffness == {RIGID_SECTION_STIFFNESS}
    assert {robot.roller_names for robot in robots.values()} == {TRIANGLE.roller_names}


@pytest.mark.parametrize(
    ('option', 'words'), [('--object', "'shape'"), ('--obstacles', "'post': key 'pose'")]
)
def test_view_refuses_an_invalid_file_before_it_starts_nodes(
    option, words, started, capsys, tmp_path
):
    file = tmp_path / 'file.yaml'
    file.write_text('post: {shape: disc, diameter: 0.1}')
    with pytest.raises(SystemExit, match='2'):
        view.main([option, str(file)])
    assert words in capsys.readouterr().err
    assert not started


@pytest.fixture
def other():
    begin_context()
    yield rclpy.create_node('other')
    rclpy.shutdown()


@pytest.fixture
def client(other):
    return DemoClient(TRIANGLE.roller_names)


def until(ready):
    return lambda: [] if ready() else ['the condition']


def test_rest_begins_anew_with_each_motion_of_object_or_rollers(client, other):
    poses = other.create_publisher(PoseStamped, 'object_pose', 10)
    joints = other.create_publisher(JointState, 'joint_states', 10)
    both = until(lambda: poses.get_subscription_count() and joints.get_subscription_count())
    client.wait(both, lambda: None, 'discovery')
    sent = JointState(name=TRIANGLE.roller_names, position=[0.0] * len(TRIANGLE.roller_names))
    known = until(lambda: client.rollers is not None)
    client.wait(known, lambda: None, 'rollers', 20.0, lambda: joints.publish(sent))
    record, rests = client.begin('rest'), []
    for count, x in enumerate([0.0] * 4 + [0.1] * 4):
        message = PoseStamped(header=make_header(1.0 + 0.6 * REST_TIME * count))
        message.pose.position.x, message.pose.orientation.w = x, 1.0
        poses.publish(message)
        received = until(lambda count=count: len(record.snapshots) > count)
        client.wait(received, lambda: None, 'a pose', 20.0)
        rests.append(not list(client.find_motion()))
    assert rests == [False, False, True, True, False, False, True, True]


def test_a_wait_that_fails_names_each_unmet_condition_with_value_and_bound(other):
    client = DemoClient(TRIANGLE.roller_names, truth=True)
    estimate = StateEstimate(
        roller_names=TRIANGLE.roller_names,
        offsets=[0.0] * 2,
        offset_covariance=[25e-6, 0.0, 0.0, 0.25e-6],
    )

    def find_unmet():
        yield from client.find_motion()
        yield from find_unknown_offsets([estimate])

    with pytest.raises(DemoError) as failed:
        client.wait(find_unmet, lambda: None, 'start', 0.1)
    assert 'no message of joint_states and truth/object_pose' in str(failed.value)
    (first, second) = TRIANGLE.roller_names
    assert f'roller {first} is 5 mm; must be at most 1 mm' in str(failed.value)
    assert second not in str(failed.value)


def test_steps_print_lines_from_their_begin_where_the_output_is_no_terminal():
    printed = io.StringIO()
    with Steps(Console(file=printed)) as steps:
        show = steps.begin('up')
        assert printed.getvalue() == 'up: 0 % after 0 s, usually 7 s\n'
        show(0.5)
        show(1.0)
        show(1.0)
    last = printed.getvalue().splitlines()[1:]
    assert len(last) == 1
    assert last[0].startswith('up: 100 % after ')


@pytest.fixture
def planner(other):
    """Return goals that a planner receives; it reports 43 %, and ends those for one grasp."""
    goals, shut = [], threading.Event()

    def search(handle):
        goals.append(handle.request)
        progress = PlanGrasp.Feedback(evaluations=120, found=1, progress=0.43)
        handle.publish_feedback(progress)
        if handle.request.count == 1:
            handle.succeed()
            path = to_trajectory_message(TRIANGLE, [[0.0] * 2], [0.0])
            return PlanGrasp.Result(grasps=[PlannedGrasp(path=path)])
        shut.wait()
        handle.abort()
        return PlanGrasp.Result()

    server = ActionServer(other, PlanGrasp, 'plan_grasp', search)
    executor = SingleThreadedExecutor()
    executor.add_node(other)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    yield goals
    shut.set()
    executor.shutdown()
    thread.join()
    server.destroy()


def prepare(client):
    """Return the first half of the demonstration, with a known pose and known rollers."""
    client.measured, client.rollers = Pose(0.0, 0.0, 0.0), np.zeros(2)
    return Gripping(client, lambda: None)


def test_the_best_grasp_at_the_time_limit_of_a_search_is_used(client, planner):
    grasp, _ = prepare(client).plan(PlanGrasp.Goal(count=1), lambda _: None)
    assert grasp.path.points
    assert 0.0 < planner[0].time_limit < math.inf


def test_a_search_that_does_not_end_states_how_far_it_is_and_the_load(
    planner, client, monkeypatch
):
    def pass_time(_):
        # A quarter of an hour passes from each look at the clock to the next.
        monkeypatch.setattr(client, '_seconds', itertools.count(0.0, 1e3).__next__)

    with pytest.raises(DemoError) as raised:
        prepare(client).plan(PlanGrasp.Goal(), pass_time)
    words = str(raised.value)
    assert 'the search is at 43 % after 120 evaluations, with 1 grasps' in words
    assert 'the machine has a load of' in words
    assert 'manipulation' not in words


@pytest.mark.parametrize('code', [*FINAL_HALTS, Status.HALT_STALE_JOINT_STATES])
def test_a_halt_that_does_not_end_by_itself_ends_the_wait_with_its_reason(client, other, code):
    statuses = other.create_publisher(ManipulationStatus, 'manipulation/status', RELIABLE)
    stamps = []

    def publish():
        stamps.append(0.1 * len(stamps))
        header = make_header(stamps[-1])
        statuses.publish(ManipulationStatus(header=header, code=code, message='1.01 s old'))

    ends = code in FINAL_HALTS
    expected = pytest.raises(DemoError, match=f'{code}: 1.01 s old')
    with expected if ends else contextlib.nullcontext():
        arrived = until(lambda: not ends and len(stamps) > 150)
        client.wait(arrived, lambda: None, 'arrival', 20.0, publish)


def test_sums_of_commanded_and_executed_twists_have_one_interval_and_lose_no_status(client, other):
    """Three seconds of statuses arrive while the client is suspended."""
    statuses = other.create_publisher(ManipulationStatus, 'manipulation/status', 1000)
    client.wait(until(statuses.get_subscription_count), lambda: None, 'discovery')
    times = 0.01 * np.arange(301)
    speeds = 0.02 * np.sin(np.pi * times / 3.0) ** 2
    scales = np.where(times < 1.0, 0.5, 1.0)
    for time, speed, scale in zip(times, speeds, scales, strict=True):
        message = ManipulationStatus(header=make_header(time), scale=float(scale))
        message.commanded.linear.x = float(speed)
        statuses.publish(message)
    record = client.begin('suspended')
    final = pytest.approx([0.03, 0.0, 0.0], abs=1e-9)
    client.wait(until(lambda: record.commanded == final), lambda: None, 'all statuses', 20.0)
    executed = 0.01 * scales[:-1] @ speeds[:-1]
    assert record.accepted == pytest.approx([executed, 0.0, 0.0], abs=1e-9)


HOLD = """
import sys
from isotruss_ros.demo import domains
domains.LOCK_NAME = sys.argv[2].replace('@', chr(0))
lock = domains.lock_domain(int(sys.argv[1]))
print(lock.number, flush=True)
sys.stdin.read()
"""


def test_a_domain_locked_by_another_process_is_skipped_until_the_process_is_killed(monkeypatch):
    # The locks of the runs on this machine are left alone.
    name = f'isotruss_ros_test_{os.getpid()}_{{}}'
    monkeypatch.setattr(domains, 'LOCK_NAME', '\0' + name)
    command = [sys.executable, '-c', HOLD, '40', '@' + name]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert int(process.stdout.readline()) == 40
        with contextlib.closing(domains.lock_domain(40)) as own:
            assert own.number == 41
        process.kill()
        process.wait()
        with contextlib.closing(domains.lock_domain(40)) as own:
            assert own.number == 40
