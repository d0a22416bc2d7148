# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Squeeze and pose of convex objects between any members, on the elastic plant."""

from held_grips import APART, AROUND, BOX, HOME, numbers
from isotruss_ros.core import Disc, Ellipse, Grip, place_between, Polygon, solve_twist, Status
from isotruss_ros.core.estimation.grip_belief import GripBelief
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.contact_search import measure_gaps
from isotruss_ros.core.servo.squeeze_law import find_correction
from nightly import some_now
import numpy as np
import pytest
from squeeze_loop import SqueezeLoop

#: At home three members of three tubes close next to nothing around a disc.
OBLIQUE = HOME.moved_to(HOME.roller_positions + np.array([0.1, -0.1, 0.0, 0.1, -0.1, 0.05]))
#: The two that meet at a module.
CORNER = ('north/Z-R', 'north/P-Z')
LOW_BOX = Polygon([(-0.12, -0.1), (0.12, -0.1), (0.12, 0.1), (-0.12, 0.1)], 0.02)
SMALL_BOX = Polygon([(-0.08, -0.06), (0.08, -0.06), (0.08, 0.06), (-0.08, 0.06)], 0.02)


def loop_of(shape, angle, members, more=1.0, config=HOME, **settings):
    """Return the loop of an object between members."""
    grip = place_between(config, members, shape, angle=angle, indentation=0.015)
    body = attach_grip(config, grip.body, numbers(members)).body
    return SqueezeLoop(config, Grip(members, body, 1.2), more=more, **settings)


@pytest.mark.parametrize(
    ('shape', 'angle', 'members'),
    some_now([(BOX, 0.2, APART), (Ellipse((0.25, 0.2)), 1.0, APART), (BOX, 0.2, AROUND[:2])]),
)
def test_pose_and_squeeze_of_a_grip_follow_their_references(shape, angle, members):
    loop = loop_of(shape, angle, members)
    loop.run((0.01, -0.01, 0.03), 0.4)
    distance, turn = loop.largest_error()
    assert distance < 2e-4
    assert turn < 2e-3
    assert loop.squeeze == pytest.approx(loop.target, rel=5e-3)


@pytest.mark.parametrize('noise', some_now([2e-3, 0.0]))
def test_a_box_that_lies_on_a_face_stays_held(noise):
    """Its rows are not those of the corner on which it would be between straight members."""
    loop = loop_of(SMALL_BOX, 2.1, CORNER, 1.05, noise=noise)
    assert len(loop.object.grasp.contacts.members) == 3
    loop.run((0.01, 0.01, 0.05), 0.5)
    assert loop.squeeze == pytest.approx(loop.target, rel=0.03 + 10.0 * noise)
    assert loop.final_error() < 1e-3 + noise


@pytest.mark.parametrize(
    ('shape', 'angle', 'members', 'config', 'more', 'duration'),
    some_now([(Disc(0.83), 0.0, AROUND, OBLIQUE, 1.1, 0.9), (BOX, 0.2, APART, HOME, 1.2, 1.3)]),
)
def test_a_rising_target_closes_in_place(shape, angle, members, config, more, duration):
    loop = loop_of(shape, angle, members, more, config)
    loop.run((0.0, 0.0, 0.0), duration)
    assert loop.squeeze == pytest.approx(loop.target, rel=5e-3)
    assert loop.final_error() < 1e-3


def test_an_object_at_rest_on_a_face_is_not_told_as_unreachable():
    loop = loop_of(SMALL_BOX, 0.5, CORNER)
    loop.run((0.0, 0.0, 0.0), 5 * loop.period)
    assert set(loop.statuses) <= {Status.OK, Status.IDLE}


def test_a_step_of_the_pose_by_new_contacts_does_not_move_the_rollers():
    """The box comes to lie on a face."""
    body = place_between(HOME, CORNER, LOW_BOX, angle=0.62, indentation=0.015).body
    held = attach_grip(HOME, body, numbers(CORNER))
    belief = GripBelief.of(held, Grip(CORNER, held.body, 1.2), EstimatorSettings())
    config = belief.held.config
    for _ in range(9):
        assert len(belief.held.contacts.members) == 2
        touching = belief.held.touching(1.2)
        travel = 0.02 * solve_twist(config, touching, (0.02, 0.0, -0.2)).roller_velocities
        config = config.moved_to(config.roller_positions + travel)
        belief, _ = belief.followed(config, 0.02, None)
    assert len(belief.held.contacts.members) == 3
    correction = find_correction(belief, belief.regulated[:3], 0.6, 0.02)
    assert not solve_twist(config, belief.cache.grip, correction).roller_velocities.any()


@pytest.mark.parametrize('twist', some_now([((0.02, 0.0, -0.2),), ((0.0, 0.02, -0.1),)]))
def test_the_velocity_does_not_jump_where_a_face_comes_to_lie_on_a_member(twist):
    loop, poses = loop_of(LOW_BOX, 0.62, CORNER), []
    for share in np.linspace(0.0, 1.0, 12).tolist() + 18 * [1.0]:
        loop.cycle(share * np.array(twist))
        poses.append(loop.plant.object_pose[:2])
    velocities = np.diff(poses, axis=0) / loop.period
    assert np.hypot(*np.diff(velocities, axis=0).T).max() < 3e-3
    grip = measure_gaps(loop.object.grasp, 1.2)
    assert min(gap.width for gap in grip.gaps) < 3e-3  # it lies on the member, but for this gap
