# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""An object that lies free until it is gripped, goes with the grip then, and lies free again."""

from types import SimpleNamespace

from grips import backed_off, closed_to, gripped
from hypothesis import given
from isotruss_ros.core import (
    analyze_grasp,
    ConvexObject,
    FreeObject,
    GraspError,
    Pose,
    RollerFaults,
    settle_grasp,
    SimulatedRobot,
    tangent_center,
)
from isotruss_ros.core.grasping.depths import member_depths
from isotruss_ros.core.simulation import free_object as loose_object
from isotruss_ros.core.simulation.free_object import grip_module
import numpy as np
import pytest
from robots import examples, generators, random_robot, random_state, side_ends

CLOSED, CYLINDER = gripped(35.0, squeeze=0.06)
ROBOT = CLOSED.robot
FRICTION, ANGLE = 0.5, 0.7
N = len(ROBOT.roller_names)
LIES = Pose(*CYLINDER.center, ANGLE)


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
        grasp=SimpleNamespace(module='north/Z'),
    )


class Scene:
    """A simulated robot and an object beside it."""

    def __init__(self, start=ROBOT.home, friction=FRICTION, **faults):
        self.object = FreeObject(CYLINDER, friction, ANGLE)
        self.robot = SimulatedRobot(start, self.object, RollerFaults(**faults))

    @property
    def pose(self):
        """Return where the object is."""
        return self.robot.object_pose

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
        assert self.object.grip is None
        self.rest()
        assert self.object.grip == plan.grasp.module


def in_grip(config, module, pose, diameter):
    """
    Return the object's place in the frame of the grip, and its angle there less what it rolled.

    :return: (x, y, angle): x along the side B -> B'.
    """
    b, b_end, c, c_end = side_ends(config, module)
    ahead, back = b_end - b, c_end - c
    local = (complex(pose.x, pose.y) - b) * abs(ahead) / ahead
    left = np.sign((ahead.conjugate() * back).imag)
    travel = dict(zip(ROBOT.roller_names, config.roller_positions, strict=True)).get(module, 0.0)
    angle = pose.angle - np.angle(ahead) - left * 2.0 * travel / diameter
    return np.array([local.real, local.imag, np.angle(np.exp(1j * angle))])


def test_lies_still_whatever_the_robot_does_elsewhere():
    rng = np.random.default_rng(0)
    scene = Scene()
    for _ in range(25):
        scene.go(rng.uniform(-0.03, 0.03, N))
        assert scene.pose == LIES
        scene.rest()
        assert scene.pose == LIES
        assert scene.object.grip is None


def test_is_gripped_at_the_end_of_a_planned_way_and_not_before(plan):
    scene = Scene(plan.start)
    for place in plan.path[: plan.touch]:
        scene.go(place)
        scene.rest()
        assert scene.object.grip is None
        assert scene.pose == LIES
    scene.grip(plan)
    # Where it is now it is in equilibrium.
    there = ConvexObject.disc(scene.pose[:2], CYLINDER.diameter)
    settled = settle_grasp(scene.robot.config, there, FRICTION)
    assert settled.held
    assert settled.displacement == pytest.approx(0.0, abs=1e-9)
    assert scene.pose == pytest.approx(LIES, abs=0.01)


def test_nobody_grips_while_the_rollers_turn(plan):
    scene = Scene(plan.start)
    for place in plan.path:
        scene.go(place)
    last = scene.robot.roller_positions
    assert scene.object.grip is None
    for _ in range(3):  # to and fro, without a rest
        scene.go(last + 1e-6)
        scene.go(last)
        assert scene.object.grip is None
    assert scene.pose == LIES


def test_gives_way_before_it_is_held_where_the_rollers_are_off(plan):
    rng = np.random.default_rng(1)
    moved = []
    for _ in range(5):
        scene = Scene(plan.start)
        for place in plan.path[:-1]:
            scene.go(place, steps=1)
        scene.go(plan.path[-1] + rng.uniform(-1e-3, 1e-3, N))
        scene.rest()
        assert scene.object.grip == plan.grasp.module
        assert scene.pose.angle == pytest.approx(ANGLE)
        moved.append(np.hypot(*np.subtract(scene.pose[:2], CYLINDER.center)))
    assert 1e-3 < max(moved) < 0.01


def test_goes_with_the_grip(plan):
    rng = np.random.default_rng(2)
    scene = Scene(plan.start)
    scene.grip(plan)
    module, gripped = plan.grasp.module, scene.robot.roller_positions
    before = in_grip(scene.robot.config, module, scene.pose, CYLINDER.diameter)
    places = []
    for _ in range(10):
        # Together with the grip's own, all rollers turn: the object is carried and rolls.
        scene.go(gripped + rng.uniform(-3e-3, 3e-3, N))
        places.append(scene.pose)
        now = in_grip(scene.robot.config, module, scene.pose, CYLINDER.diameter)
        assert now == pytest.approx(before, abs=1e-9)
    assert np.ptp(np.array(places), axis=0).min() > 1e-3


def test_stays_in_the_grip_over_rests_while_it_is_pressed(plan):
    scene = Scene(plan.start)
    scene.grip(plan)
    module = plan.grasp.module
    before = in_grip(scene.robot.config, module, scene.pose, CYLINDER.diameter)
    gripped = scene.robot.roller_positions
    for off in (2e-3, -2e-3, 0.0):
        scene.go(gripped + off * np.linspace(-1.0, 1.0, N))
        scene.rest()
        assert scene.object.grip == module
        now = in_grip(scene.robot.config, module, scene.pose, CYLINDER.diameter)
        assert now == pytest.approx(before, abs=1e-9)


def test_is_let_go_where_the_grip_opens(plan):
    scene = Scene(plan.start)
    scene.grip(plan)
    opened = closed_to(CLOSED, 50.0, CYLINDER.diameter).roller_positions
    scene.go(opened)
    assert scene.object.grip is not None  # until somebody looks
    left = scene.pose
    scene.rest()
    assert scene.object.grip is None
    assert scene.pose == pytest.approx(left)
    left = scene.pose
    scene.go(opened + 1e-3)
    scene.rest()
    assert scene.pose == left


def test_without_friction_nothing_is_gripped(plan):
    scene = Scene(plan.start, friction=0.0)
    for place in plan.path:
        scene.go(place, steps=1)
    scene.rest()
    assert scene.object.grip is None
    assert scene.pose == LIES


@pytest.mark.parametrize(('angle', 'kept'), [(0.0, 0.0), (-3.0, -3.0), (4.0, 4.0 - 2.0 * np.pi)])
def test_angle_is_kept_and_within_half_a_turn(plan, angle, kept):
    lying = FreeObject(CYLINDER, FRICTION, angle)
    assert lying.pose(ROBOT.home) == pytest.approx((*CYLINDER.center, kept))
    lying.come_to_rest(plan.config)
    assert lying.grip == plan.grasp.module
    assert lying.pose(plan.config) == pytest.approx((*CYLINDER.center, kept), abs=0.01)


def test_is_gripped_from_the_start_where_the_robot_already_holds_it(plan):
    lying = FreeObject(CYLINDER, FRICTION)
    assert lying.pose(plan.config) == (*CYLINDER.center, 0.0)
    robot = SimulatedRobot(plan.config, lying, RollerFaults())
    robot.advance(0.01)
    assert lying.grip == plan.grasp.module


def test_three_members_hold_it_where_it_is():
    caught = ConvexObject.disc((0.0, -0.8267), 0.65)
    assert len(analyze_grasp(ROBOT.home, caught, FRICTION).contact_forces) >= 3
    lying = FreeObject(caught, FRICTION)
    lying.come_to_rest(ROBOT.home)
    assert lying.grip is not None
    assert lying.pose(ROBOT.home)[:2] == pytest.approx(caught.center)


def test_a_tube_that_lies_on_it_does_not_grip_it(monkeypatch):
    """The contact of such an object would take minutes to compute."""

    def never(*_arguments):
        raise AssertionError('computed')

    monkeypatch.setattr(loose_object, 'settle_grasp', never)
    for center, diameter in (((0.99, -0.1), 2.0), ((-0.4, -0.49), 1.0), ((-0.48, 0.52), 10.0)):
        lying = FreeObject(ConvexObject.disc(center, diameter), FRICTION)
        lying.come_to_rest(ROBOT.home)
        assert lying.grip is None
    with pytest.raises(AssertionError, match='computed'):
        FreeObject(CYLINDER, FRICTION).come_to_rest(CLOSED)


def test_the_robot_looks_once_for_each_rest():
    rests = []
    counting = SimpleNamespace(come_to_rest=rests.append, follow=lambda _config: None)
    robot = SimulatedRobot(ROBOT.home, counting, RollerFaults(stuck=frozenset({'south/P'})))
    for _ in range(3):
        robot.advance(0.1)
    assert rests == [ROBOT.home]
    for count, sort in enumerate((robot.stop, lambda: robot.command([0.1, 0, 0, 0, 0, 0])), 1):
        robot.command([0.0, 0.01, 0.0, 0.0, 0.0, 0.0])
        for _ in range(3):
            robot.advance(0.1)
            assert len(rests) == count
        sort()  # a stuck roller that is told to move rests too
        for _ in range(3):
            robot.advance(0.0)
        assert len(rests) == count + 1
        assert rests[-1] is robot.config


# Which module grips


def by_member(**forces):
    """Return forces by member; members as tube_joint_joint."""
    named = {}
    for member, force in forces.items():
        tube, one, other = member.split('_')
        named[f'{tube}/{one}-{other}'] = force
    assert set(named) <= set(ROBOT.member_names)
    return named


@pytest.mark.parametrize(
    ('forces', 'module'),
    [
        ({}, None),
        ({'north_Z_R': 9.0}, None),
        ({'north_P_Z': 1.0, 'north_Z_R': 9.0}, 'north/Z'),
        ({'south_P_Q': 1.0, 'south_Q_X': 1.0}, 'south/Q'),
        ({'south_P_Q': 1.0, 'south_X_P': 1e-12}, 'south/P'),
        ({'south_P_Q': 5.0, 'north_P_Z': 5.0}, None),  # they meet at no module
        ({'south_P_Q': 2.0, 'south_Q_X': 3.0, 'south_X_P': 1.0}, 'south/Q'),
        ({'south_P_Q': 1.0, 'south_Q_X': 9.0, 'south_X_P': 8.0}, 'south/X'),
        ({'south_P_Q': 9.0, 'south_Q_X': 0.5, 'north_R_P': 1.0, 'north_P_Z': 2.0}, 'north/P'),
        ({'north_P_Z': 1.0, 'north_Z_R': 0.0}, None),
    ],
)
def test_the_module_whose_weaker_side_presses_hardest_grips(forces, module):
    assert grip_module(ROBOT.home, by_member(**forces)) == module


@examples(25)
@given(generators())
def test_an_object_between_two_sides_is_gripped_by_their_module(rng):
    """Of one tube, where no other triangle is in the way."""
    robot = random_robot(int(rng.integers(2**32)), 'polygon')
    config = random_state(robot, rng)
    for module in robot.module_names:
        try:
            center = tangent_center(config, module, 0.3, 0.003)
        except GraspError:
            continue  # it does not fit
        found = analyze_grasp(config, ConvexObject.disc(center, 0.3))
        if len(found.contact_forces) == 2:
            assert grip_module(config, found.contact_forces) == module
