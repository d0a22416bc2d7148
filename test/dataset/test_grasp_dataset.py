# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Data sets of random grasps: their rows, their files, and runs that are resumed."""

from concurrent.futures import BrokenExecutor, Executor, Future
from dataclasses import replace
import importlib.util
import io
import json
import os
from pathlib import Path
import resource
import sys
import tempfile
import zipfile

from commands import exit_code
from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.cli import grasp_dataset as command
from isotruss_ros.core import load_robot, read_object, settle_grasp
from isotruss_ros.dataset import grasp_dataset
from isotruss_ros.dataset.columns import COLUMNS
from isotruss_ros.dataset.grasp_dataset import compute_part, DatasetRun, write_dataset
from isotruss_ros.dataset.random_grasps import (
    DatasetError,
    draw_grasp,
    GraspDistribution,
    KINDS,
)
from isotruss_ros.workers import dask_client
import numpy as np
import pytest
from robots import examples

ROBOT = load_robot('triangle')
LOADED = GraspDistribution(force=1.0, moment=0.05)
RUN = DatasetRun(ROBOT, 10, LOADED, seed=3, part_size=4)
HEXAGON = [(0.1 * np.cos(a), 0.1 * np.sin(a)) for a in np.pi / 3.0 * np.arange(6)]
HEXAGON_FILE = f'{{shape: polygon, vertices: {[[float(x), float(y)] for x, y in HEXAGON]}}}'


def written(run, path):
    """Return the columns of a data set that is written to an NPZ file."""
    assert write_dataset(run, path)
    with np.load(path) as file:
        return dict(file)


@pytest.fixture(scope='module')
def columns(tmp_path_factory):
    return written(RUN, tmp_path_factory.mktemp('dataset') / 'grasps.npz')


def test_rows_are_settled_grasps_of_the_drawn_objects(columns):
    names = ROBOT.member_names
    for i in range(RUN.count):
        grasp = draw_grasp(ROBOT, LOADED, 3, i)
        assert columns['given_pose'][i].tolist() == list(grasp.body.pose)
        assert columns['roller_positions'][i].tolist() == grasp.config.roller_positions.tolist()
        settled = settle_grasp(*grasp[:4])
        assert columns['held'][i] == settled.held
        assert columns['hold'][i] == settled.hold.name
        assert columns['slip_margin'][i] == pytest.approx(settled.slip_margin, rel=1e-9, abs=1e-9)
        forces = [settled.normal_forces.get(name, 0.0) for name in names]
        assert columns['normal_forces'][i] == pytest.approx(forces, rel=1e-9, abs=1e-9)


def test_columns_have_the_documented_types_and_widths(columns):
    widths = {'members': len(ROBOT.member_names), 'rollers': len(ROBOT.roller_names)}
    assert [*columns] == [*COLUMNS, 'settings']
    for name, column in COLUMNS.items():
        width = widths.get(column.axis, int(column.axis) if column.axis.isdigit() else 8)
        assert columns[name].shape == ((RUN.count, width) if column.axis else (RUN.count,)), name
        assert columns[name].dtype == np.dtype(column.kind)
    assert json.loads(str(columns['settings'])) == RUN.settings()


@pytest.mark.parametrize('kind', KINDS)
def test_random_objects_of_a_kind_are_within_the_sizes(kind):
    for i in range(20):
        body = draw_grasp(ROBOT, GraspDistribution((kind,), sizes=(0.1, 0.2)), 0, i).body
        assert type(body.shape).__name__.lower() == kind
        widths = body.shape.support(np.array([1.0, -1.0, 1j, -1j]))
        assert widths.max() <= 0.1 + 1e-12
        assert widths[:2].sum() >= (0.1 if kind != 'polygon' else 0.04) - 1e-12


def test_an_object_with_its_own_friction_keeps_it():
    body = read_object('{shape: disc, diameter: 0.2, friction: 0.77}')
    grasp = draw_grasp(ROBOT, GraspDistribution((body,)), 0, 0)
    assert grasp.friction == 0.77
    assert grasp.body.shape == body.shape


def test_a_resumed_run_writes_the_file_of_an_uninterrupted_run(columns, tmp_path):
    path, calls = tmp_path / 'grasps.npz', []

    def stop(stored):
        calls.append(stored)
        if stored >= 4:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        write_dataset(RUN, path, on_progress=stop)
    assert not path.exists()
    kept = tmp_path / 'grasps.npz.parts' / '0000000000.npz'
    before = kept.stat()
    resumed = []
    assert write_dataset(
        RUN,
        path,
        on_progress=lambda stored: resumed.append(
            (stored, kept.exists() and kept.stat() == before)
        ),
    )
    assert calls == [0, 4]
    assert resumed == [(4, True), (8, True), (10, True)]
    with np.load(path) as file:
        for name in file.files:
            np.testing.assert_array_equal(file[name], columns[name])
    assert [*tmp_path.iterdir()] == [path]


def test_a_complete_file_is_not_written_again(tmp_path):
    path = tmp_path / 'grasps.npz'
    run = DatasetRun(ROBOT, 1, columns=('held', 'friction'))
    assert [*written(run, path)] == ['held', 'friction', 'settings']
    before = path.stat()
    assert not write_dataset(run, path)
    assert path.stat() == before


@pytest.mark.skipif(importlib.util.find_spec('pyarrow') is None, reason='needs the extra parquet')
def test_a_parquet_file_has_the_columns_of_the_npz_file(columns, tmp_path):
    import pyarrow.parquet

    path = tmp_path / 'grasps.parquet'
    assert write_dataset(RUN, path)
    assert not write_dataset(RUN, path)
    table = pyarrow.parquet.read_table(path)
    for name in COLUMNS:
        values = np.array(table[name].to_pylist())
        np.testing.assert_array_equal(values, columns[name], err_msg=name)


def call(path, *options, count='2'):
    """Return the exit code of the command."""
    arguments = ['triangle', '--out', str(path), '--count', count, '--workers', '1', *options]
    return exit_code(command.main, arguments)


def test_command_writes_the_rows_of_the_core_by_two_processes(tmp_path, capsys):
    path = tmp_path / 'grasps.npz'
    options = ('--seed', '3', '--force', '1', '--moment', '0.05', '--objects', 'disc')
    assert call(path, *options, HEXAGON_FILE, '--workers', '2') == 0
    assert '2 grasps, 22 columns: written' in capsys.readouterr().out
    distribution = GraspDistribution(('disc', read_object(HEXAGON_FILE)), force=1.0, moment=0.05)
    expected = written(DatasetRun(ROBOT, 2, distribution, 3), tmp_path / 'expected.npz')
    with np.load(path) as file:
        for name in file.files:
            np.testing.assert_array_equal(file[name], expected[name])
    assert call(path, *options, HEXAGON_FILE) == 0
    assert 'complete already' in capsys.readouterr().out


def die_once(run, begin):
    """Compute a part; the process of the second part dies at the first time."""
    mark = Path(run.robot.description.source).parent / 'died'
    if begin and not mark.exists():
        mark.touch()
        os._exit(1)
    return compute_part(run, begin)


@pytest.mark.nightly
@pytest.mark.skipif(
    importlib.util.find_spec('distributed') is None, reason='needs the extra sweep'
)
def test_a_dask_cluster_computes_the_part_of_a_dead_worker_again(columns, tmp_path, monkeypatch):
    robot_file = tmp_path / 'triangle.yaml'
    robot_file.write_text(Path(ROBOT.description.source).read_text())
    monkeypatch.setattr(grasp_dataset, 'compute_part', die_once)
    run = replace(RUN, robot=load_robot(str(robot_file)))
    with dask_client(None, 2) as client:
        assert write_dataset(run, tmp_path / 'grasps.npz', client.get_executor(pure=False))
    assert (tmp_path / 'died').exists()
    with np.load(tmp_path / 'grasps.npz') as file:
        for name in COLUMNS:
            np.testing.assert_array_equal(file[name], columns[name], err_msg=name)


@pytest.mark.skipif(
    importlib.util.find_spec('distributed') is None, reason='needs the extra sweep'
)
def test_command_writes_the_rows_of_the_core_by_a_scheduler(columns, tmp_path):
    import distributed

    cluster = distributed.LocalCluster(2, processes=False, dashboard_address=None)
    options = ('--seed', '3', '--force', '1', '--moment', '0.05')
    with cluster:
        address = cluster.scheduler_address
        assert call(tmp_path / 'a.npz', *options, '--scheduler', address, count='10') == 0
    with np.load(tmp_path / 'a.npz') as file:
        assert file['number'].tolist() == columns['number'].tolist()
        assert file['given_pose'].tolist() == columns['given_pose'].tolist()
        assert file['slip_margin'] == pytest.approx(columns['slip_margin'], rel=1e-9, abs=1e-9)


class OneAfterAnother(Executor):
    """Executor whose second task fails, as one whose process died."""

    def __init__(self):
        self.count = 0

    def submit(self, fn, *args):
        """Execute a task."""
        self.count += 1
        future = Future()
        if self.count == 2:
            future.set_exception(BrokenExecutor('dead'))
        else:
            future.set_result(fn(*args))
        return future


def test_parts_beside_that_of_a_dead_process_are_stored(tmp_path):
    path = tmp_path / 'grasps.npz'
    with pytest.raises(BrokenExecutor):
        write_dataset(RUN, path, OneAfterAnother())
    stored = sorted(part.name for part in (tmp_path / 'grasps.npz.parts').glob('*.npz'))
    assert stored == ['0000000000.npz', '0000000008.npz']
    assert write_dataset(RUN, path)


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        (['--objects', 'dics'], "'dics': did you mean disc?"),
        (['--objects', 'my.yaml'], "'my.yaml': must be one of disc, polygon, ellipse, or an obj"),
        (['--objects', '{shape: disc}'], "key 'diameter' is missing"),
        (['--count', '0'], 'count 0: must be from 1 to'),
        (['--columns', 'slipmargin'], "'slipmargin': did you mean slip_margin?"),
        (['--sizes', '0.3', '0.1'], 'sizes 0.3 0.1: must be the smallest'),
        (['--sizes', '-1', '0.1'], 'sizes -1.0 m: must be from'),
        (['--sizes', '8', '9'], 'no place between two members of'),
        (['--friction', 'nan', '1'], 'friction'),
        (['--seed', '-1'], "'-1': must be an integer, not negative"),
        (['--out', 'grasps.csv'], 'grasps.csv: must end with .npz or .parquet'),
        (['--out', 'nowhere/grasps.npz'], 'no folder'),
    ],
)
def test_invalid_arguments_are_named(options, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert call('grasps.npz', *options) == 2
    assert words in capsys.readouterr().err
    assert not [*tmp_path.iterdir()]


def test_a_robot_file_that_does_not_exist_is_named(tmp_path, capsys):
    assert command.main(['nobody', '--count', '1', '--out', str(tmp_path / 'a.npz')]) == 2
    assert 'nobody' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('name', 'content', 'words'),
    [
        ('grasps.npz', 'x', 'grasps.npz: no data set of grasps'),
        ('grasps.npz.parts/settings.json', '{}', 'grasps.npz.parts: no data set of grasps'),
        ('grasps.npz.parts/notes.txt', 'x', 'grasps.npz.parts: has no settings.json'),
    ],
)
def test_files_that_are_no_data_set_are_refused(name, content, words, tmp_path, capsys):
    file = tmp_path / name
    file.parent.mkdir(exist_ok=True)
    file.write_text(content)
    assert call(tmp_path / 'grasps.npz') == 2
    assert words in capsys.readouterr().err
    assert file.read_text() == content


def test_a_file_and_parts_of_another_run_are_refused_with_the_setting(tmp_path, capsys):
    path = tmp_path / 'grasps.npz'
    write_dataset(DatasetRun(ROBOT, 1), path)
    assert call(path, count='1') == 0
    assert call(path, '--travel', '0.05', count='1') == 2
    assert 'belongs to another run: travel 0.1, now 0.05' in capsys.readouterr().err
    path.unlink()

    def stop(stored):
        if stored:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        write_dataset(DatasetRun(ROBOT, 2, part_size=1), path, on_progress=stop)
    assert call(path) == 2
    assert 'belongs to another run: part_size 1, now 256' in capsys.readouterr().err


def test_a_damaged_part_is_named(tmp_path, capsys):
    path = tmp_path / 'grasps.npz'
    run = DatasetRun(ROBOT, 2, part_size=1)

    def damage(stored):
        if stored == 2:
            (tmp_path / 'grasps.npz.parts' / '0000000001.npz').write_bytes(b'PK')

    with pytest.raises(ValueError, match=r'0000000001.npz: damaged: .*delete it'):
        write_dataset(run, path, on_progress=damage)


SHORT = DatasetRun(ROBOT, 4, columns=('friction', 'external_wrench'), part_size=2)
DISCS = GraspDistribution(('disc',))
CHANGES = {
    'a row more': lambda values: np.concatenate([values, values[:1]]),
    'a row less': lambda values: values[:1],
    'another kind': lambda values: values.astype('f4'),
    'objects': lambda values: values.astype(object),
}


@pytest.mark.parametrize('suffix', ['npz', 'parquet'])
@pytest.mark.parametrize('change', CHANGES)
def test_parts_of_other_rows_or_kinds_are_named_and_kept(change, suffix, tmp_path):
    if suffix == 'parquet':
        pytest.importorskip('pyarrow')
    path = tmp_path / f'grasps.{suffix}'
    part = tmp_path / f'grasps.{suffix}.parts' / '0000000002.npz'

    def replace_part(stored):
        if stored == 4:
            with np.load(part) as file:
                columns = dict(file)
            np.savez(part, **columns | {'friction': CHANGES[change](columns['friction'])})

    with pytest.raises(DatasetError, match=r'0000000002.npz: .*friction'):
        write_dataset(SHORT, path, on_progress=replace_part)
    assert not path.exists()
    assert part.exists()
    part.unlink()
    assert write_dataset(SHORT, path)


def test_a_data_set_of_another_version_is_refused(tmp_path, monkeypatch):
    path = tmp_path / 'grasps.npz'
    assert write_dataset(SHORT, path)
    monkeypatch.setattr(grasp_dataset, 'find_versions', lambda: {'isotruss_ros': '999'})
    with pytest.raises(DatasetError, match=r'another run: version .* now "999"'):
        write_dataset(SHORT, path)


@st.composite
def damaged_files(draw):
    """Return the bytes of an NPZ file of a compression, some of which are changed."""
    stream = io.BytesIO()
    settings = io.BytesIO()
    np.save(settings, np.array('{}'))
    with zipfile.ZipFile(stream, 'w', draw(st.sampled_from([0, 8, 12, 14]))) as archive:
        archive.writestr('settings.npy', settings.getvalue())
    content = bytearray(stream.getvalue())
    for place in draw(st.lists(st.integers(0, len(content) - 1), min_size=1, max_size=4)):
        content[place] = draw(st.integers(0, 255))
    return bytes(content)


@examples(200)
@given(damaged_files())
def test_a_damaged_or_foreign_file_is_refused_by_name(content):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'grasps.npz'
        path.write_bytes(content)
        with pytest.raises(DatasetError, match=r'grasps.npz: no data set'):
            write_dataset(SHORT, path)


@pytest.mark.parametrize('size', [100, 1500])
def test_a_full_disk_is_reported_with_the_file(size, tmp_path):
    path, limits = tmp_path / 'grasps.npz', resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        with pytest.raises(DatasetError, match=r'grasps.npz.*: cannot be written: File too large'):
            write_dataset(replace(SHORT, count=20, part_size=4, distribution=DISCS), path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not path.exists()


def test_a_link_in_place_of_the_parts_is_refused_before_anything_is_computed(tmp_path):
    (tmp_path / 'scratch').mkdir()
    (tmp_path / 'grasps.npz.parts').symlink_to(tmp_path / 'scratch')
    with pytest.raises(DatasetError, match=r'grasps.npz.parts: is a link'):
        write_dataset(SHORT, tmp_path / 'grasps.npz')


def test_a_second_run_of_a_command_is_refused_while_the_first_one_writes(tmp_path):
    path, errors = tmp_path / 'grasps.npz', []

    def run_again(stored):
        with pytest.raises(DatasetError, match='another process writes it') as caught:
            write_dataset(SHORT, path)
        errors.append(caught.value)

    assert write_dataset(SHORT, path, on_progress=run_again)
    assert len(errors) == 3


def test_parquet_without_pyarrow_names_its_installation(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, 'pyarrow', None)
    monkeypatch.delitem(sys.modules, 'pyarrow.parquet', raising=False)
    assert call(tmp_path / 'grasps.parquet') == 2
    assert "pip install 'isotruss_ros[parquet]'" in capsys.readouterr().err
