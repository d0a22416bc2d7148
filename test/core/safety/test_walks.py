# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random walks of some hundred steps; `make soak` walks more."""

import os

from driven import Driven
from isotruss_ros import core
from nightly import some_now
import numpy as np
import pytest
import walks
from walks import margins, ROBOT

#: Changes of the speed of a roller from cycle to cycle that do not count as chatter [m/s].
CHATTER = 0.005
#: Largest number of reversals at which one limit binds in place of another [-].
EXCHANGE = 2
#: Largest decrease of a margin beyond its bound [m].
LOST = 1e-4


def begin_beyond(rng):
    """Return an object held at a module, the robot beyond some bounds."""
    modules = ROBOT.module_names
    while True:
        try:
            config = ROBOT.configuration(rng.uniform(-0.8, 0.8, len(ROBOT.roller_names)))
            diameter, module = float(rng.uniform(0.1, 0.4)), modules[rng.integers(len(modules))]
            body = core.ConvexObject.disc(core.tangent_center(config, module, diameter), diameter)
            held = core.RollingGrip.attach(config, core.Grip.at_module(ROBOT, module, body))
            if margins(held).min() < 0.0:
                return held
        except core.IsotrussError:
            continue


def come_back(seed, steps=40):
    """Command a twist from beyond bounds; return roller velocities and lost margins (3,)."""
    rng = np.random.default_rng([seed, 7])
    held = begin_beyond(rng)
    period = float(rng.choice([0.02, 0.01, 0.005, 0.002]))
    robot = Driven(held, period, slide_along_limits=bool(seed % 3 == 2))
    twist = rng.standard_normal(3) * rng.choice([0.03, 0.1])
    commands, lost, first = [], np.zeros(3), margins(held)
    for _ in range(steps):
        commands.append(robot.step(twist).roller_velocities)
        lost = np.maximum(lost, np.where(first < 0.0, first - margins(robot.held), 0.0))
    return np.array(commands), lost


def reversals(commands):
    """Return the number of cycles in which a roller reverses its acceleration."""
    changes = np.diff(commands, axis=0)
    turned = changes[1:] * changes[:-1] < 0.0
    noticed = np.minimum(np.abs(changes[1:]), np.abs(changes[:-1])) > CHATTER
    return int((turned & noticed).any(axis=1).sum())


#: Seeds of walks that come to the bounds, with their steps, and what each of them must show.
WALKS = {
    15: (220, core.Status.SLOWED_OBJECT),
    0: (600, core.Status.SLOWED_SELF_COLLISION),
    13: (600, core.Status.SLOWED_RIGIDITY),
    2: (600, core.Status.SLIDING),
    17: (600, core.Status.SLIDING),
    # Its commands at 20 Hz go to and fro beside the bound for seconds.
    30: (280, core.Status.ACCELERATING),
}


@pytest.mark.parametrize('seed', some_now(WALKS))
def test_walk_never_crosses_a_bound(seed):
    steps, status = WALKS[seed]
    result = walks.walk(seed, steps, slide=seed % 3 == 2)
    assert not result.crossed, result
    assert result.quickest <= walks.ROBOT.description.max_acceleration * (1.0 + 1e-6)
    assert status in result.statuses


@pytest.mark.parametrize(('seed', 'steps'), some_now([(2, 200), (0, 600)]))
def test_walks_cross_a_bound_without_the_guard(seed, steps):
    assert walks.walk(seed, steps, guarded=False).crossed


@pytest.mark.parametrize('seed', some_now([20, 40, 77, 99, 224, 889], 3))
def test_a_robot_beyond_bounds_gets_no_further_beyond_them_and_does_not_chatter(seed):
    commands, lost = come_back(seed, steps=20)
    assert commands.any()
    assert reversals(commands) <= EXCHANGE
    assert lost.max() < LOST


@pytest.mark.nightly
@pytest.mark.parametrize('seed', range(int(os.environ.get('WALKS', '3'))))
def test_other_walks_neither_cross_a_bound_nor_chatter(seed):
    result = walks.walk(seed, 1000, slide=seed % 3 == 2)
    assert not result.crossed, result
    assert result.quickest <= walks.ROBOT.description.max_acceleration * (1.0 + 1e-6)
    commands, lost = come_back(seed)
    assert reversals(commands) <= EXCHANGE
    assert lost.max() <= LOST
