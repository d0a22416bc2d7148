# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What contacts with a free object tell: a planned grasp closes on it, and zeros are off."""

from dataclasses import replace
import functools

from drawn_robots import EXACT, PERIOD, POSE, ROBOT
from isotruss_ros.core import ConvexObject, plan_grasps, Polygon, Pose
from isotruss_ros.core.control.belief import Belief
from isotruss_ros.core.control.first_contact import AGAINST, FirstContact, Seen, WINDOW
from isotruss_ros.core.control.state_estimator import StateEstimator
from isotruss_ros.core.control.state_filter import StateFilter
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.simulation.elastic_object import ElasticObject
from isotruss_ros.mujoco_plant.options import PlantOptions
from isotruss_ros.mujoco_plant.plant import MujocoPlant
from mujoco_worlds import needs_mujoco
import numpy as np
import pytest
import scipy

#: Zeros of a robot that was not homed, without markers.
UNKNOWN = replace(EXACT, zeros=0.01)
BODY = ConvexObject.disc((0.6, 0.3), 0.2, friction=0.8)
#: Speed of the rollers [m/s], squeeze at which they stop [N], points of the path before the touch.
SPEED, TARGET, BEFORE = 0.02, 15.0, 4


@functools.cache
def planned():
    """Return members and roller path of a grasp; it begins a while before the touch."""
    grasp = next(iter(plan_grasps(ROBOT.home, BODY)))
    begin = grasp.touch - BEFORE
    return Grip(grasp.members, BODY, 0.8), np.array(grasp.path)[begin:]


class Elastic:
    """A robot of the model itself that moves to a travel (r,) [m], and a free disc."""

    def __init__(self, travel):
        self._config, self._object = ROBOT.home, ElasticObject(BODY, 0.8)
        self.move(travel)

    def move(self, travel):
        self._config = self._config.moved_to(travel)
        self._object.follow(self._config)

    @property
    def pose(self):
        return self._object.pose(self._config)

    @property
    def squeeze(self):
        return self._object.grasp.squeeze if self._object.grasp else 0.0


class InMujoco:
    """The same in MuJoCo; the disc rubs on the floor."""

    def __init__(self, travel):
        fine = np.where(np.isin(ROBOT.member_names, planned()[0].members), 8, 4)
        options = PlantOptions(friction=0.8, module_mass=1.0, ground_friction=1.0)
        self._plant = MujocoPlant(ROBOT, [replace(BODY, mass=0.5)], options, fine)
        for place in np.linspace(0.0, 1.0, 100)[1:, None] * travel:
            self.move(place)

    def move(self, travel):
        self._plant.advance(PERIOD, (travel - self._plant.travel) / PERIOD)

    @property
    def pose(self):
        return self._plant.object_pose()

    @property
    def squeeze(self):
        pressing = [each.normal for each in self._plant.contact_forces().values()]
        return np.mean(pressing) if len(pressing) > 1 else 0.0


class Closing:
    """A robot with wrong zeros and slipping rollers that closes on a free disc."""

    def __init__(self, seed, plant=Elastic):
        self.rng = rng = np.random.default_rng(seed)
        self.grip, path = planned()
        self.todo, self.last = list(path[1:]), path[-1] - path[-2]
        self.readings, self.time = path[0].copy(), 0.0
        self.offsets = UNKNOWN.zeros * rng.normal(size=6)
        self.slips = UNKNOWN.slip * rng.uniform(0.5, 1.5, 6)
        self.plant = plant(self.readings + self.offsets)
        self.estimator = StateEstimator(ROBOT, UNKNOWN)
        self.estimator.grip = self.grip

    def step(self):
        """Close a bit, and measure; beyond the path as at its end."""
        step = np.zeros(6)
        if not self.reached:
            if not self.todo:
                self.todo.append(self.readings + self.last)
            step = self.todo[0] - self.readings
            most = np.abs(step).max()
            if most > SPEED * PERIOD:
                step *= SPEED * PERIOD / most
            else:
                self.todo.pop(0)
        self.time += PERIOD
        self.readings = self.readings + step
        self.offsets = self.offsets - self.slips * step
        self.plant.move(self.readings + self.offsets)
        self.estimator.take_encoders(self.time, self.readings)
        if self.rng.random() > 0.3:
            pose = np.array(self.plant.pose) + POSE * self.rng.normal(size=3)
            self.estimator.take_pose(self.time, Pose(*pose), POSE)

    @property
    def reached(self):
        """Tell whether the estimated squeeze is on its target."""
        found = self.estimator.estimate()
        return found is not None and found.pose is not None and found.squeeze >= TARGET

    def run(self):
        """Close until the estimate is on the target, and rest for a second."""
        for _ in range(1000):
            if self.reached:
                break
            self.step()
        for _ in range(20):
            self.step()
        return self.estimator.estimate()


def test_contacts_tell_how_hard_a_robot_with_unknown_zeros_squeezes():
    closing = Closing(5)
    found = closing.run()
    # From geometry alone 10 mm of zeros leave more than the squeeze itself.
    assert found.squeeze_deviation < 0.5 * TARGET
    assert abs(found.squeeze - closing.plant.squeeze) < 2.0 * found.squeeze_deviation


@pytest.mark.nightly
@pytest.mark.parametrize(
    ('plant', 'runs', 'within'),
    [(Elastic, 100, 95), pytest.param(InMujoco, 20, 19, marks=needs_mujoco)],
)
def test_stated_deviations_contain_the_true_squeeze(plant, runs, within):
    surprises = []
    for seed in range(runs):
        closing = Closing(seed, plant)
        found = closing.run()
        surprises.append((found.squeeze - closing.plant.squeeze) / found.squeeze_deviation)
    assert np.count_nonzero(np.abs(surprises) < scipy.special.ndtri(0.975)) >= within
    # Nor are they needlessly large.
    assert np.sqrt(np.mean(np.square(surprises))) > 0.5


@pytest.mark.parametrize('shape', [BODY.shape, Polygon([(-0.1, -0.06), (0.1, -0.06), (0.0, 0.1)])])
def test_derivatives_of_depths_are_those_of_differences(shape):
    grip, path = planned()
    body = replace(BODY, shape=shape)
    model = StateFilter(ROBOT, EXACT)
    state, pose, small = model.state.copy(), np.array([0.6, 0.3, 0.2]), 1e-6

    def depths(state, pose):
        model.evaluate(path[BEFORE], state)
        return model.depths(replace(grip, body=body.moved_to(pose)))

    _, rates, by_pose = depths(state, pose)
    for i in range(6):
        more = depths(state + small * np.eye(len(state))[i], pose)[0]
        less = depths(state - small * np.eye(len(state))[i], pose)[0]
        assert rates[:, i] == pytest.approx((more - less) / (2.0 * small), abs=1e-6)
    for i in range(3):
        more = depths(state, pose + small * np.eye(3)[i])[0]
        less = depths(state, pose - small * np.eye(3)[i])[0]
        assert by_pose[:, i] == pytest.approx((more - less) / (2.0 * small), abs=1e-6)


def _told(moved, travel):
    """Return whether something is told where an object moves (x, y) as rollers turn by travel."""
    contact, told = FirstContact(), []
    # Two members at right angles, each driven by a roller of its own.
    rates, by_pose = np.eye(2), np.eye(2, 3)
    belief = Belief(np.zeros(2), 1e-4 * np.eye(2))
    for share in np.concatenate([np.zeros(20), np.linspace(0.0, 1.0, 40)]):
        readings, pose = share * np.array(travel), np.append(share * np.array(moved), 0.0)
        values = np.array([0.0, -0.1]) + rates @ readings + by_pose @ pose
        seen = Seen(pose, np.full(3, 1e-6), readings, belief.mean, values, rates, by_pose)
        told.append(contact.take(seen, belief, lambda: np.full(2, 0.005)))
    return [each for each in told if each is not None]


def test_an_object_that_a_member_pushes_is_tangent_to_it():
    told = _told((-0.03, 0.0), (0.03, 0.0))
    assert len(told) > WINDOW
    # The other member is far away.
    assert told[0].rates == pytest.approx([1.0, 0.0], abs=1e-6)
    assert [each.value for each in told] == pytest.approx([0.0] * len(told), abs=1e-6)


@pytest.mark.parametrize(
    ('moved', 'travel'),
    [
        ((0.0, 0.0), (0.03, 0.0)),  # it lies
        ((-0.03, 0.0), (0.0, 0.0)),  # someone moves it
        ((-0.03, 0.0), (-0.03, 0.0)),  # it is pulled behind a member that opens
        ((-0.03 * AGAINST, 0.03), (0.03, 0.0)),  # it goes aside
    ],
)
def test_an_object_that_no_member_pushes_tells_nothing(moved, travel):
    assert not _told(moved, travel)
