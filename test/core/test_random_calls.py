# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random calls of the public API; `make calls` makes more."""

import contextlib
import dataclasses
import functools
import os
import warnings

from isotruss_ros import core
from isotruss_ros.core.estimation.state_estimator import StateEstimator
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.manipulation.limit_handling import LimitHandling
from isotruss_ros.core.model.presets import preset_names
from isotruss_ros.core.planning import foresee_path, release
from isotruss_ros.core.safety.margins import shape_margins
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
from nightly import some_now
import numpy as np
import pytest
import robots
import shapes

#: Robots besides the presets.
ROBOTS = 12
#: Calls in one state of one robot.
CALLS_IN_WORLD = 10
#: Invalid or extreme numbers.
STRANGE = (0.0, -1.0, 1e-300, 1e-12, 1e6, 1e300, np.inf, np.nan)
STRANGE_SHARE = 0.05


@functools.cache
def robot_of(number):
    """Return one of the robots: a preset or a random one."""
    presets = preset_names()
    if number < len(presets):
        return core.load_robot(presets[number])
    return robots.random_robot(number)


class World:
    """A robot in a random state, with an object between members."""

    def __init__(self, rng):
        self.rng = rng
        self.robot = robot_of(int(rng.integers(len(preset_names()) + ROBOTS)))
        halvings = int(rng.choice([0, 3, 11]))  # at home, anywhere, or near the end of the shapes
        self.config = robots.extreme_state(self.robot, rng, halvings)
        self.body, self.grip = self.random_grip()

    def number(self, low, high):
        """Return a number of a range, seldom an invalid one."""
        if self.rng.random() < STRANGE_SHARE:
            return float(self.rng.choice(STRANGE))
        return float(self.rng.uniform(low, high))

    def numbers(self, count, low, high):
        """Return numbers of a range, seldom invalid ones."""
        return np.array([self.number(low, high) for _ in range(count)])

    def travel(self, reach):
        """Return travel of the rollers by some share of the shortest member [m]."""
        size = reach * self.robot.home.member_lengths.min()
        return self.rng.uniform(-size, size, len(self.robot.roller_names))

    def random_grip(self):
        """Return an object between members, seldom one anywhere, and the grip of it."""
        rng = self.rng
        for _ in range(1 if rng.random() < 0.1 else 10):
            shape = shapes.random_shape(rng, 0.5 * 10.0 ** rng.uniform(-2.0, 0.3))
            members, way = self.random_members(), rng.uniform(-4.0, 4.0)
            try:
                grip = core.place_between(self.config, members, shape, way, self.number(0.0, 0.04))
            except core.IsotrussError:
                continue
            return grip.body, grip
        body = core.ConvexObject(shape, (*rng.uniform(-1.0, 2.0, 2), 0.3))
        return body, core.Grip(members, body, 0.5)

    def random_members(self):
        """Return the members at a module, or any two or three."""
        names, count = self.robot.member_names, len(self.robot.member_names)
        place = int(self.rng.integers(count))
        indices = (place, int(self.robot.topology.previous[place]))
        if self.rng.random() < 0.3:
            indices = self.rng.permutation(count)[: self.rng.integers(2, 4)]
        return tuple(names[i] for i in indices)

    @property
    def failed(self):
        """Return some rollers, or none, or all."""
        names = self.robot.roller_names
        return [names[i] for i in self.rng.permutation(len(names))[: self._few(len(names))]]

    def _few(self, count):
        return int(self.rng.integers(count + 1)) * int(self.rng.integers(2))


def solve_twist(world):
    slide, regularized = map(bool, world.rng.integers(2, size=2))
    command = core.solve_twist(
        world.config,
        world.grip,
        world.numbers(3, -0.2, 0.2),
        world.failed,
        handling=LimitHandling(slide, regularized),
        opening_rate=float(world.rng.choice([0.0, 0.01])),
    )
    speeds = np.abs(command.roller_velocities)
    assert speeds.max() <= world.robot.description.max_speed * (1.0 + 1e-6)
    return command


def simulate(world):
    """Let a simulated robot with faults run with commands of any size."""
    rng, robot = world.rng, world.robot
    body = core.ElasticObject(world.body, world.number(0.1, 1.0), world.number(0.5, 2.0))
    faults = core.RollerFaults(0.1, 0.01, frozenset(world.failed), 0.3 * rng.random())
    simulated = core.SimulatedRobot(world.config, body, faults, int(rng.integers(100)))
    poses = []
    for speed in (0.0, 0.1, 0.0):
        simulated.command(world.numbers(len(robot.roller_names), -speed, speed))
        simulated.advance(0.01)
        poses.append(simulated.object_pose)
    return poses, simulated.config


def decide(world):
    """Let the servo decide, with late inputs and with a squeeze."""
    rng, robot = world.rng, world.robot
    slide, squeeze = bool(rng.integers(2)), None
    if rng.integers(3) == 0:
        squeeze = SqueezeSettings(abs(world.number(1.0, 60.0)) or 1.0)
    settings = ServoSettings(world.grip, 0.01, 0.2, squeeze=squeeze, slide_along_limits=slide)
    servo = core.TwistServo(robot, settings)
    servo.receive(failed=world.failed)
    config, speeds = world.config, np.zeros(len(robot.roller_names))
    for cycle in range(3):
        now = 1.0 + 0.01 * cycle
        servo.receive(
            twist=StampedInput(rng.uniform(-0.2, 0.2, 3), now),
            rollers=StampedInput(RollerState(config.roller_positions, speeds), now),
            pose=StampedInput(world.body.pose, now - 0.01 * int(rng.integers(3))),
        )
        decision = servo.decide(now)
        speeds = decision.command.roller_velocities
        assert np.abs(speeds).max() <= robot.description.max_speed * (1.0 + 1e-6)
    return decision


def deform(world):
    """Load a joint, and a tube at places that may be one or at its ends."""
    joint = str(world.rng.choice(list(world.robot.description.joints)))
    number = int(world.rng.integers(len(world.robot.member_names)))
    shares = world.rng.choice([0.0, 1e-9, 0.3, 0.3, world.rng.random(), 1.0], 2)
    places = shares * world.config.member_lengths[number]
    rows = [[place, *world.numbers(3, -20.0, 20.0)] for place in places.tolist()]
    return core.deform(
        world.config,
        joint_loads={joint: world.numbers(2, -30.0, 30.0)},
        tube_loads={world.robot.member_names[number]: rows[: world.rng.integers(3)]},
        paper_model=bool(world.rng.integers(2)),
    )


def differentiate(world):
    """Return derivatives of a settled grasp."""
    settled = core.settle_grasp(world.config, world.body, abs(world.number(0.2, 1.0)))
    gradient = core.grasp_gradient(settled)
    return gradient.pose, gradient.slip_margin, gradient.stiffness, gradient.utilisation


def estimate(world):
    """Estimate offsets from readings of encoders and a pose."""
    estimator = StateEstimator(world.robot)
    estimator.set_grip(world.grip)
    estimator.take_encoders(1.0, world.config.roller_positions)
    estimator.take_pose(1.0, world.body.pose, world.rng.uniform(1e-4, 1e-3, 3))
    estimator.take_encoders(1.1, world.config.roller_positions + world.travel(0.001))
    return estimator.estimate().travel


def displaced(world):
    """Return a pose of the object nearby, or one that is not valid."""
    return np.array(world.body.pose) + world.numbers(3, -0.02, 0.02)


#: Calls with their relative frequencies [-].
CALLS = {
    lambda w: w.robot.configuration(w.travel(1.0) + w.numbers(1, -0.1, 0.1)): 20,
    solve_twist: 40,
    lambda w: core.solve_twist_ahead(
        w.config, w.grip, w.numbers(3, -0.2, 0.2), w.number(0.0, 0.05), w.failed
    ): 5,
    lambda w: core.solve_joint_velocity(
        w.config, {w.robot.topology.joint_names[0]: w.numbers(2, -0.2, 0.2)}, w.failed
    ): 10,
    decide: 20,
    simulate: 5,
    lambda w: (shape_margins(w.config), core.reachable_twists(w.config, w.grip, w.failed)): 10,
    deform: 5,
    lambda w: core.analyze_grasp(w.config, w.body, w.number(0, 1), w.numbers(3, -20, 20)): 5,
    lambda w: core.settle_grasp(
        w.config, w.body, w.number(0.0, 1.0), w.numbers(3, -20.0, 20.0), members=w.grip.members
    ): 5,
    lambda w: core.reach_pose(w.config, w.grip, displaced(w)): 1,
    lambda w: foresee_path.foresee_grip(
        w.config, w.body, abs(w.number(0.2, 1.0)), np.array([w.body.pose, displaced(w)])
    ): 1,
    differentiate: 3,
    estimate: 3,
    lambda w: release.plan_release(w.config, w.body, w.grip.members, w.number(0.0, 0.1)): 1,
    lambda w: core.plan_grasps(
        w.config, w.body, core.GraspRequirements(count=1, friction=0.5), thorough=False
    ): 0.1,
}


def has_nan(result):
    if isinstance(result, float | np.ndarray):
        return np.asarray(result).dtype.kind in 'fc' and bool(np.isnan(result).any())
    if isinstance(result, dict):
        return any(map(has_nan, result.values()))
    if isinstance(result, list | tuple):
        return any(map(has_nan, result))
    if isinstance(result, core.Configuration):
        return has_nan(result.nodes)
    if dataclasses.is_dataclass(result) and not isinstance(result, type):
        fields = dataclasses.fields(result)
        return any(has_nan(getattr(result, f.name)) for f in fields if not f.name.startswith('_'))
    return False


@functools.lru_cache(maxsize=1)
def world_of(number):
    """Return a robot with an object in some state."""
    return World(np.random.default_rng((number, 0)))


def call(seed):
    """Make one call, which returns numbers or raises an error of this package."""
    world = world_of(seed // CALLS_IN_WORLD)
    world.rng = rng = np.random.default_rng(seed)
    shares = np.array(list(CALLS.values()))
    function = list(CALLS)[rng.choice(len(CALLS), p=shares / shares.sum())]
    with warnings.catch_warnings(), contextlib.suppress(core.IsotrussError):
        warnings.simplefilter('error')
        result = function(world)
        assert not has_nan(result), f'call {seed}: NaN in {result}'


CHUNK = 100
FIRST, COUNT = int(os.environ.get('FIRST_CALL', '0')), int(os.environ.get('CALLS', '2000'))


@pytest.mark.parametrize('first', some_now(range(FIRST, FIRST + COUNT, CHUNK)))
def test_random_calls_give_numbers_or_an_error_of_this_package(first, capfd):
    for seed in range(first, first + CHUNK):
        call(seed)
    assert capfd.readouterr() == ('', '')
