# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A rigid object lies until members grip it, rolls with them, and is let go or lost."""

from types import SimpleNamespace

from grips import backed_off, closed_to, gripped
from held_grips import APART, box_between
from isotruss_ros.core import (
    ConvexObject,
    Pose,
    RigidObject,
    RollerFaults,
    settle_grasp,
    SimulatedRobot,
)
from isotruss_ros.core.kinematics.depths import member_depths
from isotruss_ros.core.manipulation.grip import find_contacts
from isotruss_ros.core.simulation.rigid_object import pressing_members
import numpy as np
import pytest

CLOSED, CYLINDER = gripped(35.0, squeeze=0.06)
ROBOT = CLOSED.robot
FRICTION, ANGLE = 0.5, 0.7
N = len(ROBOT.roller_names)
LIES = Pose(*CYLINDER.pose[:2], ANGLE)
GRASPING = {'north/P-Z', 'north/Z-R'}


@pytest.fixture(scope='module')
def plan():
    """Return roller positions from apart, by the first touch, to a grip."""
    approach = backed_off(CLOSED, CYLINDER, 0.1)[::-1]
    touch = next(
        i for i, config in enumerate(approach) if np.sort(member_depths(config, CYLINDER))[-2] > 0
    )
    return SimpleNamespace(
        start=approach[0],
        path=[config.roller_positions for config in approach[1:]],
        touch=touch - 2,
        config=approach[-1],
    )


class Scene:
    """A simulated robot and an object beside it."""

    def __init__(self, start):
        self.object = RigidObject(CYLINDER.moved_to(LIES), FRICTION)
        self.robot = SimulatedRobot(start, self.object, RollerFaults())

    def go(self, place, duration=1.0, steps=5):
        """Bring the rollers somewhere, and do not stop."""
        self.robot.command((np.asarray(place) - self.robot.roller_positions) / duration)
        for _ in range(steps):
            self.robot.advance(duration / steps)

    def rest(self):
        """Let the rollers come to rest."""
        self.robot.stop()
        self.robot.advance(0.01)

    def grip(self, plan):
        """Go the way to a grasp and rest there."""
        for place in plan.path:
            self.go(place, steps=1)
        assert self.object.rolling is None
        self.rest()
        assert set(self.object.rolling.grip.members) == GRASPING


def test_is_gripped_at_the_end_of_a_planned_way_and_not_before(plan):
    scene = Scene(plan.start)
    for place in plan.path[: plan.touch]:
        scene.go(place)
        scene.rest()
        assert scene.object.rolling is None
        assert scene.robot.object_pose == LIES
    scene.grip(plan)
    # Where it is now it is in equilibrium.
    there = ConvexObject.disc(scene.robot.object_pose[:2], CYLINDER.shape.diameter)
    settled = settle_grasp(scene.robot.config, there, FRICTION)
    assert settled.held
    assert settled.displacement == pytest.approx(0.0, abs=1e-9)
    assert scene.robot.object_pose == pytest.approx(LIES, abs=0.01)


def test_no_grip_begins_while_the_rollers_move(plan):
    scene = Scene(plan.start)
    for place in plan.path:
        scene.go(place)
    last = scene.robot.roller_positions
    assert scene.object.rolling is None
    for _ in range(3):  # to and fro, without a rest
        scene.go(last + 1e-6)
        scene.go(last)
        assert scene.object.rolling is None
    assert scene.robot.object_pose == LIES


def test_stays_in_the_grip_over_rests_while_it_is_pressed(plan):
    scene = Scene(plan.start)
    scene.grip(plan)
    before, gripped = scene.robot.object_pose, scene.robot.roller_positions
    for off in (2e-3, -2e-3, 0.0):
        scene.go(gripped + off * np.linspace(-1.0, 1.0, N))
        scene.rest()
        assert set(scene.object.rolling.grip.members) == GRASPING
    assert scene.robot.object_pose == pytest.approx(before, abs=1e-9)


def test_the_object_is_free_after_the_grip_opens(plan):
    scene = Scene(plan.start)
    scene.grip(plan)
    opened = closed_to(CLOSED, 50.0, CYLINDER.shape.diameter).roller_positions
    scene.go(opened)
    assert scene.object.rolling is not None  # until somebody looks
    left = scene.robot.object_pose
    scene.rest()
    assert scene.object.rolling is None
    assert scene.robot.object_pose == pytest.approx(left)
    left = scene.robot.object_pose
    scene.go(opened + 1e-3)
    scene.rest()
    assert scene.robot.object_pose == left


@pytest.mark.parametrize(('angle', 'kept'), [(0.0, 0.0), (-3.0, -3.0), (4.0, 4.0 - 2.0 * np.pi)])
def test_angle_is_preserved_and_within_half_a_turn(plan, angle, kept):
    lying = RigidObject(CYLINDER.moved_to((*CYLINDER.pose[:2], angle)), FRICTION)
    assert lying.pose(ROBOT.home) == pytest.approx((*CYLINDER.pose[:2], kept))
    lying.follow(plan.config)
    assert set(lying.rolling.grip.members) == GRASPING
    assert lying.pose(plan.config) == pytest.approx((*CYLINDER.pose[:2], kept), abs=0.01)


def lying(body, friction=1.0):
    """Return a robot at home that has come to rest, and its object."""
    free = RigidObject(body, friction)
    robot = SimulatedRobot(ROBOT.home, free, RollerFaults())
    robot.advance(0.0)
    return robot, free


def test_names_the_members_that_press_deepest_first():
    grip = box_between()
    assert set(pressing_members(ROBOT.home, grip.body)) == set(APART)
    assert pressing_members(ROBOT.home, box_between(depth=-0.01).body) == ()
    x, y, angle = grip.body.pose
    toward = find_contacts(ROBOT.home, grip)[0].normal
    deeper = grip.body.moved_to((x + 0.002 * toward.real, y + 0.002 * toward.imag, angle))
    assert pressing_members(ROBOT.home, deeper) == APART


@pytest.mark.parametrize(
    ('center', 'diameter'), [((0.99, -0.1), 2.0), ((-0.4, -0.49), 1.0), ((-0.48, 0.52), 10.0)]
)
def test_no_two_members_press_on_an_object_that_tubes_lie_on(center, diameter):
    """The contact of such an object would take minutes to compute."""
    assert len(pressing_members(ROBOT.home, ConvexObject.disc(center, diameter))) < 2


@pytest.mark.parametrize(
    ('depth', 'own', 'friction', 'held'),
    [
        (0.01, None, 1.0, True),
        (-0.005, None, 1.0, False),
        (0.01, None, 0.05, False),
        (0.01, 0.05, 1.0, False),
        (0.01, 1.0, 0.05, True),
    ],
)
def test_pressing_members_hold_the_object_if_friction_suffices(depth, own, friction, held):
    body = box_between(depth=depth).body
    body = ConvexObject(body.shape, body.pose, friction=own)
    robot, free = lying(body, friction)
    assert (free.rolling is not None) is held
    assert not held or set(free.rolling.grip.members) == set(APART)
    went = np.hypot(*np.subtract(robot.object_pose, body.pose)[:2])
    assert (0.0 < went < 0.01) == held
    if not held:
        robot.command([0.0, 0.02, 0.0, 0.0, 0.0, 0.0])
        robot.advance(0.1)
        assert robot.object_pose == pytest.approx(body.pose)
