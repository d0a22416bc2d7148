# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Obstacles in MuJoCo: contacts of robot and object with each are counted."""

from dataclasses import replace

from isotruss_ros.core import ConvexObject, Disc, Ellipse, Obstacle, Polygon
from isotruss_ros.core.model.obstacle import HalfPlane
from isotruss_ros.mujoco_plant.options import PlantError
from isotruss_ros.mujoco_plant.plant import MujocoPlant
from mujoco_worlds import needs_mujoco
import numpy as np
import pytest
from robots import preset

ROBOT = preset('nine_member')
BODY = ConvexObject.disc((0.716, 0.45), 0.3)
SHAPES = [
    Disc(0.1),
    Ellipse((0.05, 0.1)),
    Polygon(((-0.05, -0.1), (0.05, -0.1), (0.05, 0.1), (-0.05, 0.1))),
]


@needs_mujoco
@pytest.mark.parametrize('shape', SHAPES, ids=lambda shape: type(shape).__name__)
@pytest.mark.parametrize('gap', [0.01, -0.002])
def test_contacts_with_an_obstacle_are_counted_by_its_name(shape, gap):
    reach = 0.15 + 0.05
    near = Obstacle('near', ConvexObject(shape, (0.716 + reach + gap, 0.45, 0.0)))
    far = Obstacle('far', ConvexObject(shape, (5.0, 5.0, 0.0)))
    plant = MujocoPlant(ROBOT, BODY, obstacles=[far, near])
    plant.advance(0.02, [0.0] * len(ROBOT.roller_names))
    touched = {name for name, count in plant.obstacle_contacts.items() if count}
    assert touched == (set() if gap > 0.0 else {'near'})


@needs_mujoco
def test_wall_stops_an_object_that_is_pulled_toward_it():
    """The robot is far away, at x < 2.3 m."""
    wall = Obstacle('wall', ConvexObject(HalfPlane(), (2.86, 0.0, np.pi)))
    plant = MujocoPlant(ROBOT, BODY.moved_to((2.7, 0.5, 0.0)), obstacles=[wall])
    plant.pull((5.0, 0.0, 0.0))
    plant.settle(1.0)
    assert plant.object_pose().x == pytest.approx(2.71, abs=2e-3)
    assert plant.obstacle_contacts['wall'] > 10


@needs_mujoco
def test_moved_obstacle_touches_the_object():
    post = Obstacle('post', ConvexObject.disc((3.0, 0.45), 0.1))
    plant = MujocoPlant(ROBOT, BODY, obstacles=[post])
    plant.settle(0.02)
    assert not plant.obstacle_contacts
    plant.move_obstacles([replace(post, body=post.body.moved_to((0.716 + 0.198, 0.45, 0.3)))])
    plant.settle(0.02)
    assert plant.obstacle_contacts['post']
    with pytest.raises(PlantError, match='obstacles: must be those of the plant, post'):
        plant.move_obstacles([])
