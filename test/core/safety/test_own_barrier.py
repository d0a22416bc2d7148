# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A barrier of one's own: the object stays above a height."""

from dataclasses import replace

from contracts import check_barrier
from driven import Driven
from grips import held_at
from isotruss_ros.core import load_robot, place_between, Polygon, Robot, Status
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
from isotruss_ros.core.safety.barrier_law import (
    ActiveValues,
    ALL_VALUES,
    BarrierLaw,
    NO_ACTIVE_VALUES,
)
from nightly import some_now
import numpy as np
import pytest

ROBOT = Robot(replace(load_robot('nine_member').description, max_acceleration=np.inf))


class HeightBarrier:
    """
    The object stays above a height.

    :param height: of its lowest point in the robot frame [m].
    :param band: so far above it is slowed [m].
    """

    status = Status.SLOWED_BARRIER
    needs_object = True

    def __init__(self, height, band=0.05):
        self.law = BarrierLaw(height, band)

    def active(self, config, grip):
        """Return the height of the lowest point, which moves and turns with the object."""
        value = self.values(config, grip, ALL_VALUES)
        if value[0] >= self.law.active_below:
            return NO_ACTIVE_VALUES
        (arm,) = grip.body.turn * grip.body.shape.support_points(np.array([-1j]) / grip.body.turn)
        rows = grip_jacobian(config, grip)
        by_rollers = rows[1] + arm.real * rows[2]
        return ActiveValues(
            np.array([0]), value, np.zeros((1, 2 * len(config.points))), by_rollers[None]
        )

    def values(self, config, grip, indices):
        """Return the height of the lowest point [m]."""
        return (grip.center.imag - grip.body.support(np.array([-1j])))[indices]

    def names(self, indices):
        """Return what the value is."""
        return ['the height of the object'] * len(indices)


@pytest.mark.parametrize('angle', [0.0, 0.4])
def test_the_barrier_keeps_the_contract_of_barriers(angle):
    box = Polygon([(-0.2, -0.15), (0.2, -0.15), (0.2, 0.15), (-0.2, 0.15)], 0.05)
    grip = place_between(ROBOT.home, ('north/P-Z', 'north/Z-R'), box, 0.3 + angle, 0.01)
    check_barrier(HeightBarrier(0.0, 10.0), ROBOT.home, grip, np.random.default_rng(1))


def drive(barriers, steps):
    """Command an object downward at 50 Hz; return its lowest points [m], and the last command."""
    held = held_at(ROBOT.home, 'north/Z')
    robot = Driven(held, 0.02, barriers=tuple(barriers), slide_along_limits=False)
    heights = []
    for _ in range(steps):
        command = robot.step((0.0, -0.5, 0.0))
        heights.append(robot.held.grip.center.imag - 0.15)
    return np.array(heights), command


@pytest.mark.parametrize(('band', 'steps'), some_now([(1e-3, 60), (0.05, 200)]))
def test_an_object_comes_to_rest_above_its_height_and_is_told_why(band, steps):
    """Also where it goes farther in a cycle than the band is wide."""
    free, _ = drive([], steps // 4)
    bound = 0.5 * (free[-1] + free[-2])
    assert free[-2] - free[-1] > 1e-3
    heights, command = drive([HeightBarrier(bound, band)], steps)
    assert heights.min() > bound
    assert heights[-1] == pytest.approx(bound, abs=1e-3)
    assert command.status is Status.SLOWED_BARRIER
    assert command.limiting == ('the height of the object',)
