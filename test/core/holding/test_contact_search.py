# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ends of faces on tubes: grazing ends, loaded tubes and wrong offsets."""

from functools import cache

from held_grips import BOX, held, HOME
from isotruss_ros.core import ConvexObject, Grip, Polygon, settle_grasp
from isotruss_ros.core.estimation.grip_model import attach_model
from nightly import some_now
import numpy as np
import pytest
from robots import preset
from skin_depths import corner_depths

ROBOT = preset('triangle')
TURNED = ROBOT.configuration([0.051, 0.069])
FRICTION, ANGLE = 0.9, 0.5733


@cache
def face_turned_by(milliradians):
    """Return the settled grasp of a polygon whose face turns toward a tube."""
    corners = [(0.068, -0.12), (0.011, 0.281), (-0.235, 0.176), (-0.19, -0.083), (-0.079, -0.192)]
    shape = Polygon(corners, (0.0, 0.09, 0.14, 0.0, 0.09))
    body = ConvexObject(shape, (0.8462, 0.7344, ANGLE + 1e-3 * milliradians))
    return settle_grasp(TURNED, body, FRICTION, members=ROBOT.member_names[1:])


def test_stiffness_and_slip_margin_are_continuous_where_an_end_of_a_face_touches():
    apart, touching = -18.0, -6.0
    for _ in range(12):
        middle = 0.5 * (apart + touching)
        if len(face_turned_by(middle).equilibrium.contacts.members) == 2:
            apart = middle
        else:
            touching = middle
    before, after = face_turned_by(apart), face_turned_by(touching)
    size = np.abs(before.stiffness).max()
    assert after.stiffness == pytest.approx(before.stiffness, abs=1e-3 * size)
    assert after.slip_margin == pytest.approx(before.slip_margin, rel=0.01)


@pytest.mark.parametrize('turns', some_now([range(-18, -5, 2), range(-30, 31)]))
def test_an_end_of_a_face_that_grazes_touches_without_force(turns):
    kinds, poses = [], []
    for turn in turns:
        grasp = face_turned_by(turn)
        grip = grasp.equilibrium
        normal, count = grip.state.normal_forces, len(grip.contacts.members)
        kinds.append(count)
        poses.append(np.array(grasp.pose))
        if count == 3:
            end = int(normal.argmin())
            depth = corner_depths(grip, ROBOT.member_names[grip.contacts.members[end]])
            assert normal[end] == pytest.approx(0.0, abs=1e-9)
            assert grip.state.friction_forces[end] == pytest.approx(0.0, abs=1e-9)
            assert depth[grip.contacts.corners[end]] == pytest.approx(0.0, abs=1e-4)
        else:
            assert grasp.pose.angle == pytest.approx(ANGLE + 1e-3 * turn, abs=1e-9)
    # The end comes into contact once, and the pose does not jump there.
    assert kinds == sorted(kinds)
    assert {2, 3} == set(kinds)
    assert np.abs(np.diff(poses, axis=0)).max() < 5e-3


FACE_FRICTION = 0.8
#: Roller offsets that incline the tubes by half a degree against the face.
OFFSETS = 0.01 * np.random.default_rng(0).normal(size=(7, 6))[[5, 6]]


@pytest.mark.parametrize('offsets', OFFSETS)
def test_wrong_offsets_do_not_lift_a_box_off_its_face(offsets):
    held_box = held(BOX, 0.0)
    grip = Grip(held_box.member_names, held_box.body, FACE_FRICTION)
    config = HOME.moved_to(offsets)
    exact, unsure = attach_model(config, grip), attach_model(config, grip, None, 0.01)
    assert exact.required_friction > FACE_FRICTION > unsure.required_friction
    assert len(unsure.contacts.members) == 3
    assert abs(unsure.pose.angle - grip.body.pose.angle) < np.radians(1.0)
