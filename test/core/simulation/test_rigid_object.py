# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulated robot with faults of its rollers, and a rigid object on it."""

from grips import backed_off, closed_to, disc_grip, gripped
from held_grips import APART, box_between, NINE
from isotruss_ros import core
from isotruss_ros.core.errors import ConfigurationError
import numpy as np
import pytest

CLOSED, CYLINDER = gripped(35.0, squeeze=0.06)
ROBOT = CLOSED.robot
FRICTION, ANGLE = 0.5, 0.7
N = len(ROBOT.roller_names)
LIES = core.Pose(*CYLINDER.pose[:2], ANGLE)
GRASPING = {'north/P-Z', 'north/Z-R'}


#: Configurations from apart to a grip.
APPROACH = backed_off(CLOSED, CYLINDER, 0.1)[::-1]


class Scene:
    """A simulated robot and an object beside it."""

    def __init__(self, start):
        self.object = core.RigidObject(CYLINDER.moved_to(LIES), FRICTION)
        self.robot = core.SimulatedRobot(start, self.object, core.RollerFaults())

    def go(self, place, duration=1.0, steps=5):
        """Bring the rollers somewhere, and do not stop."""
        self.robot.command((np.asarray(place) - self.robot.roller_positions) / duration)
        for _ in range(steps):
            self.robot.advance(duration / steps)

    def rest(self):
        """Let the rollers come to rest."""
        self.robot.stop()
        self.robot.advance(0.01)

    def grip(self):
        """Close the members on the object, with a rest before they touch and at the end."""
        self.go(APPROACH[1].roller_positions)
        self.rest()
        assert self.object.rolling is None
        for config in APPROACH[2:]:
            self.go(config.roller_positions, steps=1)
            assert self.object.rolling is None  # the rollers move
        assert self.robot.object_pose == LIES
        self.rest()
        assert set(self.object.rolling.grip.members) == GRASPING


def test_an_object_is_held_in_equilibrium_when_the_rollers_stop():
    scene = Scene(APPROACH[0])
    scene.grip()
    body = core.ConvexObject.disc(scene.robot.object_pose[:2], CYLINDER.shape.diameter)
    settled = core.settle_grasp(scene.robot.config, body, FRICTION)
    assert settled.held
    assert settled.displacement == pytest.approx(0.0, abs=1e-9)
    assert scene.robot.object_pose == pytest.approx(LIES, abs=0.01)


def test_an_object_is_held_until_the_grip_opens():
    scene = Scene(APPROACH[0])
    scene.grip()
    closed = scene.robot.roller_positions
    before = scene.robot.object_pose
    for off in (2e-3, 0.0):
        scene.go(closed + off * np.linspace(-1.0, 1.0, N))
        scene.rest()
        assert set(scene.object.rolling.grip.members) == GRASPING
    assert scene.robot.object_pose == pytest.approx(before, abs=1e-9)
    opened = closed_to(CLOSED, 50.0, CYLINDER.shape.diameter).roller_positions
    scene.go(opened)
    assert scene.object.rolling is not None  # until the rollers stop
    scene.rest()
    assert scene.object.rolling is None
    left = scene.robot.object_pose
    scene.go(opened + 1e-3)
    scene.rest()
    assert scene.robot.object_pose == left


@pytest.mark.parametrize('kind', [core.RigidObject, core.ElasticObject])
@pytest.mark.parametrize(('angle', 'kept'), [(0.0, 0.0), (-3.0, -3.0), (4.0, 4.0 - 2.0 * np.pi)])
def test_angle_is_preserved_and_within_half_a_turn(kind, angle, kept):
    thing = kind(CYLINDER.moved_to((*CYLINDER.pose[:2], angle)), FRICTION)
    assert thing.pose(ROBOT.home) == pytest.approx((*CYLINDER.pose[:2], kept))
    thing.follow(CLOSED)
    assert thing.pose(CLOSED) == pytest.approx((*CYLINDER.pose[:2], kept), abs=0.01)


def test_an_object_that_leaves_its_grip_stays_at_its_last_pose():
    thing = core.RigidObject.in_grip(core.RollingGrip.attach(ROBOT.home, box_between()))
    apart = np.array([0.25, -0.3, 0.3, 0.2, -0.3, 0.25])
    near, far = (ROBOT.home.moved_to(share * apart) for share in (0.1, 1.0))
    thing.follow(near)
    last = thing.pose(near)
    thing.follow(far)
    assert thing.rolling is None
    assert thing.pose(far) == pytest.approx(last)
    assert last != pytest.approx(box_between().body.pose, abs=1e-3)


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
    body = core.ConvexObject(body.shape, body.pose, friction=own)
    free = core.RigidObject(body, friction)
    robot = core.SimulatedRobot(ROBOT.home, free, core.RollerFaults())
    robot.advance(0.0)
    assert (free.rolling is not None) is held
    assert not held or set(free.rolling.grip.members) == set(APART)
    went = np.hypot(*np.subtract(robot.object_pose, body.pose)[:2])
    assert (0.0 < went < 0.01) == held
    if not held:
        robot.command([0.0, 0.02, 0.0, 0.0, 0.0, 0.0])
        robot.advance(0.1)
        assert robot.object_pose == pytest.approx(body.pose)


GRASP = disc_grip(NINE.home, 'north/Z')
SPEEDS = np.linspace(-0.02, 0.03, N)


def simulated(**faults):
    """Return a robot at home with the object in its grip."""
    held = core.RigidObject.in_grip(core.RollingGrip.attach(NINE.home, GRASP))
    return core.SimulatedRobot(NINE.home, held, core.RollerFaults(**faults), seed=3)


def test_travel_is_speed_times_time_for_any_steps():
    whole, cut = simulated(), simulated()
    for robot, steps in ((whole, 1), (cut, 200)):
        robot.command(SPEEDS)
        for _ in range(steps):
            robot.advance(2.0 / steps)
    assert whole.config.roller_positions == pytest.approx(2.0 * SPEEDS, abs=1e-12)
    assert cut.config.roller_positions == pytest.approx(2.0 * SPEEDS, abs=1e-12)
    assert cut.config.points == pytest.approx(whole.config.points, abs=1e-11)
    assert tuple(cut.object_pose) == pytest.approx(tuple(whole.object_pose), abs=1e-9)


def test_stuck_rollers_rest_and_others_keep_the_speed_limit():
    robot = simulated(speed_limit=0.01, stuck=frozenset({NINE.roller_names[0]}))
    robot.command(10.0 * SPEEDS)
    robot.advance(1.0)
    assert robot.roller_velocities[0] == 0.0
    assert np.abs(robot.roller_velocities).max() == 0.01


def test_noise_of_moving_rollers_has_its_deviation():
    robot = simulated(noise=0.004)
    robot.command(1e-9 * (np.arange(N) == 1))
    speeds = []
    for _ in range(500):
        robot.advance(1e-4)
        speeds.append(robot.roller_velocities)
    speeds = np.array(speeds)
    assert not np.delete(speeds, 1, axis=1).any()
    # The deviation of 500 draws is known to 3 %; five of these are 16 %.
    assert speeds[:, 1].std() == pytest.approx(0.004, rel=0.16)
    assert abs(speeds[:, 1].mean()) < 5 * 0.004 / np.sqrt(500)


def test_encoders_do_not_measure_slip():
    robot, perfect = simulated(slip=0.1), simulated()
    for one in (robot, perfect):
        one.command(SPEEDS)
        one.advance(2.0)
    assert robot.roller_positions == pytest.approx(perfect.roller_positions, abs=1e-15)
    assert robot.roller_velocities == pytest.approx(SPEEDS)
    moves = SPEEDS != 0.0
    shares = 1.0 - robot.config.roller_positions[moves] / robot.roller_positions[moves]
    assert shares.min() >= 0.05
    assert shares.max() <= 0.15
    assert len(set(shares.round(9))) == moves.sum()  # each roller has its own
    # The object is where the tubes took it, and the way back leads home.
    assert (
        robot.object_pose == core.RollingGrip.attach(NINE.home, GRASP).moved_to(robot.config).pose
    )
    robot.command(-SPEEDS)
    robot.advance(2.0)
    assert robot.config.roller_positions == pytest.approx(np.zeros(N), abs=1e-15)


@pytest.mark.parametrize('bad', [[0.0] * (N + 1), [np.nan] * N, 'fast', None])
def test_a_bad_command_changes_nothing(bad):
    robot = simulated()
    robot.command(SPEEDS)
    with pytest.raises(ConfigurationError, match='roller velocities'):
        robot.command(bad)
    robot.advance(1.0)
    assert robot.roller_velocities == pytest.approx(SPEEDS)


def test_a_replaced_object_is_at_its_own_pose():
    robot, other = simulated(), core.RigidObject(core.ConvexObject.disc((0.1, 0.2), 0.1), 0.5)
    robot.replace_object(other)
    assert robot.object_pose == (0.1, 0.2, 0.0)


def test_rollers_block_where_no_configuration_exists():
    robot = simulated()
    robot.command(SPEEDS)
    robot.advance(0.1)
    before = robot.config
    robot.command(-10.0 * (np.arange(N) == 0))
    with pytest.raises(ConfigurationError):
        robot.advance(1.0)
    assert robot.config is before
    assert not robot.roller_velocities.any()
