# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Far ends of faces: they close where their gap does, and wrong offsets do not open them."""

from held_grips import BOX, held, HOME
from isotruss_ros.core import ConvexObject, Grip, Polygon, settle_grasp, solve_twist
from isotruss_ros.core.estimation.grip_model import attach_model
from isotruss_ros.core.holding.roll_grip import roll_grip
import numpy as np
import pytest
from skin_depths import hidden_depth

FRICTION = 0.8
#: Roller offsets that incline the tubes by half a degree against the face.
OFFSETS = 0.01 * np.random.default_rng(0).normal(size=(7, 6))[[5, 6]]


def test_a_face_closes_where_the_gap_of_its_far_end_does():
    grip, counts = held(BOX, -0.05), []
    for _ in range(10):
        command = solve_twist(grip.config, grip.touching(FRICTION), np.array([0.0, 0.0, 0.01]))
        travel = grip.config.roller_positions + command.roller_velocities
        grip = roll_grip(grip, grip.config.moved_to(travel))
        assert hidden_depth(grip) < 1e-4
        counts.append(len(grip.contacts.members))
    assert {2, 3} == set(counts)


@pytest.mark.parametrize('offsets', OFFSETS)
def test_wrong_offsets_do_not_lift_a_box_off_its_face(offsets):
    held_box = held(BOX, 0.0)
    assert len(held_box.contacts.members) == 3
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
    found = settle_grasp(config, body, FRICTION)
    assert found.held, found.reason
    members = found.equilibrium.member_names
    for grip in (found.equilibrium, attach_model(config, Grip(members, body, FRICTION))):
        assert grip.contacts.corners.tolist() == corners
