# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot that stands upright is told by how its joints hang."""

from isotruss_ros.core import deform, load_robot
from isotruss_ros.core.statics.deform import find_sag
import numpy as np
import pytest

ROBOT = load_robot('nine_member')
NAMES = ROBOT.topology.joint_names


def hanging(weight, config=ROBOT.home, noise=1e-3, seed=0):
    """Return measured joints of a robot whose modules have some weight (x, y) [N]."""
    rng = np.random.default_rng(seed)
    bent = deform(config, {}, module_loads=dict.fromkeys(ROBOT.module_names, (*weight, 0.0)))
    places = config.nodes[: len(NAMES)] + noise * rng.normal(size=(len(NAMES), 2))
    return {
        name: tuple(place + bent.displacement(name)[:2])
        for name, place in zip(NAMES, places, strict=True)
    }


@pytest.mark.parametrize('direction', [(0.0, -1.0), (1.0, 0.0)])
@pytest.mark.parametrize('mass', [0.5, 1.5])
def test_weight_and_direction_of_an_upright_robot_are_estimated(direction, mass):
    weight = 9.81 * mass * np.array(direction)
    config = ROBOT.home.moved_to(0.1 * np.array([1.0, -0.5, 0.3, 0.8, -1.0, 0.2]))
    sag = find_sag(config, hanging(weight, config))
    assert sag.is_upright
    assert np.hypot(*(sag.weight - weight)) < 0.25 * np.hypot(*weight)


def test_roller_offsets_and_noise_are_rarely_fitted_as_weight():
    sag, rng = [], np.random.default_rng(0)
    for seed in range(50):
        config = ROBOT.home.moved_to(0.01 * rng.normal(size=6))
        sag.append(find_sag(ROBOT.home, hanging((0.0, 0.0), config, seed=seed)).is_upright)
    assert sum(sag) <= 3


def test_few_joints_have_no_fit():
    joints = dict(list(hanging((0.0, -9.81)).items())[:3])
    assert find_sag(ROBOT.home, joints) is None
