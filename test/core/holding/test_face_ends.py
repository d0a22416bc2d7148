# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faces on a tube: wrong offsets do not lift them off, and the loaded tube decides their ends."""

from held_grips import BOX, held, HOME
from isotruss_ros.core import Grip
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
