# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sweeps on a Dask cluster of two worker processes on this machine."""

import csv
from dataclasses import fields, replace
from pathlib import Path
import re
import time

from isotruss_ros.core import ConvexObject, GraspRequirements, load_robot, plan_grasps
import pytest

try:
    import distributed
    from isotruss_ros.cli import sweep as sweeps
    from isotruss_ros.cli.sweep import __main__ as command
except ModuleNotFoundError:
    distributed = None

# Not a skip of the module: with the plugins of ROS that would end the whole run.
pytestmark = pytest.mark.skipif(
    distributed is None, reason='needs the extra sweep: pip install distributed'
)

NINE, TRIANGLE = (load_robot(name).description for name in ('nine_member', 'triangle'))
#: A robot that is well formed and cannot work: one support too few.
LOOSE = replace(TRIANGLE, name='loose', supports={})
OBJECT = ConvexObject.disc((0.72, 0.45), 0.3)
OBJECTS = (OBJECT, ConvexObject.disc((3.0, 3.0), 0.3))
NEEDS = GraspRequirements(friction=0.7, count=1)


@pytest.fixture(scope='module')
def client():
    """Return a client of two processes with a thread each."""
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    )
    with cluster, distributed.Client(cluster) as found:
        assert len(found.nthreads()) == 2
        yield found


def timeless(result):
    """Return a result without its computing time."""
    return replace(result, computing_time=0.0)


def test_gives_every_pair_once_as_the_core_does(client):
    robots = (TRIANGLE, NINE, LOOSE, TRIANGLE)
    results = list(sweeps.sweep(client, robots, OBJECTS, NEEDS, seed=2))
    by_pair = {(result.robot, result.item): result for result in results}
    assert len(results) == len(by_pair) == len(robots) * len(OBJECTS)
    for (i, j), result in by_pair.items():
        assert result.name == robots[i].name
        assert (result.x, result.y, result.diameter) == (*OBJECTS[j].pose[:2], 0.3)
        if i == 3:
            assert timeless(result) == timeless(replace(by_pair[0, j], robot=3))
        elif i != 1:
            expected = sweeps.evaluate((i, j), robots[i], OBJECTS[j], NEEDS, 2)
            assert timeless(result) == timeless(expected)
    best = plan_grasps(load_robot('nine_member').home, OBJECT, NEEDS, seed=2).grasps[0]
    found = by_pair[1, 0]
    assert found.found == 1
    assert found.module == best.module
    assert found.roller_positions == tuple(best.roller_positions)
    shared = {field.name for field in fields(best)} & {field.name for field in fields(found)}
    for name in shared - {'roller_positions'}:
        assert getattr(found, name) == getattr(best, name), name
    assert {result.violated_requirement for result in results if result.item == 1} == {
        'enclosed',
        '',
    }
    assert [result.error == '' for result in results] == [r.name != 'loose' for r in results]


def test_unread_results_are_cancelled(client):
    results = sweeps.sweep(client, [TRIANGLE], [OBJECTS[1]] * 3 + [OBJECT] * 40, NEEDS)
    assert next(results).error == ''
    results.close()
    deadline = time.monotonic() + 20.0
    while client.run_on_scheduler(lambda dask_scheduler: len(dask_scheduler.tasks)):
        assert time.monotonic() < deadline


def test_error_of_a_pair_is_in_its_result(client, monkeypatch):
    def fall(*_arguments, **_options):
        raise MemoryError('too large')

    monkeypatch.setattr('isotruss_ros.cli.sweep.sweeping.evaluate', fall)
    (result,) = sweeps.sweep(client, [TRIANGLE], [OBJECT])
    assert result.error == 'MemoryError: too large'
    assert (result.name, result.x, result.found) == ('triangle', 0.72, 0)


def test_search_runs_on_the_cluster(client):
    config = load_robot('nine_member').home
    needs = replace(NEEDS, module='north/Z')
    here = plan_grasps(config, OBJECT, needs, seed=1)
    there = plan_grasps(config, OBJECT, needs, seed=1, executor=client.get_executor())
    assert here.grasps
    assert (here.evaluations, here.analyses) == (there.evaluations, there.analyses)
    for one, other in zip(here.grasps, there.grasps, strict=True):
        assert one.path.tolist() == other.path.tolist()
        assert one.score == other.score


def test_writes_a_row_for_every_pair(client, tmp_path, capsys):
    objects, output = tmp_path / 'objects.csv', tmp_path / 'results.csv'
    objects.write_text('diameter,x,y,colour\n0.3,0.72,0.45,red\n0.3,3.0,3.0,blue\n')
    options = ['--friction', '0.7', '--count', '1', '--scheduler', client.scheduler.address]
    arguments = ['triangle', '--objects', str(objects), '--output', str(output)]
    assert command.main([*arguments, *options]) == 0
    with output.open() as file:
        rows = {row['item']: row for row in csv.DictReader(file)}
    assert set(rows) == {'0', '1'}
    expected = sweeps.evaluate((0, 0), TRIANGLE, OBJECT, NEEDS, 0)
    assert float(rows['0']['score']) == expected.score
    assert [float(part) for part in rows['0']['roller_positions'].split()] == list(
        expected.roller_positions
    )
    assert rows['0']['members'].split() == list(expected.members)
    assert (rows['1']['found'], rows['1']['violated_requirement']) == ('0', 'enclosed')
    assert '2 pairs: 1 grasped, 0 could not be computed' in capsys.readouterr().out


def test_example_of_the_docs_runs(client, capsys):
    page = Path(__file__).parents[2] / 'docs' / 'grasp_planning.md'
    (example,) = re.findall(r'```py\n(.*?)```', page.read_text(encoding='utf-8'), re.DOTALL)
    assert 'tcp://scheduler:8786' in example
    exec(example.replace('tcp://scheduler:8786', client.scheduler.address), {})
    lines = capsys.readouterr().out.splitlines()
    assert sorted(line[:3] for line in lines) == ['0 0', '0 1', '1 0', '1 1']
    assert all(int(line.split()[2]) > 0 for line in lines)


@pytest.mark.parametrize(
    ('table', 'options', 'words'),
    [
        ('x,y\n1,2\n', [], "no column 'diameter'; must have x, y, diameter"),
        ('x,y,diameter\n1,2,3\n1,two,3\n', [], 'row 3: could not convert string to float'),
        ('x,y,diameter\n1,2\n', [], 'row 2'),
        ('x,y,diameter\n1,2,-3\n', [], "row 2: the object's diameter -3.0 m: must be positive"),
        ('x,y,diameter\n', [], 'no objects below the header'),
        ('', [], 'no objects below the header'),
        ('x,y,diameter\n1,2,3\n', ['--friction', '-1'], 'friction'),
        ('x,y,diameter\n1,2,3\n', ['--seed', '-1'], 'seed'),
        ('x,y,diameter\n1,2,3\n', ['--output', '/nowhere/at/all.csv'], '/nowhere'),
    ],
)
def test_wrong_input_is_refused_before_the_sweep(table, options, words, tmp_path, capsys):
    objects = tmp_path / 'objects.csv'
    objects.write_text(table)
    arguments = ['triangle', '--objects', str(objects), '--output', str(tmp_path / 'out.csv')]
    try:
        code = command.main([*arguments, *options])
    except SystemExit as end:
        code = end.code
    assert code == 2
    assert words in capsys.readouterr().err
