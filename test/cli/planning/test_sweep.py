# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sweeps on a Dask cluster of two workers on this machine."""

import csv
from pathlib import Path
import re

from commands import exit_code
from isotruss_ros.core import ConvexObject, GraspRequirements, load_robot, plan_grasps
from nightly import some_now
import pytest

try:
    import distributed
    from isotruss_ros.cli import sweep as sweeps
except ModuleNotFoundError:
    distributed = None

# Not a skip of the module: with the plugins of ROS that would end the whole run.
pytestmark = pytest.mark.skipif(distributed is None, reason='pip install distributed')
TRIANGLE = load_robot('triangle').home
OBJECT = ConvexObject.disc((0.72, 0.45), 0.3)
NEEDS = GraspRequirements(friction=0.7, count=1)


@pytest.fixture(scope='module', params=some_now([False, True]), ids=['threads', 'processes'])
def client(request):
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=request.param, dashboard_address=None
    )
    with cluster, distributed.Client(cluster) as result:
        assert len(result.nthreads()) == 2
        yield result


def test_writes_a_row_for_every_pair(client, tmp_path, capsys):
    objects, output = tmp_path / 'objects.csv', tmp_path / 'results.csv'
    objects.write_text('diameter,x,y,colour\n0.3,0.72,0.45,red\n0.3,3.0,3.0,blue\n')
    options = ['--friction', '0.7', '--count', '1', '--seed', '4']
    options += ['--scheduler', client.scheduler.address]
    arguments = ['triangle', '--objects', str(objects), '--output', str(output)]
    assert sweeps.main([*arguments, *options]) == 0
    with output.open() as file:
        rows = {row['object']: row for row in csv.DictReader(file)}
    plan = plan_grasps(TRIANGLE, OBJECT, NEEDS, 4)
    assert float(rows['0']['score']) == plan.grasps[0].score
    assert rows['0']['members'].split() == list(plan.grasps[0].members)
    assert (rows['0']['evaluations'], rows['0']['diameter']) == (str(plan.evaluations), '0.3')
    assert (rows['1']['found'], rows['1']['violated_requirement']) == ('0', 'enclosed')
    assert '2 pairs: 1 grasped' in capsys.readouterr().out


@pytest.mark.nightly
def test_example_of_the_docs_runs(client, capsys):
    page = Path(__file__).parents[3] / 'docs' / 'grasp_planning.md'
    (example,) = re.findall(r'```py\n(.*?)```', page.read_text(encoding='utf-8'), re.DOTALL)
    exec(example.replace('tcp://scheduler:8786', client.scheduler.address), {})
    lines = capsys.readouterr().out.splitlines()
    assert sorted(line[:3] for line in lines) == ['0 0', '0 1', '1 0', '1 1']
    assert all(int(line.split()[2]) > 0 for line in lines)


@pytest.mark.parametrize(
    ('table', 'options', 'words'),
    [
        ('x,y\n1,2\n', [], "row 2: 'diameter'; must have numbers x, y, diameter"),
        ('x,y,diameter\n1,2,3\n1,two,3\n', [], 'row 3: could not convert string to float'),
        ('x,y,diameter\n1,2,-3\n', [], "row 2: the object's diameter -3.0 m: must be from"),
        ('', [], 'no objects below the header'),
        ('x,y,diameter\n1,2,3\n', ['--friction', '-1'], 'friction'),
    ],
)
def test_invalid_input_is_refused_before_the_sweep(table, options, words, tmp_path, capsys):
    objects = tmp_path / 'objects.csv'
    objects.write_text(table)
    arguments = ['triangle', '--objects', str(objects), '--output', str(tmp_path / 'out.csv')]
    assert exit_code(sweeps.main, [*arguments, *options]) == 2
    assert words in capsys.readouterr().err
