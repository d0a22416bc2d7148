# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Configurations of the nine-member robot with an object between two of its members."""

from isotruss_ros import core
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.model.pose import pose_difference
import numpy as np
import robots
from walks import rolled
from wedge import closed_to

#: Settings of the squeeze control for the elastic plant, which has no masses, and pulls.
MASSLESS = {'pose_gain': 20.0, 'load': 5.0}


def gripped(degrees, squeeze):
    """Return the nine-member robot and a disc pressed into its wedge of so many degrees."""
    config = closed_to(robots.preset('nine_member').home, degrees, 0.3)
    return config, disc_grip(config, 'north/Z', shift=squeeze).body


def disc_grip(config, module, diameter=0.3, shift=0.0):
    """Return the grip of a disc that touches both members at a module."""
    center = core.tangent_center(config, module, diameter, shift)
    return core.Grip.at_module(config.robot, module, core.ConvexObject.disc(center, diameter))


def held_at(config, module, diameter=0.3):
    """Return how a disc is held that touches both members at a module."""
    return core.RollingGrip.attach(config, disc_grip(config, module, diameter))


def surface(grip):
    """Return what makes speeds of the object's surface of a twist: |v|^2 + |omega d/2|^2."""
    return np.array([1.0, 1.0, grip.body.arm])


def drive(rolling, twist, duration, rate=20.0, lead=None):
    """Carry out a twist by commands for the middles of the intervals, or another lead [s]."""
    lead = 0.5 / rate if lead is None else lead
    for _ in range(round(duration * rate)):
        command = core.solve_twist_ahead(rolling.config, rolling.grip, twist, lead)
        assert command.status is core.Status.OK
        rolling = rolled(rolling, command.roller_velocities / rate)
    return rolling


def apart(pose, other):
    """Return the distance [m] and the angle [rad] between two poses."""
    x, y, turn = pose_difference(pose, other)
    return float(np.hypot(x, y)), abs(turn)


def pressed_between(robot, module, share, deep, config=None):
    """Return a configuration, and a cylinder pressed by `deep` into both sides of a module."""
    config = config or robot.home
    b, b_end, c, c_end = robots.side_ends(config, module)
    one, other = (b_end - b) / abs(b_end - b), (c_end - c) / abs(c_end - c)
    middle = (one + other) / abs(one + other)
    center = 0.5 * (b + c) + share * min(abs(b_end - b), abs(c_end - c)) * middle
    clear = min(abs(((center - b) * one.conj()).imag), abs(((center - c) * other.conj()).imag))
    diameter = 2.0 * (clear + deep) - robot.description.tube_diameter
    return config, core.ConvexObject.disc((center.real, center.imag), diameter)


def random_pressed(rng):
    while True:
        kind = rng.choice([*robots.PRESETS, ''])
        robot = robots.preset(kind) if kind else robots.random_robot(int(rng.integers(2**32)))
        module = robot.module_names[rng.integers(len(robot.module_names))]
        share, deep = rng.uniform(0.35, 0.6), 10.0 ** rng.uniform(-4.0, -2.0)
        try:
            return pressed_between(robot, module, share, deep, robots.random_state(robot, rng))
        except GraspError:
            # The sides are closer than the tubes are thick.
            continue


def backed_off(config, body, distance, steps=10):
    """Return configurations in which the wedge moves back from a disc along its bisector."""
    diameter = body.shape.diameter
    centers = (core.tangent_center(config, 'north/Z', diameter, d) for d in (0.01, 0.02))
    near, deep = (complex(*center) for center in centers)
    back = distance / steps * (deep - near) / abs(deep - near)
    configs = [config]
    for step in range(steps):
        where = body.center + step * back
        moved = core.ConvexObject.disc((where.real, where.imag), diameter)
        grip = core.Grip.at_module(config.robot, 'north/Z', moved)
        rows = grip_jacobian(configs[-1], grip)
        travel = np.linalg.pinv(rows) @ [back.real, back.imag, 0.0, 0.0]
        configs.append(configs[-1].moved_to(configs[-1].roller_positions + travel))
    return configs
