# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Simulated objects where they lie, and what is taken where nothing is said."""

import math

from grips import gripped
from isotruss_ros.core import ElasticObject, Grip, HoldStatus, RollerFaults
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.simulation.rigid_object import RigidObject
import numpy as np
import pytest

CONFIG, CYLINDER = gripped(35.0, squeeze=0.1)


@pytest.mark.parametrize(
    ('angle', 'kept'),
    [(0.0, 0.0), (-3.0, -3.0), (4.0, 4.0 - 2.0 * math.pi), (13.0, 13.0 - 4 * math.pi)],
)
def test_angles_are_kept_within_half_a_turn(angle, kept):
    body = CYLINDER.moved_to((*CYLINDER.pose[:2], angle))
    for lying in (RigidObject(body, 0.5), ElasticObject(body, 0.5)):
        assert lying.pose(CONFIG) == pytest.approx((*CYLINDER.pose[:2], kept), abs=1e-12)


def test_an_elastic_object_is_as_stiff_as_its_model():
    simulated, soft = ElasticObject(CYLINDER, 0.5), ElasticObject(CYLINDER, 0.5, 0.05)
    for one in (simulated, soft):
        one.follow(CONFIG)
    model = attach_grip(CONFIG, CYLINDER)
    assert simulated.grasp.squeeze == pytest.approx(model.squeeze, rel=1e-6)
    # What of it there is comes from softer tubes.
    assert soft.grasp is None or soft.grasp.squeeze < 0.2 * model.squeeze


def test_in_one_long_step_an_object_slips_where_it_does_in_many():
    rows = grip_jacobian(CONFIG, Grip.at_module(CONFIG.robot, 'north/Z', CYLINDER))
    travel = np.linalg.pinv(rows) @ [-0.0155, 0.0401, -0.1125, 0.0749]
    angles = []
    for steps in (1, 64):
        simulated = ElasticObject(CYLINDER, 0.4)
        simulated.follow(CONFIG)
        for part in range(1, steps + 1):
            there = CONFIG.moved_to(CONFIG.roller_positions + part / steps * travel)
            simulated.follow(there)
            if simulated.grasp is None:
                break
        assert simulated.dropped is HoldStatus.SLIPS
        # Members push what slips, and do not turn it.
        angles.append(simulated.pose(there).angle)
    assert angles[1] == pytest.approx(-0.057, abs=1e-3)
    assert angles[0] == pytest.approx(angles[1], abs=2e-3)


def test_any_friction_and_stiffness_but_none_are_taken():
    ElasticObject(CYLINDER, 0.0, 1e-6)
    ElasticObject(CYLINDER, 0.05, 0.05)
    for friction, scale in ((-1e-9, 1.0), (0.5, 0.0), (0.5, -0.1)):
        with pytest.raises(GraspError, match='must not be negative'):
            ElasticObject(CYLINDER, friction, scale)


def test_rollers_without_faults_are_perfect():
    assert vars(RollerFaults()) == {
        'speed_limit': math.inf,
        'noise': 0.0,
        'stuck': frozenset(),
        'slip': 0.0,
    }
