"""An object that lies free until it is gripped, goes with the grip then, and lies free again."""

from types import SimpleNamespace

from hypothesis import given
from isotruss_ros.core import (
    analyze_grasp,
    Cylinder,
    GraspError,
    GraspRequirements,
    load_robot,
    loose_object,
    LooseObject,
    plan_grasps,
    Pose,
    RollerFaults,
    SimulatedRobot,
    snug_center,
)
from isotruss_ros.core.loose_object import grip_module
import numpy as np
import pytest
from robots import examples, generators, random_robot, random_state, side_ends

ROBOT = load_robot('nine_member')
N = len(ROBOT.roller_names)
CYLINDER = Cylinder((0.5, 0.4), 0.3)
FRICTION, ANGLE = 0.5, 0.7
LIES = Pose(*CYLINDER.center, ANGLE)


@pytest.fixture(scope='module')
def plan():
    """Return a way to grip the object."""
    needs = GraspRequirements(friction=FRICTION, min_margin=0.01, count=1)
    return plan_grasps(ROBOT.home, CYLINDER, needs, thorough=False).grasps[0]


class Scene:
    """A simulated robot at home and an object beside it."""

    def __init__(self, cylinder=CYLINDER, friction=FRICTION, **faults):
        self.object = LooseObject(cylinder, friction, ANGLE)
        self.robot = SimulatedRobot(ROBOT.home, self.object, RollerFaults(**faults))

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
    scene = Scene()
    for place in plan.path[: plan.touch]:
        scene.go(place)
        scene.rest()
        assert scene.object.grip is None
        assert scene.pose == LIES
    scene.grip(plan)
    # By friction, where it is now, which is where it was but for rounding.
    there = Cylinder(scene.pose[:2], CYLINDER.diameter)
    assert analyze_grasp(scene.robot.config, there, FRICTION).force_closure
    assert scene.pose == pytest.approx(LIES, abs=1e-5)


def test_nobody_grips_while_the_rollers_turn(plan):
    scene = Scene()
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
        scene = Scene()
        for place in plan.path[:-1]:
            scene.go(place, steps=1)
        scene.go(plan.path[-1] + rng.uniform(-1e-3, 1e-3, N))
        scene.rest()
        assert scene.object.grip == plan.grasp.module
        assert scene.pose.angle == pytest.approx(ANGLE)
        moved.append(np.hypot(*np.subtract(scene.pose[:2], CYLINDER.center)))
        there = Cylinder(scene.pose[:2], CYLINDER.diameter)
        assert analyze_grasp(scene.robot.config, there, FRICTION).force_closure
    assert 1e-5 < max(moved) < 3e-3


def test_goes_with_the_grip(plan):
    rng = np.random.default_rng(2)
    scene = Scene()
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
    scene = Scene()
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


def test_is_let_go_where_the_grip_opens_and_can_be_gripped_again(plan):
    scene = Scene()
    scene.grip(plan)
    touch = plan.touch - 2
    for place in plan.path[touch:][::-1]:
        scene.go(place)
    assert scene.object.grip is not None  # until somebody looks
    left = scene.pose
    scene.rest()
    assert scene.object.grip is None
    assert scene.pose == pytest.approx(left)
    left = scene.pose
    for place in plan.path[:touch][::-1]:
        scene.go(place)
        scene.rest()
        assert scene.pose == left
    # It went a little with the grip as that opened: plan anew, from where all is now.
    lying = Cylinder(left[:2], CYLINDER.diameter)
    needs = GraspRequirements(min_margin=0.01, count=1)
    again = plan_grasps(scene.robot.config, lying, needs, thorough=False).grasps[0]
    scene.grip(again)
    assert scene.pose == pytest.approx(left, abs=1e-5)


def test_without_friction_nothing_is_gripped(plan):
    scene = Scene(friction=0.0)
    for place in plan.path:
        scene.go(place, steps=1)
    scene.rest()
    assert scene.object.grip is None
    assert scene.pose == LIES


@pytest.mark.parametrize(('angle', 'kept'), [(0.0, 0.0), (-3.0, -3.0), (4.0, 4.0 - 2.0 * np.pi)])
def test_angle_is_kept_and_within_half_a_turn(plan, angle, kept):
    lying = LooseObject(CYLINDER, FRICTION, angle)
    assert lying.pose(ROBOT.home) == pytest.approx((*CYLINDER.center, kept))
    lying.come_to_rest(plan.config)
    assert lying.grip == plan.grasp.module
    assert lying.pose(plan.config) == pytest.approx((*CYLINDER.center, kept), abs=1e-5)


def test_is_gripped_from_the_start_where_the_robot_already_holds_it(plan):
    lying = LooseObject(CYLINDER, FRICTION)
    robot = SimulatedRobot(plan.config, lying, RollerFaults())
    robot.advance(0.01)
    assert lying.grip == plan.grasp.module


def test_a_tube_that_lies_on_it_does_not_grip_it(monkeypatch):
    """The contact of such an object would take minutes to compute."""

    def never(*_arguments):
        raise AssertionError('computed')

    monkeypatch.setattr(loose_object, 'settle', never)
    for center, diameter in (((0.99, -0.1), 2.0), ((-0.4, -0.49), 1.0), ((-0.48, 0.52), 10.0)):
        lying = LooseObject(Cylinder(center, diameter), FRICTION)
        lying.come_to_rest(ROBOT.home)
        assert lying.grip is None
    with pytest.raises(AssertionError, match='computed'):
        LooseObject(CYLINDER, FRICTION).come_to_rest(ROBOT.home)


def test_behind_a_corner_it_is_not_in_the_grip():
    """Both sides press on it, but it is not between them."""
    home = load_robot('triangle').home
    cylinder = Cylinder((-0.1266, -0.0981), 0.16863)
    settled = loose_object.settle(home, cylinder, 2.0)
    assert grip_module(home, settled.analysis) == 'main/L'
    lying = LooseObject(cylinder, 2.0)
    lying.come_to_rest(home)
    assert lying.grip is None
    assert lying.pose(home)[:2] == cylinder.center


def test_the_robot_looks_once_for_each_rest():
    rests = []
    counting = SimpleNamespace(come_to_rest=rests.append)
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


def analysis(**forces):
    """Return what counts of an analysis; members as tube_joint_joint."""
    named = {}
    for member, force in forces.items():
        tube, one, other = member.split('_')
        named[f'{tube}/{one}-{other}'] = force
    assert set(named) <= set(ROBOT.member_names)
    return SimpleNamespace(contact_forces=named)


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
    assert grip_module(ROBOT.home, analysis(**forces)) == module


@examples(25)
@given(generators())
def test_an_object_between_two_sides_is_gripped_by_their_module(rng):
    """Of one tube, where no other triangle is in the way."""
    robot = random_robot(int(rng.integers(2**32)), 'polygon')
    config = random_state(robot, rng)
    for module in robot.module_names:
        try:
            center = snug_center(config, module, 0.3, 0.003)
        except GraspError:
            continue  # it does not fit
        found = analyze_grasp(config, Cylinder(center, 0.3))
        if len(found.contact_forces) == 2:
            assert grip_module(config, found) == module
