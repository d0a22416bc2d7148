# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The roller offsets, fitted to measured joints, and the files with these joints and offsets."""

from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st
from isotruss_ros.calibration.home import calibrate_home
from isotruss_ros.calibration.home_fit import Posture
from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.calibration.robot_files import read_postures, write_robot_file
from isotruss_ros.calibration.stiffness_scale import StiffnessCalibration
from isotruss_ros.cli import calibrate
from isotruss_ros.core import deform, load_robot, Robot
from isotruss_ros.core.errors import GraspError
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
NAMES, ROLLERS = ROBOT.topology.joint_names, ROBOT.roller_names
ALL, ENOUGH, FEW = tuple(NAMES), ('Q', 'R', 'Z'), ('P', 'R', 'Z')
N = len(ROBOT.roller_names)
ZEROS = np.array([0.01, -0.02, 0.015, 0.02, -0.01, 0.02])
HEAD = ','.join(('posture', 'joint', 'x', 'y', *ROLLERS))


def measure(offsets, readings, joints=ALL, noise=0.0, seed=0):
    """Return the measured postures of a robot with roller offsets."""
    rng = np.random.default_rng(seed)
    postures = []
    for reading in np.atleast_2d(readings):
        nodes = ROBOT.configuration(reading + offsets).nodes + noise * rng.normal(
            size=ROBOT.home.nodes.shape
        )
        postures.append(Posture(reading, {n: tuple(nodes[NAMES.index(n)]) for n in joints}))
    return postures


def draw_offsets(seed, size=0.015):
    return size * np.random.default_rng(seed).normal(size=N)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), joints=st.sampled_from([ALL, ENOUGH]))
def test_exact_joint_positions_yield_exact_offsets(seed, joints):
    offsets = draw_offsets(seed)
    result = calibrate_home(ROBOT, measure(offsets, np.zeros(N), joints))
    assert result.offsets == pytest.approx(offsets, abs=1e-9)


@pytest.mark.parametrize(('count', 'bound'), [(1, 1.5e-3), (3, 1.1e-3)])
def test_joints_and_deviations_agree_with_the_noise_of_markers(count, bound):
    """The median over robots of the worst joint, and the normalised offsets; markers of 1 mm."""
    rng, worst, errors = np.random.default_rng(1), [], []
    for seed in range(40):
        offsets = draw_offsets(seed)
        readings = 0.05 * rng.normal(size=(count, N)) if count > 1 else np.zeros((1, N))
        result = calibrate_home(ROBOT, measure(offsets, readings, noise=1e-3, seed=seed))
        nodes = Robot(result.description).home.nodes[: len(NAMES)]
        off = nodes - ROBOT.configuration(offsets).nodes[: len(NAMES)]
        worst.append(np.hypot.reduce(off, axis=1).max())
        errors.append((result.offsets - offsets) / result.deviations)
    assert np.median(worst) < bound
    assert 0.75 < np.sqrt(np.mean(np.square(errors))) < 1.1


def test_several_postures_compensate_for_unmeasured_joints():
    offsets = draw_offsets(5)
    readings = 0.05 * np.random.default_rng(0).normal(size=(3, N))
    result = calibrate_home(ROBOT, measure(offsets, readings, FEW))
    assert result.offsets == pytest.approx(offsets, abs=1e-9)
    with pytest.raises(MeasurementError, match=r'P, R, Z: they do not .* measure joint [QY] as'):
        calibrate_home(ROBOT, measure(offsets, np.zeros(N), FEW))


@pytest.mark.parametrize(
    ('joints', 'kind', 'words'),
    [
        ({'P': (0.0, 0.0)}, MeasurementError, 'joints P: must be 3 or more'),
        ({'W': (0.0, 0.0)}, GraspError, "joint 'W'"),
    ],
)
def test_invalid_measurements_are_refused(joints, kind, words):
    with pytest.raises(kind, match=words):
        calibrate_home(ROBOT, [Posture(np.zeros(N), joints)])


def wrong(place=lambda _, z: z, reading=lambda x: x, names=None):
    """Return three postures measured to 1 mm, with changed joints (x + iy), readings or names."""
    readings = 0.05 * np.random.default_rng(0).normal(size=(3, N))
    postures = []
    for posture in measure(draw_offsets(8), readings, noise=1e-3):
        places = {name: place(name, complex(*xy)) for name, xy in posture.joints.items()}
        joints = {(names or {}).get(name, name): (z.real, z.imag) for name, z in places.items()}
        postures.append(Posture(reading(posture.roller_positions.copy()), joints))
    return postures


SIGNS, SWAPPED = np.array([1.0, 1.0, -1.0, 1.0, 1.0, 1.0]), [3, 1, 2, 0, 4, 5]
MISTAKES = {
    'markers in mm': (wrong(lambda _, z: 1e3 * z), 'the markers are in mm'),
    'encoders in mm': (wrong(reading=lambda x: 1e3 * x), 'the encoders read in mm'),
    'encoder sign': (wrong(reading=lambda x: SIGNS * x), 'encoder of east/Q counts the other way'),
    'encoders swapped': (wrong(reading=lambda x: x[SWAPPED]), 'of south/P and east/R are swapped'),
    'markers swapped': (wrong(names={'Q': 'R', 'R': 'Q'}), 'joints Q and R are swapped'),
    'frame shifted': (wrong(lambda _, z: z + 0.3), r"robot's frame: .* \(-0.30\d, .* by -?0.0"),
    'frame turned': (
        wrong(lambda _, z: (z - 0.2j) * np.exp(-0.1j)),
        r"the tracker's frame is not .* turned by 5.7 degrees: publish this transform",
    ),
    'one marker off': (wrong(lambda name, z: z + 0.05j * (name == 'R')), 'R of .* mm off the fit'),
}


@pytest.mark.parametrize('mistake', MISTAKES)
def test_the_mistake_is_named(mistake):
    postures, words = MISTAKES[mistake]
    with pytest.raises(MeasurementError, match=words):
        calibrate_home(ROBOT, postures)


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
    rows = read_postures(table(tmp_path, ROBOT.home.nodes), ROBOT)
    output = tmp_path / 'mine.yaml'
    write_robot_file(ROBOT, output, calibrate_home(ROBOT, rows), StiffnessCalibration(0.6, 0.02))
    assert '# home position of each universal joint [m]' in output.read_text()
    known = load_robot(output).description.calibration
    assert known['stiffness_deviation'] == 0.02
    assert set(known['zero_deviations']) == set(ROLLERS)


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('posture,joint\n1,P\n', 'columns x, y, south/P'),
        (f'{HEAD}\n1,P,a,0,0,0,0,0,0,0\n', "line 2: x 'a': must be a finite number"),
        (f'{HEAD}\n1,P,0,0,0,0,0,0,0,0\n1,P,0,0,0,0,0,0,0,0\n', 'line 3: joint .P. of posture .1'),
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
