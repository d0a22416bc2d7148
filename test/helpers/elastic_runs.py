# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recorded runs of the elastic plant, of which one parameter deviates from files and settings."""

from dataclasses import replace
import functools

from held_grips import CORNER, HOME, NINE
from isotruss_ros import core
from isotruss_ros.core.inputs import RollerState, StampedInput
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.servo.recorded_cycle import RecordedCycle
from isotruss_ros.core.servo.servo_settings import ServoSettings
from isotruss_ros.identification.gauge import Gauge
from isotruss_ros.identification.read_run import read_run
import numpy as np

FRICTION, MASS = 0.8, 1.0
PERIOD, COUNT = 0.25, 20
#: Standard deviations of the poses [m, m, rad] and of the gauge [N].
POSE_NOISE, GAUGE_NOISE = np.array([2e-4, 2e-4, 1e-3]), 0.05
NOMINAL = tuple(NINE.description.pressures.values())
STILL = np.zeros(3)


@functools.cache
def travels():
    """Return roller travel that closes the grip, moves the object forth and back, and rests."""
    center = core.tangent_center(HOME, 'north/Z', 0.3, 0.012)
    grip = core.Grip(CORNER, core.ConvexObject(core.Disc(0.3)).moved_to((*center, 0.0)))
    commands = [(STILL, 0.0)] * 8 + [(STILL, -0.003)] * 8
    commands += [(np.array([-0.02, -0.016, 0.0]), 0.0)] * 12
    commands += [(np.array([0.02, 0.016, 0.0]), 0.0)] * 12 + [(STILL, 0.0)] * 56
    config, rows = HOME, []
    for twist, opening in commands:
        rows.append(config.roller_positions)
        command = core.solve_twist(config, grip, twist, opening_rate=opening)
        config = config.moved_to(config.roller_positions + PERIOD * command.roller_velocities)
        grip = grip.moved_to(np.array(grip.body.pose) + PERIOD * command.achieved_twist)
    return np.array(rows), grip


def pull_at(number):
    """Return the force of a gauge on the object in a cycle: aside, and later out of the grip."""
    return np.array([1.0 * (44 <= number < 52), -0.12 * max(number - 68, 0)])


def gravity_at(number):
    """Return the gravity in the plane of the robot in a cycle [m/s^2]."""
    return np.array([0.0, 2.5 * (54 <= number < 66)])


def run_elastic(
    friction=FRICTION,
    stiffness=1.0,
    offset=0.0,
    pressure=1.0,
    delay=0,
    creep=0.0,
    mass=MASS,
    pressures_recorded=True,
    is_inclined=True,
    count=COUNT,
):
    """Return the measured run of a plant with these values; the delay is in cycles."""
    travel, grip = travels()
    random = np.random.default_rng(0)
    center = core.tangent_center(HOME, 'north/Z', 0.3, 0.012)
    body = replace(grip.body.moved_to((*center, 0.0)), mass=MASS)
    simulated = core.ElasticObject(body, friction, stiffness)
    settings = ServoSettings(replace(grip, body=body, friction=FRICTION), PERIOD, 1.0)
    cycles, readings, poses = [], [], []
    for number, place in enumerate(travel):
        now, config = PERIOD * number, HOME.moved_to(place)
        pull, gravity = pull_at(number), is_inclined * gravity_at(number)
        simulated.external_wrench = (*(pull + mass * gravity), 0.0)
        simulated.follow(config)
        squeeze = 0.0 if simulated.grasp is None else simulated.grasp.squeeze
        # With fixed displacements, forces are proportional to the stiffness.
        squeeze *= 1.0 - creep * number / len(travel)
        readings.append((now, squeeze + GAUGE_NOISE * random.standard_normal(), *pull, *gravity))
        poses.append(simulated.pose(config) + POSE_NOISE * random.standard_normal(3))
        speeds = np.zeros_like(place)
        rollers = place - offset * np.eye(len(place))[3]
        inputs = {
            'rollers': StampedInput(RollerState(rollers, speeds), now),
            'pose': StampedInput(Pose(*poses[max(number - delay, 0)].tolist()), now),
        }
        if pressures_recorded:
            inputs['pressures'] = StampedInput(tuple(pressure * np.array(NOMINAL)), now)
        status = core.Status.OK if simulated.dropped is None else core.Status.HALT_NOT_HELD
        decision = {'status': status, 'message': ''}
        cycles.append(RecordedCycle(number, now, settings, inputs, decision))
    rows = np.array(readings)
    gauge = Gauge('gauge', rows[:, 0], rows[:, 1], rows[:, 2:4], rows[:, 4:])
    return read_run(cycles, NINE, gauge, count)
