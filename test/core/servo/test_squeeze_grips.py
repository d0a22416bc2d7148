# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The squeeze and the pose of any convex object between any members, on the elastic plant."""

import math

from held_grips import APART, BOX, HOME, numbers
from isotruss_ros.core import Disc, Ellipse, Grip, place_between, Polygon, Pose, Status
from isotruss_ros.core.estimation.state_estimate import is_squeeze_known
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.servo.squeeze_control import SqueezeControl, SqueezeSettings
from nightly import some_now
import numpy as np
import pytest
from squeeze_loop import SqueezeLoop

#: At home three members of three tubes close next to nothing around a disc.
OBLIQUE = HOME.moved_to(HOME.roller_positions + np.array([0.1, -0.1, 0.0, 0.1, -0.1, 0.05]))
#: The two that meet at a module.
CORNER = ('north/Z-R', 'north/P-Z')
AROUND = ('south/P-Q', 'east/Q-R', 'north/R-P')
FRICTION = 1.2


def loop_of(shape, angle, members, more=1.0, config=HOME, **settings):
    """Return the loop of an object between members."""
    grip = place_between(config, members, shape, angle=angle, indentation=0.015)
    body = attach_grip(config, grip.body, numbers(members)).body
    return SqueezeLoop(config, Grip(members, body, FRICTION), more=more, **settings)


@pytest.mark.parametrize(
    ('shape', 'angle', 'members'),
    some_now([(BOX, 0.2, APART), (Ellipse((0.25, 0.2)), 1.0, APART), (BOX, 0.2, AROUND[:2])]),
)
def test_pose_and_squeeze_of_a_grip_follow_their_references(shape, angle, members):
    loop = loop_of(shape, angle, members)
    loop.run((0.01, -0.01, 0.03), 0.4)
    assert max(loop.errors) < 2e-4
    assert max(loop.turned) < math.radians(0.1)
    assert loop.object.grasp.squeeze == pytest.approx(loop.target, rel=5e-3)


@pytest.mark.parametrize('noise', some_now([2e-3, 0.0]))
def test_a_box_that_lies_on_a_face_stays_held(noise):
    """Its rows are not those of the corner on which it would be between straight members."""
    shape = Polygon([(-0.08, -0.06), (0.08, -0.06), (0.08, 0.06), (-0.08, 0.06)], 0.02)
    loop = loop_of(shape, 2.1, CORNER, 1.05)
    assert len(loop.object.grasp.contacts.members) == 3
    loop.noise = noise
    loop.run((0.01, 0.01, 0.05), 0.5)
    assert loop.object.grasp.squeeze == pytest.approx(loop.target, rel=0.03 + 10.0 * noise)
    assert loop.errors[-1] < 1e-3 + noise


@pytest.mark.parametrize(
    ('shape', 'angle', 'members', 'config', 'more', 'duration'),
    some_now([(Disc(0.83), 0.0, AROUND, OBLIQUE, 1.1, 0.9), (BOX, 0.2, APART, HOME, 1.2, 1.3)]),
)
def test_a_rising_target_closes_in_place(shape, angle, members, config, more, duration):
    loop = loop_of(shape, angle, members, more, config)
    loop.run((0.0, 0.0, 0.0), duration)
    assert loop.object.grasp.squeeze == pytest.approx(loop.target, rel=5e-3)
    assert loop.errors[-1] < 2e-4


def test_an_object_at_rest_on_a_face_is_not_told_as_unreachable():
    shape = Polygon([(-0.08, -0.06), (0.08, -0.06), (0.08, 0.06), (-0.08, 0.06)], 0.02)
    loop = loop_of(shape, 0.5, CORNER)
    loop.run((0.0, 0.0, 0.0), 5 * loop.period)
    assert set(loop.statuses) == {Status.OK}


def test_a_step_of_the_pose_by_new_contacts_is_not_fed_forward():
    """The box comes to lie on a face, and its pose changes by a step."""
    shape = Polygon([(-0.12, -0.1), (0.12, -0.1), (0.12, 0.1), (-0.12, 0.1)], 0.02)
    loop, drifts = loop_of(shape, 0.62, CORNER), [0.0]
    while len(loop.control.belief.grasp.contacts.members if loop.control.belief else ()) < 3:
        assert len(drifts) < 20
        loop.run((0.0, 0.0, -0.2), loop.period)
        drifts.append(np.abs(loop.control.belief.cache.drift).max())
    assert drifts[-1] == 0.0 < drifts[-2]


@pytest.mark.parametrize('away', some_now([-0.03, -0.02, 0.03]))
@pytest.mark.parametrize(
    ('zeros', 'gripped', 'held'), [(1e-2, True, True), (1e-2, False, False), (1e-3, True, False)]
)
def test_gripped_object_is_held_where_only_wrong_offsets_explain_its_pose(
    away, zeros, gripped, held
):
    """Without a balance at the measured pose, the squeeze is the desired one, but unknown."""
    grip = place_between(HOME, CORNER, Disc(0.2), indentation=0.01)
    model = attach_grip(HOME, grip.body)
    pose = Pose(model.pose.x, model.pose.y + away, model.pose.angle)
    control = SqueezeControl(SqueezeSettings(model.squeeze, zero_deviation=zeros))
    measured = Grip(CORNER, grip.body.moved_to(pose), FRICTION)
    for _ in range(4):
        control.follow(HOME, measured, 0.02, gripped=gripped)
    assert (control.belief is not None) is held
    if held:
        assert control.belief.squeeze == pytest.approx(model.squeeze, rel=0.1)
        belief = control.belief
        assert not is_squeeze_known(belief.squeeze, belief.squeeze_deviation)
        assert control.belief.pose == pytest.approx(np.array(pose), abs=1e-3)
