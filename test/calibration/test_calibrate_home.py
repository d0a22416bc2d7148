# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Roller offsets, stiffness, rollers and oscillations, fitted to measured positions."""

from dataclasses import replace
from pathlib import Path
import re

from carries import make_robot
from hypothesis import given, settings
from hypothesis import strategies as st
from isotruss_ros.calibration.home import calibrate_home
from isotruss_ros.calibration.home_fit import Posture
from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.calibration.oscillation import fit_oscillation
from isotruss_ros.calibration.robot_files import read_postures, write_robot_file
from isotruss_ros.calibration.roller_check import judge_roller
from isotruss_ros.calibration.stiffness_scale import calibrate_stiffness, StiffnessCalibration
from isotruss_ros.cli import calibrate
from isotruss_ros.core import deform, load_robot, Robot
from isotruss_ros.core.errors import IsotrussError
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
    'too few markers': (measure(ZEROS, np.zeros(N), ['P']), 'joints P: must be 3 or more'),
    'unknown joint': ([Posture(np.zeros(N), {'W': (0.0, 0.0)})], "joint 'W'"),
    'one marker off': (wrong(lambda name, z: z + 0.05j * (name == 'R')), 'R of .* mm off the fit'),
}


@pytest.mark.parametrize('mistake', MISTAKES)
def test_the_mistake_is_named(mistake):
    postures, words = MISTAKES[mistake]
    with pytest.raises(IsotrussError, match=words):
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


ROUND = make_robot()
PULL = {'Z': (10.0, 0.0)}
SMALL = {joint: 1e-3 * np.array(force) for joint, force in PULL.items()}
NOISE = 1e-3
TIMES, ARM = np.arange(0.0, 3.0, 0.01), 0.15


def joints(nodes, noise=0.0, seed=0):
    rng = np.random.default_rng(seed)
    return {
        name: tuple(place + noise * rng.normal(size=2))
        for name, place in zip(NAMES, nodes, strict=False)
    }


def pulled(scale, pull=PULL):
    """Return the joints of a robot so many times as stiff as its model, under a pull."""
    loaded = deform(ROUND.home, {joint: np.array(force) / scale for joint, force in pull.items()})
    nodes = ROUND.home.nodes[: len(NAMES)]
    return joints(nodes + [loaded.displacement(name)[:2] for name in NAMES])


@pytest.mark.parametrize('filed', [1.0, 0.8])
@pytest.mark.parametrize('scale', [0.3, 1.0, 1.5])
def test_fitted_scale_agrees_with_the_true_one_for_any_scale_of_the_file(scale, filed):
    home = Robot(replace(ROUND.description, stiffness_scale=filed)).home
    result = calibrate_stiffness(home, PULL, joints(home.nodes), pulled(scale), 1e-4)
    assert result.scale == pytest.approx(scale, rel=1e-4)


def test_deviation_of_the_scale_is_that_of_noisy_markers():
    nodes, loaded = ROUND.home.nodes, [*pulled(1.0).values()]
    errors = []
    for seed in range(0, 80, 2):
        before, under = joints(nodes, 1e-4, seed), joints(loaded, 1e-4, seed + 1)
        result = calibrate_stiffness(ROUND.home, PULL, before, under, 1e-4)
        errors.append((result.scale - 1.0) / result.deviation)
    assert 0.75 < np.sqrt(np.mean(np.square(errors))) < 1.25


@pytest.mark.parametrize(
    ('pull', 'displaced', 'deviation', 'words'),
    [
        (SMALL, pulled(1.0), 1e-5, r'stiffness 0\.001 times .* is the pull in N'),
        (PULL, pulled(60.0), 1e-3, 'too small; pull harder'),
        (PULL, pulled(1.0) | {'P': (0.05, 0.0)}, 1e-3, 'joint P: moved .* off what one scale'),
    ],
    ids=['pull in kN', 'too small a force', 'inconsistent displacement'],
)
def test_displacements_that_no_scale_explains_are_refused(pull, displaced, deviation, words):
    with pytest.raises(MeasurementError, match=words):
        calibrate_stiffness(ROUND.home, pull, joints(ROUND.home.nodes), displaced, deviation)


def turn(roller, travel, joints=('P', 'R', 'Z'), seed=0):
    """Return how joints are measured to move with a roller."""
    positions = np.zeros(len(ROLLERS))
    positions[ROLLERS.index(roller)] = travel
    moved = ROUND.configuration(positions).nodes - ROUND.home.nodes
    moved = moved + NOISE * np.random.default_rng(seed).normal(size=moved.shape)
    return {name: tuple(moved[NAMES.index(name)]) for name in joints}


@pytest.mark.parametrize('roller', ROLLERS)
@pytest.mark.parametrize(
    ('travel', 'words'),
    [
        (0.02, '^$'),
        (-0.02, 'turned the other way'),
        (0.03, r'turned by \+(2[7-9]|3[0-3])\..* in place of \+20'),
        (0.0, 'no meas'),
    ],
)
def test_three_joints_distinguish_every_roller_and_its_wrong_sign_or_scale(roller, travel, words):
    assert re.search(words, judge_roller(ROUND.home, roller, 0.02, turn(roller, travel), NOISE))


def test_rollers_that_are_swapped_are_named():
    result = judge_roller(ROUND.home, 'south/P', 0.02, turn('east/Q', 0.02), NOISE)
    assert result.startswith('east/Q turned in its place')


def test_a_motion_that_no_single_roller_causes_is_reported():
    moved = {'P': (0.05, 0.0), 'R': (-0.05, 0.0), 'Z': (0.0, 0.05)}
    reported = [judge_roller(ROUND.home, roller, 0.02, moved, NOISE) for roller in ROLLERS]
    assert any('no single roller explains' in sentence for sentence in reported)
    with pytest.raises(MeasurementError, match='no joint was measured: must be some of P, Q'):
        judge_roller(ROUND.home, 'south/P', 0.02, {}, NOISE)


def swing(frequency, damping, noise=0.0):
    """Return the poses of an oscillation of 6 mm along a line that turns as well."""
    rng = np.random.default_rng(3)
    decay, damped = damping * frequency, frequency * np.sqrt(1.0 - damping**2)
    along = 0.006 * np.exp(-decay * TIMES) * np.cos(damped * TIMES + 0.4)
    poses = np.array((0.7, 0.4, 0.2)) + np.outer(along, (0.8, -0.6, 1.0))
    return poses + noise * rng.normal(size=poses.shape) / (1.0, 1.0, ARM)


@pytest.mark.parametrize('damping', [0.02, 0.1, 0.5])
@pytest.mark.parametrize('frequency', [2.5, 9.0, 23.0])
def test_fit_of_an_exact_oscillation_is_exact(frequency, damping):
    result = fit_oscillation(TIMES, swing(frequency, damping), ARM)
    assert result[:2] == pytest.approx((frequency, damping), rel=1e-6)


def test_fit_with_noise_of_one_millimetre_is_within_its_tolerance():
    result = fit_oscillation(TIMES, swing(9.0, 0.1, 0.001), ARM)
    assert result.frequency == pytest.approx(9.0, rel=0.02)
    assert result.damping_ratio == pytest.approx(0.1, rel=0.2)


def test_a_creeping_motion_is_no_oscillation():
    with pytest.raises(MeasurementError, match='not one damped oscillation'):
        fit_oscillation(TIMES, np.outer(TIMES, (0.01, 0.0, 0.0)), ARM)
