# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The squeeze control carries in MuJoCo, which has masses of its own.

Grasps, masses, errors of the model, delays and noise are those of the table in docs/safety.md.
"""

from dataclasses import replace
from itertools import product

from carries import FRICTION, GRASPS, make_robot, place
from isotruss_ros.calibration.oscillation import fit_oscillation
from isotruss_ros.core import Grip, Pose, Status
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.planning.foresee_path import foresee_path
from isotruss_ros.core.servo.squeeze_control import SqueezeSettings
from isotruss_ros.mujoco_plant.options import PlantOptions
from mujoco_worlds import needs_mujoco
from nightly import some_now
import numpy as np
import pytest
from studies.comparison.carrying import RATE, Regulated
from studies.comparison.grips import hold_at_home

pytestmark = needs_mujoco

#: Masses of module and object [kg], those of the model over them, stiffness of plant over model.
ROBOTS = [
    ((0.3, 0.2), 3.0, 0.6),
    ((0.3, 5.0), 1.0, 1.5),
    ((1.0, 0.5), 1.0, 1.0),
    ((3.0, 0.5), 1.0 / 3.0, 1.5),
    ((5.0, 0.2), 3.0, 0.6),
    ((5.0, 5.0), 1.0 / 3.0, 1.5),
]
PUSH, NOISE = (1.0, 0.0, 0.0), (1e-3, np.radians(0.5))
#: Grasp, forced gain [1/s] and masses that make a push grow.
GROWING = [
    ('disc 0.3 m', 12.0, (3.0, 0.5)),
    ('disc 0.1 m', 12.0, (3.0, 0.5)),
    ('disc 0.2 m', 10.0, (5.0, 0.5)),
    ('disc 0.3 m', 15.0, (3.0, 0.5)),
]


class Carry(Regulated):
    """
    An object in MuJoCo, and the servo that carries it by late and noisy measurements.

    :ivar errors: (n, 3) of the object against its twists, turns times its arm [m].
    """

    def __init__(
        self,
        grasp,
        masses=(1.0, 0.5),
        told=1.0,
        stiffness=1.0,
        late=0,
        noise=(0.0, 0.0),
        seed=0,
        **settings,
    ):
        """
        Put the object between the members, and regulate how hard they press.

        :param grasp: name of one of `GRASPS`.
        :param masses: of module and object in the plant [kg].
        :param told: masses in the model over those of the plant.
        :param stiffness: of the plant's tubes over those of the model.
        :param late: cycles by which poses are late.
        :param noise: standard deviation of the poses [m, rad].
        """
        robot = make_robot(told * masses[0])
        body, members = place(robot, grasp, told * masses[1])
        made = hold_at_home(
            make_robot(masses[0], stiffness),
            replace(body, mass=masses[1]),
            members,
            PlantOptions(friction=FRICTION),
        )
        numbers = np.array([robot.member_names.index(name) for name in members])
        there = body.moved_to(made.object_pose())
        squeeze = SqueezeSettings(attach_grip(robot.home, there, numbers).squeeze, **settings)
        grip = Grip(members, body, FRICTION)
        super().__init__(made, robot, grip, squeeze, (*noise, seed), late)
        self.even = np.array([1.0, 1.0, body.arm])
        self.goal = np.array(made.object_pose())
        self.errors, self._told = [], None

    def measure(self):
        """Return what is measured; a pose that is told counts in its place."""
        rollers, pose = super().measure()
        return rollers, pose if self._told is None else Pose(*self._told)

    def step(self, twist=(0.0, 0.0, 0.0), pose=None):
        """Carry for one cycle; a pose is told in place of the measured one."""
        self._told = pose
        super().step(twist)
        self.goal = self.goal + self.scale * np.array(twist) / RATE
        self.errors.append(self.even * (np.array(self.plant.object_pose()) - self.goal))

    def push(self, wrench, duration=0.1):
        """Push the object for a while, which nobody tells the servo."""
        self.plant.pull(wrench)
        self.run(duration)
        self.plant.pull((0.0, 0.0, 0.0))


def swings(carry, seconds):
    """Return how far the object was from where it came to rest, in each second [m]."""
    count, rest = round(seconds * RATE), round(0.5 * RATE)
    errors = np.array(carry.errors[-count:])
    away = np.hypot.reduce(errors - errors[-rest:].mean(axis=0), axis=1)
    return away.reshape(seconds, -1).max(axis=1)


@pytest.mark.parametrize(('grasp', 'robot'), some_now(list(product(GRASPS, ROBOTS)), now=0))
def test_a_push_decays(grasp, robot):
    carry = Carry(grasp, *robot, late=3)
    carry.run(1.0)
    carry.push(PUSH)
    carry.run(4.0)
    first, *_, last = swings(carry, 4)
    assert last < 0.2 * first
    assert max(carry.statuses) < Status.HALT_NO_TWIST


@pytest.mark.parametrize(
    ('grasp', 'masses'),
    some_now(
        [
            ('brick', (0.3, 5.0)),
            ('three members', (5.0, 0.5)),
            ('disc 0.2 m', (0.3, 5.0)),
            ('disc 0.2 m', (5.0, 0.5)),
            ('brick', (5.0, 0.5)),
        ],
        2,
    ),
)
def test_the_frequency_is_that_of_a_plucked_object(grasp, masses):
    carry = Carry(grasp, masses)
    carry.run(0.1)
    expected, still = carry.control.frequency, np.zeros(len(carry.plant.travel))
    poses = []
    softest = np.linalg.svd(carry.even[:, None] * carry.control.belief.grasp.response.pose)[2][0]
    carry.plant.pull(0.3 * softest * carry.even)
    carry.plant.advance(2.0, still)
    carry.plant.pull((0.0, 0.0, 0.0))
    for _ in range(300):
        carry.plant.advance(0.005, still)
        poses.append(np.array(carry.plant.object_pose()))

    frequency, damping, _ = fit_oscillation(0.005 * np.arange(300), poses, carry.even[2])
    assert 0.9 * frequency < expected < 1.3 * frequency
    assert 0.02 < damping < 0.6


@pytest.mark.parametrize(('grasp', 'gain', 'masses'), some_now(GROWING, now=0))
def test_an_oscillation_that_grows_is_stopped_before_the_object_is_lost(grasp, gain, masses):
    forced = {'pose_gain': gain, 'load': 5.0}
    carry = Carry(grasp, masses, **forced)
    carry.run(1.0)
    carry.push(PUSH)
    carry.run(5.0)
    assert Status.HALT_OSCILLATES in carry.statuses
    assert f'the pose gain is reduced to {0.5 * gain:g} 1/s' in ' '.join(carry.messages)
    assert carry.statuses[-1] is Status.OK
    assert np.abs(carry.errors[-1]).max() < 2e-3


@pytest.mark.nightly
def test_an_object_that_swings_because_its_masses_are_unknown_is_stopped_and_goes_on():
    carry = Carry('disc 0.2 m', (5.0, 4.2), told=0.06, stiffness=0.6, late=3, load=5.0)
    carry.run(1.0)
    carry.push(PUSH)
    carry.run(5.0)
    halts = {status for status in carry.statuses if status > Status.HALT_NO_TWIST}
    assert halts == {Status.HALT_OSCILLATES}
    assert carry.statuses[-1] is Status.OK
    assert np.abs(carry.errors[-1]).max() < 2e-3


@pytest.mark.parametrize('seed', some_now(range(20), now=0))
def test_noise_halts_no_object_on_a_path(seed):
    carry, rng = Carry('disc 0.3 m', noise=NOISE, seed=seed), np.random.default_rng(seed)
    for _ in range(1 if seed == 0 else 2):
        carry.run(3.0 if seed == 0 else 6.0, rng.uniform(-1.0, 1.0, 3) * (0.025, 0.025, 0.1))
    carry.run(1.0)
    assert max(carry.statuses) < Status.HALT_NO_TWIST
    assert np.abs(carry.errors).max() < 8e-3


def halted(carry, twist, pose):
    """Carry until the loop halts; return by how far the pose (3,) that it is given is off [m]."""
    carry.run(1.0)
    given = np.array(carry.plant.object_pose())
    for k in range(1000):
        given = given + pose(k)
        carry.step(twist(k), given)
        if carry.control.fault is not None:
            break
    assert carry.statuses[-1] in (Status.HALT_SLIPPED, Status.HALT_NOT_HELD)
    return np.hypot(*(np.array(carry.plant.object_pose()) - given)[:2])


@pytest.mark.parametrize('grasp', some_now(['box', 'disc 0.3 m', 'disc 0.1 m', 'brick']))
def test_a_pose_frozen_within_rounding_halts_within_seventeen_millimetres(grasp):
    """A pose that is equal to the last bit is no measurement, and is stale after the timeout."""
    assert halted(Carry(grasp), lambda k: (0.03, 0.02, 0.0), lambda k: 1e-12 * (-1) ** k) < 0.017


@pytest.mark.nightly
def test_a_pose_made_of_the_commanded_path_halts_where_the_object_stays_behind():
    twist = np.array([0.03, 0.02, 0.0])
    assert halted(Carry('box'), lambda k: twist, lambda k: twist / 100.0) < 0.017


def test_a_load_during_the_motion_is_no_slip():
    carry = Carry('disc 0.3 m')
    carry.run(0.5)
    carry.plant.pull((0.0, -1.5, 0.0))
    carry.run(1.5, (0.02, 0.0, 0.0))
    carry.plant.pull((0.0, 0.0, 0.0))
    carry.run(1.0, (0.0, 0.02, 0.0))
    assert max(carry.statuses) < Status.HALT_NO_TWIST


@pytest.mark.parametrize('turn', some_now([0.3, -0.3], 0))
def test_predicted_motion_agrees_with_mujoco(turn):
    """The servo stands where the model foresees that the margin ends, or arrives."""
    carry = Carry('brick')
    carry.run(1.0)
    grip, start = carry.control.belief.grasp, np.array(carry.plant.object_pose())
    path = np.array([grip.pose, np.add(grip.pose, (0.0, 0.0, turn))])
    found = foresee_path(grip, FRICTION, path)
    assert found.share < 1.0
    carry.run(4.0, (0.0, 0.0, turn / 4.0))
    turned = (carry.plant.object_pose()[2] - start[2]) / turn
    assert Status.SLOWED_SLIP_MARGIN in carry.statuses
    assert turned == pytest.approx(found.share, abs=0.12)
