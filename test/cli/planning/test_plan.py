# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command plan_grasps, and the processes that search."""

from concurrent.futures.process import BrokenProcessPool
import json
import multiprocessing
from multiprocessing.context import SpawnProcess
import os
import signal
import subprocess
import sys
import threading
import time

from commands import exit_code
from held_grips import BOX_FILE
from isotruss_ros import core
from isotruss_ros.cli import plan_grasps as command
from isotruss_ros.core.planning.grasp_plan import path_times
from isotruss_ros.workers import core_count, WorkerPool
import numpy as np
from planning import workers
import psutil
import pytest


def begun_workers(count, of=None, deadline=20.0):
    """Return the processes that search once there are so many: a fork is none before its exec."""
    end = time.monotonic() + deadline
    while len(result := workers(of)) < count:
        assert time.monotonic() < end
        time.sleep(0.01)
    return result


ROBOT = core.load_robot('nine_member')
PLACE, ELLIPSE = (0.716, 0.43), '{shape: ellipse, semi_axes: [0.17, 0.15]}'
BODY = core.read_object(ELLIPSE).moved_to((*PLACE, 0.5))
CHANCE = ['--uncertainty', '{friction: 0.3}']
OBJECT = ['--center', '0.716', '0.43', '--diameter', '0.3']
#: No grasp is like that: the search for it takes long.
NEVER = ['--min-slip-margin', '1000']
DEADLINE = 240.0


@pytest.mark.parametrize(
    ('count', 'processes', 'shape', 'body'),
    [
        (1, 2, ['--object', ELLIPSE, '--angle', '0.5', *CHANCE], BODY),
        (2, 1, ['--diameter', '0.3'], core.ConvexObject.disc(PLACE, 0.3)),
    ],
)
def test_plan_is_that_of_the_core(count, processes, shape, body, tmp_path, capsys):
    needs = core.GraspRequirements(
        friction=0.6, module='north/Z', min_slip_margin=0.5, measure='total_force', count=count
    )
    uncertainty = core.Uncertainty.of(ROBOT, body, CHANCE[1]) if CHANCE[0] in shape else None
    expected = core.plan_grasps(ROBOT.home, body, needs, seed=4, uncertainty=uncertainty)
    assert expected.grasps
    options = ['--friction', '0.6', '--min-slip-margin', '0.5', '--measure', 'total_force']
    options += f'--count {count} --seed 4 --module north/Z --center 0.716 0.43'.split()
    file = tmp_path / 'plan.json'
    options += ['--workers', str(processes), '--json', str(file)]
    assert command.main([*shape, *options]) == 0
    result = json.loads(file.read_text())
    assert result['computing_time'] > 0.0
    assert result['evaluations'] == expected.evaluations
    assert result['complete']
    assert result['closest_violation'] is None
    assert result['roller_names'] == list(ROBOT.roller_names)
    printed = capsys.readouterr().out
    for one, other in zip(result['grasps'], expected.grasps, strict=True):
        assert one['path'] == other.path.tolist()
        assert one['score'] == other.score
        assert other.chance or other.score == -other.total_force
        assert one['touch'] == other.touch
        near = np.arange(len(other.path) - 1) >= other.touch - 2
        times = path_times(other.path, ROBOT.description, near)
        assert one['times'] == times.tolist()
        assert f'{other.total_force:.2f}' in printed
        assert not other.chance or f'{other.chance.probability:.3f}' in printed
        assert other.members[0] in printed
    assert not workers()


def test_an_object_is_a_disc_or_described(capsys):
    where = ['--center', '0.54', '-0.31']
    for shape in ([], ['--diameter', '0.3', '--object', BOX_FILE]):
        with pytest.raises(SystemExit) as ended:
            command.main([*where, *shape])
        assert ended.value.code == 2
    assert command.main([*where, '--object', '{shape: disc}']) == 2
    assert "key 'diameter' is missing" in capsys.readouterr().err


def test_what_is_wrong_with_obstacles_is_printed(capsys):
    with pytest.raises(SystemExit):
        command.main([*OBJECT, '--obstacles', '{a: 1}'])
    assert 'must be keys and values, with the key shape' in capsys.readouterr().err


def test_violated_requirement_of_the_closest_candidate_is_printed(capsys):
    assert command.main(['--center', '3', '3', '--diameter', '0.3']) == 1
    assert 'no grasp found in 0 evaluations; enclosed: no members' in capsys.readouterr().out


def test_ends_at_the_time_limit(capsys):
    assert command.main([*OBJECT, *NEVER, '--time-limit', '0.3', '--workers', '1']) == 1
    assert 'stopped before its end' in capsys.readouterr().out
    assert not workers()


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        (['--diameter', '-1'], "the object's diameter -1.0 m: must be from"),
        (['--robot', 'nobody'], 'nobody'),
        (['--members', 'north/Z-R', 'north/Q'], "members 'north/Q': robot nine_member has no"),
        (['--rollers', '1', '2'], 'must be 6 finite numbers'),
        (['--seed', '-1'], "'-1': must be an integer, not negative"),
        (['--workers', '-1'], "'-1': must be from 0"),
        (['--time-limit', '-1'], "'-1': must be a number of seconds"),
    ],
)
def test_invalid_arguments_are_named(options, words, capsys):
    assert exit_code(command.main, [*OBJECT, *options]) == 2
    assert words in capsys.readouterr().err


def test_death_of_a_worker_is_reported(capsys):
    threading.Thread(target=lambda: begun_workers(1)[0].kill()).start()
    options = [*NEVER, '--workers', '1', '--time-limit', str(DEADLINE)]
    assert command.main([*OBJECT, *options]) == 3
    assert 'a worker process died' in capsys.readouterr().err


def test_ctrl_c_in_a_terminal_prints_no_traceback():
    """It goes to all processes of the terminal, those that search as well."""
    module = [sys.executable, '-m', 'isotruss_ros.cli.plan_grasps']
    process = subprocess.Popen(
        [*module, *OBJECT, *NEVER, '--workers', '1'],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    children = begun_workers(1, process.pid)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=DEADLINE)
    assert process.returncode == 1
    assert 'stopped before its end' in out
    assert err == ''
    assert not psutil.wait_procs(children, DEADLINE)[1]


def test_an_interrupt_while_a_worker_starts_ends_it_without_a_traceback(monkeypatch, capfd):
    start = SpawnProcess.start

    def start_and_interrupt(process):
        start(process)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(SpawnProcess, 'start', start_and_interrupt)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # as in a program
    try:
        with pytest.raises(KeyboardInterrupt), WorkerPool(2) as pool:
            pool.executor.submit(int)
    finally:
        signal.signal(signal.SIGINT, before)
    assert not multiprocessing.active_children()
    assert capfd.readouterr().err == ''


def test_workers_end_when_the_pool_is_closed():
    pool = WorkerPool(2)
    busy = [pool.executor.submit(time.sleep, 1000.0) for _ in range(2)]
    assert len(begun_workers(2)) == 2
    pool.close()
    assert not workers()
    assert all(isinstance(future.exception(DEADLINE), BrokenProcessPool) for future in busy)
    WorkerPool().close()  # one that was never used
    assert 1 <= core_count() <= os.cpu_count()
