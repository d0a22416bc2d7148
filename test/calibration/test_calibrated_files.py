# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Measured joints in files, and the robot file that follows from them."""

from pathlib import Path

from isotruss_ros.calibration.home import calibrate_home
from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.calibration.robot_files import read_postures, write_robot_file
from isotruss_ros.calibration.stiffness_scale import StiffnessCalibration
from isotruss_ros.cli import calibrate
from isotruss_ros.core import deform, load_robot
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
NAMES, ROLLERS = ROBOT.topology.joint_names, ROBOT.roller_names
ZEROS = np.array([0.01, -0.02, 0.015, 0.02, -0.01, 0.02])
HEAD = ','.join(('posture', 'joint', 'x', 'y', *ROLLERS))


def table(tmp_path, nodes, reading=(0.0,) * 6, name='joints.csv'):
    """Write measured joints; return the path."""
    rows = [
        ','.join(map(str, ('1', joint, *place, *reading)))
        for joint, place in zip(NAMES, nodes.tolist(), strict=False)
    ]
    path = tmp_path / name
    path.write_text('\n'.join((HEAD, *rows)) + '\n')
    return path


def test_robot_calibrated_from_a_table_agrees_with_the_measured_joints(tmp_path, capsys):
    reading = np.full(6, 0.03)
    points = table(tmp_path, ROBOT.configuration(ZEROS + reading).nodes, reading)
    output = tmp_path / 'mine.yaml'
    assert calibrate.home([str(points), '--output', str(output)]) == 0
    assert 'south/Q     -20.00 +- 0.' in capsys.readouterr().out
    result = load_robot(output).configuration(reading)
    assert result.nodes == pytest.approx(ROBOT.configuration(ZEROS + reading).nodes, abs=1e-6)


def test_measured_displacements_become_the_stiffness_scale_of_the_file(tmp_path, capsys):
    nodes, output = ROBOT.home.nodes.copy(), tmp_path / 'mine.yaml'
    before = table(tmp_path, nodes)
    for number, name in enumerate(NAMES):
        nodes[number] += deform(ROBOT.home, {'Z': (10.0 / 0.7, 0.0)}).displacement(name)[:2]
    under = table(tmp_path, nodes, name='under.csv')
    pull = ['--joint', 'Z', '--force', '10', '0', '--deviation', '1e-4']
    assert calibrate.stiffness([str(before), str(under), *pull, '--output', str(output)]) == 0
    assert load_robot(output).description.stiffness_scale == pytest.approx(0.7, rel=1e-3)
    before.write_text(before.read_text() + ','.join(['2', 'Z', *8 * ['0']]))
    assert calibrate.stiffness([str(before), str(under), *pull]) == 1
    assert 'joints.csv: 2 postures: must be one' in capsys.readouterr().err


def test_comments_and_deviations_are_in_the_file(tmp_path):
    posture = read_postures(table(tmp_path, ROBOT.home.nodes), ROBOT)
    output = tmp_path / 'mine.yaml'
    write_robot_file(
        ROBOT, output, calibrate_home(ROBOT, posture), StiffnessCalibration(0.6, 0.02)
    )
    assert '# home position of each universal joint [m]' in output.read_text()
    known = load_robot(output).description.calibration
    assert known['stiffness_deviation'] == 0.02
    assert set(known['zero_deviations']) == set(ROLLERS)


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('posture,joint\n1,P\n', 'columns x, y, south/P'),
        (f'{HEAD}\n1,P,a,0,0,0,0,0,0,0\n', "line 2: x 'a': must be a finite number"),
        (
            f'{HEAD}\n1,P,0,0,0,0,0,0,0,0\n1,P,0,0,0,0,0,0,0,0\n',
            'line 3: joint .P. of posture .1.',
        ),
        (f'{HEAD}\n1,P,0,0,0,0,0,0,0,0\n1,Q,0,0,0,0,0,0,0,1\n', 'the rollers are in one place'),
    ],
)
def test_tables_that_cannot_be_read_are_refused(tmp_path, text, words):
    path = tmp_path / 'joints.csv'
    path.write_text(text)
    with pytest.raises(MeasurementError, match=words):
        read_postures(path, ROBOT)


def test_a_missing_file_ends_with_an_error(capsys):
    assert calibrate.home([str(Path('no_such.csv'))]) == 1
    assert 'calibrate_home: no_such.csv: cannot be read' in capsys.readouterr().err
