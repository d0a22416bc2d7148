# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The roller offsets, fitted to measured joints."""

from hypothesis import given, settings
from hypothesis import strategies as st
from isotruss_ros.calibration.home import calibrate_home
from isotruss_ros.calibration.home_fit import Posture
from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.core import load_robot
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.robot import Robot
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
NAMES = ROBOT.topology.joint_names
ALL, ENOUGH, FEW = tuple(NAMES), ('Q', 'R', 'Z'), ('P', 'R', 'Z')
N = len(ROBOT.roller_names)


def measure(offsets, readings, joints=ALL, noise=0.0, seed=0):
    """Return the measured postures of a robot with roller offsets."""
    rng = np.random.default_rng(seed)
    postures = []
    for reading in np.atleast_2d(readings):
        nodes = ROBOT.configuration(reading + offsets).nodes + noise * rng.normal(
            size=ROBOT.home.nodes.shape
        )
        postures.append(
            Posture(reading, {name: tuple(nodes[NAMES.index(name)]) for name in joints})
        )
    return postures


def draw_offsets(seed, size=0.015):
    """Return random roller offsets."""
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


SIGNS = np.array([1.0, 1.0, -1.0, 1.0, 1.0, 1.0])
MISTAKES = {
    'markers in mm': (wrong(lambda _, z: 1e3 * z), 'the markers are in mm'),
    'encoders in mm': (wrong(reading=lambda x: 1e3 * x), 'the encoders read in mm'),
    'encoder sign': (
        wrong(reading=lambda x: SIGNS * x),
        'the encoder of east/Q counts the other way',
    ),
    'encoders swapped': (
        wrong(reading=lambda x: x[[3, 1, 2, 0, 4, 5]]),
        'the names of the encoders of south/P and east/R are swapped',
    ),
    'markers swapped': (
        wrong(names={'Q': 'R', 'R': 'Q'}),
        'names of the markers of joints Q and R are swapped',
    ),
    'frame shifted': (
        wrong(lambda _, z: z + 0.3),
        r"the tracker's frame is not the robot's frame: .* \(-0.30\d, .* turned by -?0.0",
    ),
    'frame turned': (
        wrong(lambda _, z: (z - 0.2j) * np.exp(-0.1j)),
        r"the tracker's frame is not .* turned by 5.7 degrees: publish this transform",
    ),
    'one marker off': (
        wrong(lambda name, z: z + 0.05j * (name == 'R')),
        'joint R of posture .: .* mm off the fit of the others',
    ),
}


@pytest.mark.parametrize('mistake', MISTAKES)
def test_the_mistake_is_named(mistake):
    postures, words = MISTAKES[mistake]
    with pytest.raises(MeasurementError, match=words):
        calibrate_home(ROBOT, postures)
