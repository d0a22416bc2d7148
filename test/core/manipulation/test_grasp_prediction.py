# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Grasps between measurements: where the object is after some roller travel, and whether it is."""

from isotruss_ros.core import (
    Configuration,
    ConvexObject,
    GraspError,
    Grip,
    load_robot,
    RollingGrip,
    tangent_center,
)
from isotruss_ros.core.manipulation.grasp import check_members_are_near, predict_grasp
import numpy as np
import pytest

NINE = load_robot('nine_member')
MODULE, DIAMETER, ANGLE = 'north/Z', 0.3, 0.3
GRASP = Grip.at_module(
    NINE, MODULE, ConvexObject.disc(tangent_center(NINE.home, MODULE, DIAMETER, 0.01), DIAMETER)
)
BEFORE = 0.01 * np.array([1.0, -2.0, 0.5, 1.5, -1.0, 2.0])
TRAVEL = 0.01 * np.array([2.0, -1.0, -1.0, 2.5, 1.0, -1.0])


def test_without_travel_everything_stays():
    none = np.zeros(6)
    config, grasp, angle = predict_grasp(NINE.home, GRASP, ANGLE, none, none)
    assert config.points == pytest.approx(NINE.home.points, abs=1e-12)
    assert (*grasp.center, angle) == pytest.approx((*GRASP.center, ANGLE), abs=1e-12)


@pytest.mark.parametrize('before', [np.zeros(6), BEFORE], ids=['at once', 'later'])
def test_the_object_is_held_from_when_it_was_measured(before):
    there = NINE.home.moved_to(before)
    center = tangent_center(there, MODULE, DIAMETER, 0.01)
    measured = Grip.at_module(ROBOT, MODULE, ConvexObject.disc(center, DIAMETER))
    config, grasp, angle = predict_grasp(NINE.home, measured, ANGLE, before, TRAVEL)
    ahead = NINE.home.moved_to(TRAVEL)
    pose = RollingGrip.attach(there, measured, ANGLE).pose(ahead)
    assert config.points == pytest.approx(ahead.points, abs=1e-9)
    assert (*grasp.center, angle) == pytest.approx(pose, abs=1e-9)
    moved = np.subtract((*grasp.center, angle), (*center, ANGLE))
    assert np.abs(moved).min() > 2e-3
    assert (grasp.module, grasp.diameter) == (MODULE, DIAMETER)


def beside(gap):
    """Return a grasp at the same place with an object smaller by twice a gap from touching [m]."""
    touching = tangent_center(NINE.home, MODULE, DIAMETER)
    return Grip.at_module(ROBOT, MODULE, ConvexObject.disc(touching, DIAMETER - 2.0 * gap))


def test_members_are_near_up_to_the_diameter_of_a_tube():
    tube = NINE.description.tube_diameter
    check_members_are_near(NINE.home, GRASP)
    check_members_are_near(NINE.home, beside(0.999 * tube))
    message = rf'{MODULE} does not hold .* are {1.001 * tube:.3g} m and {1.001 * tube:.3g} m'
    with pytest.raises(GraspError, match=message):
        check_members_are_near(NINE.home, beside(1.001 * tube))


def test_a_member_is_near_only_where_it_is():
    """Beyond its end the line goes on, the tube does not."""
    names = {name: i for i, name in enumerate(NINE.node_names)}
    points = NINE.home.points.copy()
    # A right angle: B -> B' along x from 0.1 to 1 m, C -> C' along y from 0.1 to 0.3 m.
    corner = [names[f'north/{node}'] for node in ('Z/B', 'R/C', 'Z/C', 'P/B')]
    points[corner] = [0.1, 1.0, 0.1j, 0.3j]
    config = Configuration(NINE, NINE.home.roller_positions, points)
    tube = NINE.description.tube_diameter
    radius, reach = 0.1, 0.1 + 0.5 * tube
    near = Grip.at_module(ROBOT, 'north/Z', ConvexObject.disc((reach, 0.3), 2.0 * radius))
    check_members_are_near(
        config,
        Grip.at_module(ROBOT, 'north/Z', ConvexObject.disc((reach, reach), 2.0 * radius)),
    )
    with pytest.raises(GraspError, match=f'are {0.3 - reach:.3g} m and 0 m, at most'):
        check_members_are_near(config, near)
    past = np.hypot(reach, 0.4) - reach
    with pytest.raises(GraspError, match=f'are {0.7 - reach:.3g} m and {past:.3g} m, at most'):
        check_members_are_near(
            config,
            Grip.at_module(ROBOT, 'north/Z', ConvexObject.disc((reach, 0.7), 2.0 * radius)),
        )
