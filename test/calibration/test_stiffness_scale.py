# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The stiffness of the tubes against the model, from a pull at the empty robot."""

from dataclasses import replace

from carries import make_robot
from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.calibration.stiffness_scale import calibrate_stiffness
from isotruss_ros.core import deform, Robot
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
from mujoco_worlds import needs_mujoco
from nightly import some_now
import numpy as np
import pytest

ROBOT = make_robot()
NAMES, PULL = ROBOT.topology.joint_names, {'Z': (10.0, 0.0)}
#: Of one second of markers of 1 mm at 20 Hz [m].
DEVIATION = 1e-3 / np.sqrt(20.0)


def joints(nodes, noise=0.0, seed=0):
    """Return measured joints."""
    rng = np.random.default_rng(seed)
    return {
        name: tuple(place + noise * rng.normal(size=2))
        for name, place in zip(NAMES, nodes, strict=False)
    }


def pulled(scale, pull=PULL):
    """Return the joints of a robot so many times as stiff as its model, under a pull."""
    loaded = deform(ROBOT.home, {joint: np.array(force) / scale for joint, force in pull.items()})
    nodes = ROBOT.home.nodes[: len(NAMES)]
    return joints(nodes + [loaded.displacement(name)[:2] for name in NAMES])


@pytest.mark.parametrize('filed', [1.0, 0.8])
@pytest.mark.parametrize('scale', [0.3, 1.0, 1.5])
def test_fitted_scale_agrees_with_the_true_one_for_any_scale_of_the_file(scale, filed):
    home = Robot(replace(ROBOT.description, stiffness_scale=filed)).home
    result = calibrate_stiffness(home, PULL, joints(home.nodes), pulled(scale), 1e-4)
    assert result.scale == pytest.approx(scale, rel=1e-4)


def test_deviation_of_the_scale_is_that_of_noisy_markers():
    nodes, loaded = ROBOT.home.nodes, [*pulled(1.0).values()]
    errors = []
    for seed in range(0, 80, 2):
        before, under = joints(nodes, 1e-4, seed), joints(loaded, 1e-4, seed + 1)
        result = calibrate_stiffness(ROBOT.home, PULL, before, under, 1e-4)
        errors.append((result.scale - 1.0) / result.deviation)
    assert 0.75 < np.sqrt(np.mean(np.square(errors))) < 1.25


@needs_mujoco
@pytest.mark.parametrize('scale', some_now([0.6, 1.5]))
def test_ten_newtons_at_the_top_determine_the_scale_in_mujoco_within_five_percent(scale):
    plant = MujocoPlant(make_robot(stiffness=scale), None, PlantOptions())
    plant.settle(2.0)
    before = joints(plant.nodes, DEVIATION, 1)
    plant.load_joint('Z', PULL['Z'])
    plant.settle(3.0)
    result = calibrate_stiffness(
        ROBOT.home, PULL, before, joints(plant.nodes, DEVIATION, 2), DEVIATION
    )
    assert result.scale == pytest.approx(scale, rel=0.05)
    assert abs(result.scale - scale) < 3.0 * result.deviation


SMALL = {joint: 1e-3 * np.array(force) for joint, force in PULL.items()}


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
        calibrate_stiffness(ROBOT.home, pull, joints(ROBOT.home.nodes), displaced, deviation)
