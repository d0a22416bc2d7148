# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command `isotruss compare` on the committed recording of a carry."""

from pathlib import Path

import pytest

for package in ('mcap', 'rosbags'):
    pytest.importorskip(package)
from isotruss_ros.cli import compare  # noqa: E402,I100

CARRY = Path(__file__).parents[2] / 'docs' / 'images' / 'carry.mcap'


@pytest.fixture(scope='module')
def compared(tmp_path_factory):
    """Return the exit code for the recording, and the path of its picture."""
    picture = tmp_path_factory.mktemp('compare') / 'carry.png'
    return compare.main([str(CARRY), '--picture', str(picture)]), picture


def test_a_carry_in_mujoco_agrees_with_the_model(compared, capsys):
    assert compare.main([str(CARRY)]) == 0
    out = capsys.readouterr().out
    assert 'held until the end' in out
    assert 'named: none' in out
    assert 'core.Uncertainty(' in out


def test_a_picture_is_written(compared):
    code, picture = compared
    assert code == 0
    assert picture.read_bytes().startswith(b'\x89PNG')


def test_a_gauge_on_another_clock_is_refused(tmp_path, capsys):
    forces = tmp_path / 'gauge.csv'
    forces.write_text('time_s,squeeze_N\n-20,9\n-10,9\n', encoding='utf-8')
    assert compare.main([str(CARRY), '--forces', str(forces)]) == 1
    assert '--gauge-zero' in capsys.readouterr().err


def test_a_file_that_is_no_recording_is_refused(tmp_path, capsys):
    path = tmp_path / 'run.mcap'
    path.write_bytes(b'text')
    assert compare.main([str(path)]) == 1
    assert capsys.readouterr().err.startswith(f'compare: {path}: no MCAP file')
