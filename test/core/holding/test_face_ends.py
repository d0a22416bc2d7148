# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faces on a tube: wrong offsets do not lift them off, and the loaded tube decides their ends."""

from held_grips import BOX, held, HOME
from isotruss_ros.core import ConvexObject, Grip, Polygon, settle_grasp
from isotruss_ros.core.estimation.grip_model import attach_model
import numpy as np
import pytest

FRICTION = 0.8
#: Roller offsets that incline the tubes by half a degree against the face.
OFFSETS = 0.01 * np.random.default_rng(0).normal(size=(7, 6))[[5, 6]]


@pytest.mark.parametrize('offsets', OFFSETS)
def test_wrong_offsets_do_not_lift_a_box_off_its_face(offsets):
    held_box = held(BOX, 0.0)
    grip = Grip(held_box.member_names, held_box.body, FRICTION)
    config = HOME.moved_to(offsets)
    exact, unsure = attach_model(config, grip), attach_model(config, grip, None, 0.01)
    assert exact.required_friction > FRICTION > unsure.required_friction
    assert len(unsure.contacts.members) == 3
    assert abs(unsure.pose.angle - grip.body.pose.angle) < np.radians(1.0)


@pytest.mark.parametrize(
    ('travel', 'pose', 'corners'),
    [
        ([0.0009, 0.029, -0.4085, -0.1636, -0.269, 0.2216], (0.5432, 0.2766, 1.7943), [2, 1]),
        ([0.0057, 0.0345, -0.4065, -0.1663, -0.2677, 0.2223], (0.5418, 0.2741, 1.7886), [2, 3, 1]),
    ],
)
def test_a_nearly_parallel_face_presses_where_the_loaded_tube_is(travel, pose, corners):
    """The elastic plant holds the box so; the straight tube is penetrated by corner 3 alone."""
    outline = [(-0.12, -0.1), (0.12, -0.1), (0.12, 0.1), (-0.12, 0.1)]
    config, body = HOME.robot.configuration(travel), ConvexObject(Polygon(outline, 0.02), pose)
    settled = settle_grasp(config, body, FRICTION)
    assert settled.held, settled.reason
    members = settled.equilibrium.member_names
    for grip in (settled.equilibrium, attach_model(config, Grip(members, body, FRICTION))):
        assert grip.contacts.corners.tolist() == corners
