# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random grasps whose parameters change by steps, and gradients against their differences."""

from dataclasses import replace
from typing import NamedTuple

from held_grips import numbers
from isotruss_ros.core import (
    ConvexObject,
    Disc,
    Ellipse,
    load_robot,
    place_between,
    Polygon,
    Robot,
)
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.depths import member_depths
import numpy as np
from robots import random_state

FILE = load_robot('nine_member').description
#: Laws of the order of the theory, at 34.5 kPa and 0.86 m from ring to ring.
LAWS = {
    'model': 'power_law',
    'axial': {'C': 8.0, 'a': 0.6, 'b': -0.2},
    'transverse': {'C': 0.5, 'a': 0.6, 'b': -1.2},
    'rotary': {'C': 0.3, 'a': 0.6, 'b': 0.9},
}
SECTION = {
    'model': 'section',
    'axial_rigidity': 4e3,
    'flexural_rigidity': 25.0,
    'shear_rigidity': 1.9e3,
}
ROBOTS = [
    Robot(FILE),
    Robot(replace(FILE, stiffness=SECTION, stiffness_scale=1.2)),
    Robot(replace(FILE, stiffness=LAWS)),
]
SPREAD = 2.0 * np.pi / 5.0 * np.arange(5)
BOX = np.array([(-1.0, -0.8), (1.0, -0.8), (1.0, 0.8), (-1.0, 0.8)])
#: At a module, apart, and three around the object.
MEMBERS = (
    ('north/P-Z', 'north/Z-R'),
    ('south/P-Q', 'north/R-P'),
    ('south/P-Q', 'south/Q-X', 'south/X-P'),
)
#: Steps of the differences, as shares of a step each.
SHARES = (1.0, -1.0, 2.0, -2.0, 4.0, -4.0)


class Chosen(NamedTuple):
    """What an optimiser chooses of a grasp."""

    config: Configuration
    body: ConvexObject
    wrench: np.ndarray
    pressures: np.ndarray
    friction: float = 0.5
    scale: float = 1.0

    def changed(self, change, parameters):
        """Return the same with other parameters."""
        config, body, wrench, pressures, friction, scale = self
        return Chosen(
            config.moved_to(config.roller_positions + change[parameters.rollers]),
            body.moved_to(np.add(body.pose, change[parameters.place])),
            wrench + change[parameters.wrench],
            pressures + change[parameters.pressures],
            friction + change[parameters.friction],
            scale + change[parameters.stiffness],
        )


class RandomGrasp:
    """A random grasp: of discs, polygons and ellipses, by tubes of all models."""

    def __init__(self, number):
        self.rng = rng = np.random.default_rng(number)
        robot = ROBOTS[number % 3]
        self.members = MEMBERS[number // 3 % 3]
        config = random_state(robot, rng, 0.01)
        angle = rng.uniform(-3.0, 3.0)
        if number % 4 == 3:
            angle = np.pi / 3.0 + 0.01 * rng.normal()  # a face on a side
        size, depth = rng.uniform(0.1, 0.25), rng.uniform(0.01, 0.03)
        corners = np.exp(1j * (rng.uniform(0.0, 0.9, 5) + SPREAD))
        narrow = rng.uniform(0.6, 0.95)
        grip, own = None, numbers(self.members)
        # Of three members it is to press on all.
        while grip is None or member_depths(config, grip.body)[own].min() < 0.003:
            size *= 1.01
            shape = (
                Disc(2.0 * size),
                Ellipse((size, narrow * size)),
                Polygon(size * corners.view(float).reshape(-1, 2)),
                Polygon(size * BOX, corner_radius=0.02),
            )[number % 4]
            try:
                grip = place_between(config, self.members, shape, angle, depth)
            except GraspError:
                continue  # too small for these members
        wrench = rng.uniform(-0.5, 0.5, 3) * (1.0, 1.0, 0.1)
        self.chosen = Chosen(config, grip.body, wrench, rng.uniform(25e3, 45e3, 3))
        self.paper_model = number % 5 == 0

    def step(self, parameters, sizes):
        """Return how parameters change, (p,), in a random direction, by the sizes of that."""
        step = np.zeros(parameters.size)
        for name, size in sizes.items():
            place = getattr(parameters, name)
            step[place] = size * self.rng.choice([-1.0, 1.0], np.shape(step[place]))
        return step


def largest_error(exact, reached, step):
    """
    Return the largest error of a gradient, as a share of the sum of what all parameters do.

    None where differences of other steps differ, as they do where something changes on the way.

    :param exact: rows (n, p) by name.
    :param reached: values (n,) by name, after steps by `SHARES`.
    :param step: (p,).
    """
    worst = 0.0
    for name, rows in exact.items():
        near, far, farthest = (
            (ahead[name] - behind[name]) / (2.0 * share)
            for ahead, behind, share in zip(reached[::2], reached[1::2], SHARES[::2], strict=True)
        )
        size = max((np.abs(rows) @ np.abs(step)).max(), 1e-7)
        best, other = (4.0 * near - far) / 3.0, (4.0 * far - farthest) / 3.0
        if np.abs(best - other).max() > 5e-7 * size:
            return None
        worst = max(worst, np.abs(rows @ step - best).max() / size)
    return worst
