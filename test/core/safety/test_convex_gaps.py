# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Distances between the robot and a convex object at rest, and how rollers change them."""

from isotruss_ros.core import (
    ConvexObject,
    Disc,
    Ellipse,
    load_robot,
    Polygon,
)
from isotruss_ros.core.safety.distances import collision_model
import numpy as np
import pytest

HOME = load_robot('nine_member').home
BOX = Polygon([(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)], corner_radius=0.02)
SHAPES = [BOX, Ellipse((0.2, 0.12)), Disc(0.3), Polygon([(0.0, 0.0), (0.3, 0.05), (0.1, 0.25)])]


@pytest.mark.parametrize('shape', SHAPES)
def test_distances_of_the_robot_change_as_differences_say(shape):
    body, rng = ConvexObject(shape, (0.72, 0.48, 0.33)), np.random.default_rng(2)
    model, step = collision_model(HOME.robot), 1e-6
    by_rollers = model.body_distances(HOME, body)[1] @ HOME.node_jacobian
    for _ in range(3):
        move = rng.normal(size=len(HOME.roller_positions))
        ahead, behind = (
            model.body_distances(HOME.moved_to(HOME.roller_positions + sign * step * move), body)
            for sign in (1, -1)
        )
        change = (ahead[0] - behind[0]) / (2.0 * step)
        assert by_rollers @ move == pytest.approx(change, abs=1e-4)
